from __future__ import annotations

import base64
import time
from pathlib import Path
from threading import Event

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, mine_rules
from sarl_core.cli.app import main
from sarl_core.mining.rule_set import rules_to_json
from sarl_core.progress import Progress
from sarl_dashboard.jobs import report as report_jobs
from sarl_dashboard.jobs.queue import queue
from tests.app.screens import errors, open_page, texts, upload_rules

DATA = Path(__file__).parents[2] / "data"
CARTPOLE = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")


def made(app: AppTest) -> AppTest:
    """Press the button, and look in until the report is there, as the browser does."""
    app.button(key="run_report").click().run()
    for _ in range(3_000):
        assert not app.exception, app.exception
        if "cancel_report" not in [button.key for button in app.button]:
            return app
        time.sleep(0.1)
        app.run()
    raise AssertionError("the work does not end")


def shown(app: AppTest) -> str:
    """The report in the frame."""
    (frame,) = app.get("iframe")
    head, content = frame.proto.src.split(",", 1)
    assert head == "data:text/html;base64"
    return base64.b64decode(content).decode()


def test_a_pdf_is_printed_in_its_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = Event()

    def prints(html: str, progress: Progress) -> bytes:
        assert "<html" in html
        assert progress(2, 180)
        assert go_on.wait(30)
        return b"%PDF"

    monkeypatch.setattr(report_jobs, "document_to_pdf", prints)
    app = made(open_page("report", data="cartpole", frames="0", in_full="1"))
    app.button(key="run_report_on_paper").click().run()
    (job,) = queue().running or queue().waiting
    assert (job.page, job.place, job.lasts) == ("Report", "report_on_paper", True)
    for _ in range(300):
        if job.text == "Printing for 2 seconds …":
            break
        time.sleep(0.1)
    assert "cancel_report_on_paper" in [button.key for button in app.run().button]
    assert job.text in [bar.proto.text for bar in app.get("progress")]
    go_on.set()
    for _ in range(300):
        if not job.running:
            break
        time.sleep(0.1)
    labels = [button.label for button in app.run().get("download_button")]
    assert "Download as PDF" in labels
    assert "run_report_on_paper" not in [button.key for button in app.button]


def test_the_report_is_the_one_of_the_command_that_stands_in_it(tmp_path, monkeypatch) -> None:
    app = open_page("report", data="cartpole", frames="1")
    assert not errors(app)
    assert "5 rules, 5 of them in full" in texts(app)
    assert not app.get("iframe")
    html = shown(made(app))
    assert app.button(key="run_report").disabled
    labels = [button.label for button in app.get("download_button")]
    assert labels == ["Download the report", "Download the slides"]
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(DATA)
    cart = "data/demonstrations/cartpole.parquet"
    assert main(["mine", cart, "--setting", "filtered", "--out", "rules.json"]) == 0
    assert (
        main(
            [
                "report",
                "rules.json",
                "--demonstrations",
                cart,
                "--frames",
                "1",
                "--out",
                "report.html",
            ]
        )
        == 0
    )
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == html


def test_what_is_typed_stands_on_the_first_page_and_in_the_command() -> None:
    about = {"report_title": "Poles", "report_sign_off": "Ada\nGrace", "report_notes": "<b>!"}
    app = open_page("report", data="cartpole", frames="0", in_full="1", **about)
    assert app.text_input(key="report_title").value == "Poles"
    html = shown(made(app))
    page = html.split("</header>")[0]
    assert "<h1>Poles</h1>" in page
    assert all(f'<th scope="row">{name}</th>' in page for name in ("Ada", "Grace"))
    assert "&lt;b&gt;!" in page
    assert "--title Poles" in html


def test_rules_for_other_features_are_refused_in_place() -> None:
    app = open_page("report", data="lunar_lander")
    content = rules_to_json(mine_rules(CARTPOLE, supp_min=0.005, conf_min=0.95)).encode()
    upload_rules(app, "cart.json", content)
    (sentence,) = errors(app)
    assert "4 features and the demonstrations have 8" in sentence
    assert "run_report" not in [button.key for button in app.button]


def test_without_demonstrations_the_page_says_what_to_do() -> None:
    assert "Nothing has been uploaded" in texts(open_page("report", data="upload"))


def test_results_come_from_files_and_wrong_ones_are_named() -> None:
    app = open_page("report", data="cartpole", frames="0")
    header = "arm,episodes,mean,std,iqm,iqm_low,iqm_high\n"
    row = "novice & friends,20,22.5,3,22,21,24\n"
    results = app.file_uploader(key="report_results")
    results.set_value([("r.csv", (header + row).encode(), "")]).run()
    html = shown(made(app))
    assert "novice &amp; friends" in html
    assert "<img" not in html
    results = app.file_uploader(key="report_results")
    results.set_value([("r.csv", b"arm,episodes\n", "")]).run()
    (sentence,) = errors(app)
    assert "no column 'mean'" in sentence


def test_shipped_rules_about_two_features_are_reported() -> None:
    app = open_page("report", data="cartpole", report_rules="compact, two features", frames="1")
    assert not errors(app)
    assert "2 rules, 2 of them in full" in texts(app)
    assert "pole angle plus 0.27 s of pole angular velocity" in shown(made(app))
