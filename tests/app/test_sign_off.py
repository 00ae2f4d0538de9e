"""Report, Export and Audit say in one line whether the rules on the page are approved."""

from __future__ import annotations

import base64
from pathlib import Path

from streamlit.testing.v1 import AppTest

from sarl_core import RuleSet
from sarl_core.library import Library
from sarl_core.library.contents import add_rules
from sarl_dashboard.state.rule_files import CHOSEN
from tests.app.screens import ROUTER, open_page, run_through, texts

DATA = ROUTER.parents[1] / "data"
LOG = DATA / "demonstrations" / "cartpole.parquet"
NOBODY = "Not approved by anybody."
COMBINED = "compact, two features"


def approve() -> None:
    rules = RuleSet.load(DATA / "rules" / "cartpole_combined.json")
    with Library() as library:
        item = add_rules(library, rules, "two rules", author="Ada")
        library.approve(item.id, author="Eve", note="held <b>against</b> the logs")


def lines(app: AppTest) -> list[str]:
    """What is said of approval on the page."""
    return [
        line for line in texts(app).splitlines() if line.startswith(("Approved by", "Not approved"))
    ]


def test_the_export_says_it_on_the_page_and_in_the_file() -> None:
    app = open_page("export", data="cartpole", carry=COMBINED, format="Python", rounded="false")
    assert lines(app) == [NOBODY]
    assert f"# {NOBODY}" in app.code[0].value
    approve()
    app.run()
    (line,) = lines(app)
    assert line.startswith("Approved by Eve on ")
    assert line.endswith(": held <b>against</b> the logs.")
    assert f"# {line}" in app.code[0].value
    assert "before they were rounded" not in texts(app)
    app.toggle(key="rounded").set_value(True).run()  # other rules
    assert lines(app) == [NOBODY]
    assert "What was approved are the rules before they were rounded" in texts(app)


def test_the_audit_says_it() -> None:
    approve()
    app = open_page("audit", data="cartpole", audited=COMBINED)
    content = LOG.read_bytes()
    app.file_uploader(key="log_file").set_value((LOG.name, content, "")).run()
    assert not app.exception
    (line,) = lines(app)
    assert line.startswith("Approved by Eve on ")
    app.selectbox(key="audited").set_value(CHOSEN).run()
    assert lines(app) == [NOBODY]


def test_the_report_says_it_and_another_approval_makes_another() -> None:
    app = open_page("report", data="cartpole", report_rules=COMBINED, frames="0")
    assert lines(app) == [NOBODY]
    run_through(app, "report")
    assert app.button(key="run_report").disabled  # it is made
    approve()
    app.run()
    assert lines(app)[0].startswith("Approved by Eve on ")
    assert not app.button(key="run_report").disabled
    (frame,) = run_through(app, "report").get("iframe")
    html = base64.b64decode(frame.proto.src.split(",", 1)[1]).decode()
    assert "held &lt;b&gt;against&lt;/b&gt; the logs." in html


def test_without_a_library_nothing_is_said(place: Path) -> None:
    place.write_text("a file where the folder should be")
    app = open_page("export", data="cartpole", format="Python")
    assert lines(app) == []
    assert "pproved" not in app.code[0].value
