from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd
import pytest
from msgspec.structs import replace
from streamlit.testing.v1 import AppTest

from sarl_core.paper.chance import with_chance
from sarl_core.paper.division import continuous
from sarl_core.paper.replicates import environments, expert_digests, fingerprints
from sarl_core.paper.report import PaperReport, write_report
from sarl_core.paper.studies import STUDIES
from sarl_core.paper.study import FULL, FULL_MINUTES, experts_in
from sarl_core.paper.tables import write_table
from sarl_core.paper.verdicts import enough
from sarl_dashboard.views.paper import report_files as paper
from tests.app.screens import errors, open_page, texts
from tests.paper.frames import landscapes, learning
from tests.paper.test_division import table
from tests.paper.test_landscapes import AS_THE_PAPER, SMALL
from tests.paper.test_learning import A_LITTLE, DOWN
from tests.paper.test_report import ENTRY
from tests.paper.test_shields import cart, walker

DIVIDED = table({0: 285, 2: -35, 3: 180}, {0: -150, 2: -400, 3: -150})
FRAMES = {
    "2": landscapes({"CartPole-v1": AS_THE_PAPER, "LunarLander-v3": SMALL}),
    "4": learning(DOWN, A_LITTLE),
    "5": cart(),
    "7": walker(),
    "divider": DIVIDED,
}


def fill(folder: Path, frames: dict[str, pd.DataFrame]) -> None:
    """Results as `reproduce` leaves them, without pages and pictures."""
    entries = {}
    for name, frame in frames.items():
        study = STUDIES[name]
        write_table(frame, folder / f"{study.slug}.csv")
        entries[name] = replace(
            ENTRY,
            place=study.place,
            title=study.title,
            quick=name == "4",
            files={
                "table": f"{study.slug}.csv",
                "page": f"{study.slug}.html",
                "picture": f"{study.slug}.png",
            },
            claims=with_chance(study, frames, deals=3),
        )
    write_report(PaperReport(entries), folder)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, where the page looks for results."""
    monkeypatch.setattr(paper, "FOLDER", tmp_path)
    return tmp_path


def rendered(app: AppTest) -> str:
    """What stands in blocks of HTML, without the tags."""
    return "\n".join(
        re.sub(r"<style>.*?</style>|<[^>]*>", " ", block.proto.body, flags=re.DOTALL)
        for block in app.get("html")
    )


def charts(app: AppTest) -> list[dict[str, object]]:
    return [json.loads(chart.proto.spec) for chart in app.get("plotly_chart")]


def test_before_anything_is_reproduced_the_page_says_how(folder: Path) -> None:
    app = open_page("paper")
    assert "Nothing has been reproduced yet" in texts(app)
    assert f"takes about {FULL_MINUTES} minutes" in texts(app)
    assert [code.value for code in app.code] == ["python -m sarl_core reproduce --out data/paper"]
    assert not charts(app)


def test_the_claims_come_first_with_their_verdicts(folder: Path) -> None:
    fill(folder, FRAMES)
    app = open_page("paper")
    assert "Of 24 claims of the paper" in texts(app)
    assert "agree with **21**, agree partly with **2**, and do not agree with **1**" in texts(app)
    assert "**0** cannot be judged" in texts(app)
    assert "of 24 claims would agree: 4 that follow from the method" in texts(app)
    shown = rendered(app)
    assert shown.count("How this is decided") == 24
    assert "The lone novice's return varies between 8 and 95." in shown.replace("&#39;", "'")
    assert shown.count("Agrees ") >= 20


def test_claims_are_sorted_by_their_verdict(folder: Path) -> None:
    fill(folder, FRAMES)
    app = open_page("paper", verdict="Partly")
    assert rendered(app).count("How this is decided") == 2
    app = open_page("paper", verdict="Does not agree")
    assert rendered(app).count("How this is decided") == 1
    fill(folder, {"2": FRAMES["2"]})
    app.run()
    assert rendered(app).count("How this is decided") == 0
    assert "There is no such claim." in texts(app)


@pytest.mark.parametrize(
    ("name", "figures", "claims"),
    [("2", 2, 4), ("4", 3, 5), ("5", 3, 7), ("7", 3, 6), ("divider", 3, 2)],
)
def test_a_figure_stands_beside_its_claims(
    name: str, figures: int, claims: int, folder: Path
) -> None:
    fill(folder, FRAMES)
    study = STUDIES[name]
    app = open_page("paper", figure=study.place)
    assert f"{study.place}. {study.title}" in texts(app)
    assert len(charts(app)) == figures
    assert rendered(app).count("How this is decided") == claims
    assert ("quick run" in "".join(str(box.value) for box in app.warning)) == (name == "4")
    assert f"--figure {ENTRY.command.split()[5]}" in "".join(str(code.value) for code in app.code)


def test_a_part_can_be_chosen_and_linked_to(folder: Path) -> None:
    fill(folder, FRAMES)
    app = open_page("paper", figure="Figure 7", part_7="divider 3")
    lines = {trace["name"]: trace for trace in charts(app)[0]["data"]}  # type: ignore[attr-defined]
    assert set(lines) == {"novice alone", "filtered", "unfiltered", "expert"}
    assert (
        "Return of every episode, one recording after the other, Bipedal Walker, divider 3"
        in texts(app)
    )
    assert "Made from 6 recordings of 3 experts for each environment." in texts(app)
    app = open_page("paper", figure="Figure 2", part_2="Lunar Lander")
    assert "Number of rules, Lunar Lander" in texts(app)


@pytest.mark.parametrize(
    "query", [{"figure": "Figure 99"}, {"figure": ""}, {"verdict": "<b>"}, {"part_2": "Nowhere"}]
)
def test_junk_in_a_link_falls_back_to_the_defaults(query: dict[str, str], folder: Path) -> None:
    fill(folder, FRAMES)
    app = open_page("paper", **query)
    assert "Of 24 claims of the paper" in texts(app)
    app = open_page("paper", **({"figure": "Figure 2"} | query))
    assert not app.exception


def test_a_figure_that_was_not_made_says_how(folder: Path) -> None:
    fill(folder, {"2": FRAMES["2"]})
    app = open_page("paper", figure="Figure 6")
    assert "Figure 6 has not been made yet" in texts(app)
    assert "--figure 6 --out data/paper" in app.code[0].value


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"format": "sarl-paper", "version": 9}'])
def test_a_damaged_report_is_one_sentence_and_the_command(content: bytes, folder: Path) -> None:
    (folder / "report.json").write_bytes(content)
    app = open_page("paper")
    (sentence,) = errors(app)
    assert "no report of this program" in sentence
    assert "reproduce" in app.code[0].value


@pytest.mark.parametrize("content", [None, "", "a,b\n1,2\n", "environment\nCartPole-v1\n"])
def test_a_damaged_table_is_one_sentence(content: str | None, folder: Path) -> None:
    fill(folder, FRAMES)
    path = folder / "figure_2.csv"
    if content is None:
        path.unlink()
    else:
        path.write_text(content)
    app = open_page("paper", figure="Figure 2")
    (sentence,) = errors(app)
    assert "figure_2.csv" in sentence
    assert not charts(app)
    # The other figures are still there.
    app.segmented_control(key="figure").set_value("Figure 5").run()
    assert not errors(app)
    assert len(charts(app)) == 3


def test_a_new_run_is_seen_at_once(folder: Path) -> None:
    fill(folder, {"2": FRAMES["2"]})
    app = open_page("paper")
    assert "Of 4 claims" in texts(app)
    fill(folder, FRAMES)
    app.run()
    assert "Of 24 claims" in texts(app)


def test_text_of_a_report_is_text(folder: Path) -> None:
    claim = replace(ENTRY.claims[0], ours="<img src=x onerror=alert(1)> & more")
    fill(folder, FRAMES)
    write_report(PaperReport({"2": replace(ENTRY, claims=(claim,))}), folder)
    app = open_page("paper")
    body = "".join(block.proto.body for block in app.get("html"))
    assert "<img" not in body
    assert "&lt;img src=x onerror=alert(1)&gt; &amp; more" in body


def test_the_committed_results_are_whole() -> None:
    """Every figure that this version knows was made in full, and is shown."""
    report = paper.report()
    assert list(report.studies) == list(STUDIES)
    for name, entry in report.studies.items():
        assert not entry.quick, name
        frame = paper.table(name, entry)
        found = json.dumps(STUDIES[name].numbers(frame))
        assert json.loads(found, parse_constant=lambda _: None) == entry.numbers
        assert all(map(enough, experts_in(frame).values())), name
        # Made of what is here now, all of it, in the way that this version knows.
        assert entry.settings == json.loads(json.dumps(STUDIES[name].settings(FULL)))
        own = entry.settings.get("environments", [entry.settings.get("environment")])
        assert list(entry.inputs) == own
        for env_id in own:
            made, there = entry.inputs[env_id], fingerprints(env_id, 1)
            assert made["experts"] == expert_digests(env_id, FULL.recordings)
            # Of the others the numbers alone: another processor adds up a network's products in
            # another order, and recordings made on it differ in the last bit.
            assert made["recordings"]["0"] == there["recordings"]["0"]
            assert list(made["recordings"]) == [str(number) for number in range(FULL.recordings)]
        assert all(claim.by_chance is not None for claim in entry.claims)
        if "environments" in entry.settings:
            ids = continuous() if name == "divider" else environments()
            assert entry.settings["environments"] == list(ids)
        for file in entry.files.values():
            assert (paper.FOLDER / file).is_file(), file
        app = open_page("paper", figure=entry.place)
        assert not errors(app)
        assert charts(app)
        assert {button.label for button in app.get("download_button")} == {
            "Page (HTML)",
            "Picture (PNG)",
            "Data (CSV)",
            "All numbers (JSON)",
        }
    assert sum(path.stat().st_size for path in paper.FOLDER.iterdir()) < 10_000_000
