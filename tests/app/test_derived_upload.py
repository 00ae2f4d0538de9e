"""Every page with demonstrations that derive features from what was observed."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import parse_qs

import pytest

from sarl_core import (
    load_demonstrations,
    save_demonstrations,
    with_combinations,
    with_formulas,
)
from tests.app.screens import ROUTER, errors, html, open_page, page_file, run_through, texts
from tests.app.test_demonstrations_page import upload
from tests.app.test_names_page import type_into

DATA = ROUTER.parents[1] / "data" / "demonstrations"
PAGES = (
    "episodes",
    "names",
    "thresholds",
    "rules",
    "evidence",
    "what_if",
    "edit",
    "difference",
    "export",
    "report",
    "replay",
    "shield",
    "audit",
    "ablation",
    "improve",
    "learning",
)


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Cart Pole with combinations and a formula."""
    demonstrations = with_formulas(
        with_combinations(load_demonstrations(DATA / "cartpole.parquet"), most=4),
        ["lean [rad] = abs(pole_angle)"],
    )
    path: Path = tmp_path_factory.mktemp("derived") / "combined.parquet"
    save_demonstrations(demonstrations, path)
    return path.read_bytes()


def test_every_page_opens_with_what_is_derived(content: bytes) -> None:
    app = upload(open_page("demonstrations"), ("combined.parquet", content))
    assert not app.exception, app.exception
    for page in PAGES:
        app.switch_page(page_file(page)).run()
        assert not app.exception, (page, app.exception)
    app.switch_page("rules.py").run()
    assert " of pole angular velocity" in texts(app) + html(app)


def test_what_if_has_a_slider_for_each_number_that_was_observed_and_no_other(
    content: bytes,
) -> None:
    app = upload(open_page("demonstrations"), ("combined.parquet", content))
    app.switch_page("what_if.py").run()
    assert sorted(slider.label for slider in app.slider if (slider.key or "").startswith("x")) == [
        "cart position (m)",
        "cart velocity (m/s)",
        "pole angle (rad)",
        "pole angular velocity (rad/s)",
    ]
    before = html(app)
    assert "Worked out from it" in texts(app)
    for number in (-0.04, 0.07):
        app.slider(key="x2").set_value(number).run()
        (value,) = re.findall('<td>lean</td><td class="n">(.*?)</td>', html(app))
        assert float(value) == pytest.approx(abs(app.slider(key="x2").value), rel=1e-3)
    for take in ("a demonstrated state", "a random covered state", "a random uncovered state"):
        app.selectbox(key="take").set_value(take).run()
        assert not app.exception, (take, app.exception)
    assert html(app) != before


def test_a_replay_says_what_was_derived_at_each_step(content: bytes) -> None:
    app = upload(open_page("demonstrations"), ("combined.parquet", content))
    app.switch_page("replay.py").run()
    app.selectbox(key="agent").set_value("novice").run()
    run_through(app, "replay")
    assert not app.exception, app.exception
    assert " of pole angular velocity" in texts(app) + html(app)


@pytest.mark.parametrize(
    ("name", "says"), [("lean", "stands twice"), ('it\'s a "pole"', "both quotation marks")]
)
def test_a_name_that_a_formula_cannot_live_with_is_refused_and_pages_stay(
    content: bytes, name: str, says: str
) -> None:
    app = upload(open_page("demonstrations"), ("combined.parquet", content))
    app.switch_page("names.py").run()
    type_into(app, 0, {2: {"Name": name}})
    (error,) = errors(app)
    assert says in error
    app.switch_page("rules.py").run()
    assert not app.exception, app.exception
    assert "pole angle" in " ".join(app.dataframe[0].value["When"])


def test_a_step_of_a_log_leads_to_what_if_with_what_was_observed() -> None:
    app = open_page("audit", data="cartpole", combine="every", confidence="0.9")
    name = "cartpole.parquet"
    log = (name, (DATA / name).read_bytes(), "application/octet-stream")
    app.file_uploader(key="log_file").set_value(log).run()
    assert not app.exception, app.exception
    (link,) = [one.proto for one in app.get("page_link") if one.proto.page == "what_if"]
    parameters = parse_qs(link.query_string)
    assert {name for name in parameters if name.startswith("x")} == {"x0", "x1", "x2", "x3"}


def test_gaps_are_listed_by_what_was_observed() -> None:
    app = open_page(
        "improve", data="cartpole", combine="every", expert="nobody", round_episodes="2"
    )
    run_through(app, "improve")
    assert not app.exception, app.exception
    table = app.dataframe[0].value
    observed = load_demonstrations(DATA / "cartpole.parquet").observed
    assert list(table)[2:] == [f"{one.name} ({one.unit})" for one in observed]


def test_a_model_takes_what_was_observed() -> None:
    app = open_page("export", data="cartpole", combine="every", format="ONNX")
    assert "`state` (B, 4) float32" in texts(app)
