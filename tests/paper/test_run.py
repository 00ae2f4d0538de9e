from __future__ import annotations

import errno
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pandas as pd
import plotly.graph_objects as go
import pytest

from sarl_core import InputError, WorkError
from sarl_core.paper import run
from sarl_core.paper.report import read_report
from sarl_core.paper.run import reproduce
from sarl_core.paper.sheets import SCRIPT
from sarl_core.paper.study import QUICK, Drawing, Frames, Study
from sarl_core.paper.verdicts import Claim
from sarl_core.progress import CancelledError, Progress, report

A_PICTURE = bytes.fromhex(  # one white point
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c4944415408d763f8ff"
    "ff3f0005fe02fea7359d6f0000000049454e44ae426082"
)
ALL_FILES = {
    "report.json",
    SCRIPT,
    *(f"figure_{name}.{kind}" for name in "23" for kind in ("csv", "html", "png")),
}


NAMES = {"environment": "CartPole-v1", "expert": "cartpole", "recording": 0}
OWN = "CartPole-v1,cartpole,0,"
HEAD = f"environment,expert,recording,x,value\n{OWN}"


def toy(name: str, value: float = 1.0) -> Study:
    """A study that measures one number; its claim compares it with that of the other one."""

    def measure(_: Any, progress: Progress | None) -> pd.DataFrame:
        report(progress, 0, 2)
        report(progress, 1, 2)
        return pd.DataFrame({**NAMES, "x": [0, 1], "value": [value, 2 * value]})

    def claims(frames: Frames) -> tuple[Claim, ...]:
        others = sorted(set(frames) - {name})
        ours = f"{frames[name]['value'].iloc[0]:g}"
        ours += "".join(f" beside {frames[other]['value'].iloc[0]:g}" for other in others)
        return (Claim("It is 1 < 2.", "nowhere", ours, "agrees", "always"),)

    def draw(frame: pd.DataFrame, part: str, dark: bool) -> tuple[Drawing, ...]:
        figure = go.Figure(go.Scatter(x=frame["x"], y=frame["value"]), layout={"height": 300})
        return (Drawing(f"Toy <{part}>", figure),)

    return Study(
        name=name,
        place=f"Figure {name}",
        title="A toy",
        about="Shows nothing.",
        measure=measure,
        settings=lambda _: {"environments": ["CartPole-v1"], "seeds": {"toy": 7}},
        numbers=lambda frame: {"sum": float(frame["value"].sum())},
        claims=claims,
        exchanged=lambda frame, rng: frame,
        parts=lambda frame: ("left", "right"),
        draw=draw,
        columns=("x", "value"),
    )


@pytest.fixture(autouse=True)
def toys(monkeypatch: pytest.MonkeyPatch) -> dict[str, Study]:
    """Two toys in place of the paper, and pictures without a browser."""

    @contextmanager
    def drawing() -> Iterator[Any]:
        yield lambda figure: A_PICTURE

    found = {"2": toy("2"), "3": toy("3", 5.0)}
    monkeypatch.setattr(run, "STUDIES", found)
    monkeypatch.setattr(run, "drawing_pictures", drawing)
    return found


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def content(folder: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((folder / "report.json").read_text())
    return document


def test_every_study_leaves_its_files_and_its_entry(tmp_path: Path, toys: dict[str, Study]) -> None:
    folder = tmp_path / "paper"
    seen: list[str] = []
    found = reproduce(
        folder, tuple(toys.values()), effort=QUICK, finished=lambda name, _: seen.append(name)
    )
    assert seen == ["2", "3"]
    assert names(folder) == ALL_FILES
    assert read_report(folder) == found
    entry = content(folder)["studies"]["2"]
    assert entry["quick"] is True
    assert entry["settings"]["seeds"] == {"toy": 7}
    assert entry["numbers"] == {"sum": 3.0}
    assert set(entry["inputs"]["CartPole-v1"]) == {"recordings", "experts"}
    assert {"python", "numpy", "gymnasium", "torch"} <= set(entry["versions"])
    assert entry["command"].endswith("--figure 2 --quick --out DIR")
    assert (folder / "figure_2.csv").read_text() == HEAD + "0,1.0\n" + OWN + "1,2.0\n"


def test_a_page_shares_the_script_and_shows_text_as_text(
    tmp_path: Path, toys: dict[str, Study]
) -> None:
    reproduce(tmp_path, (toys["2"],))
    page = (tmp_path / "figure_2.html").read_text()
    assert f'<script src="{SCRIPT}"></script>' in page
    assert len(page) < 100_000
    assert "https://" not in page
    assert "Toy &lt;left&gt;" in page
    assert "Toy &lt;right&gt;" in page
    assert "It is 1 &lt; 2." in page
    assert "quick run" not in page
    assert "plotly.js v" in (tmp_path / SCRIPT).read_text()[:200]


def test_a_page_without_the_script_has_its_picture_and_says_how_to_bring_it_back(
    tmp_path: Path, toys: dict[str, Study]
) -> None:
    reproduce(tmp_path, (toys["2"],))
    page = (tmp_path / "figure_2.html").read_text()
    (still,) = re.findall(r'<div class="still">.*?</div>', page)
    assert 'src="figure_2.png"' in still
    assert 'alt="Figure 2. A toy"' in still
    assert f"{SCRIPT} is not beside this page" in still
    assert "python -m sarl_core reproduce --figure table-1 --out DIR" in still
    # Only where Plotly is there are figures shown in its place.
    assert ".live .still { display: none; }" in page
    assert page.index(f'<script src="{SCRIPT}">') < page.index('className = "live"')


def test_one_figure_at_a_time_ends_at_the_same(tmp_path: Path, toys: dict[str, Study]) -> None:
    reproduce(tmp_path, (toys["3"],))
    assert content(tmp_path)["studies"]["3"]["claims"][0]["ours"] == "5"
    reproduce(tmp_path, (toys["2"],))
    # In the paper's order, and every claim knows every table.
    assert list(content(tmp_path)["studies"]) == ["2", "3"]
    assert content(tmp_path)["studies"]["3"]["claims"][0]["ours"] == "5 beside 1"
    assert "5 beside 1" in (tmp_path / "figure_3.html").read_text()


def test_what_is_finished_stays_when_the_rest_is_called_off(
    tmp_path: Path, toys: dict[str, Study]
) -> None:
    def watch(study: Study) -> Any:
        return nullcontext(lambda done, total: study.name == "2")

    with pytest.raises(CancelledError):
        reproduce(tmp_path, tuple(toys.values()), watch=watch)
    assert names(tmp_path) == {name for name in ALL_FILES if "figure_3" not in name}
    assert list(content(tmp_path)["studies"]) == ["2"]
    reproduce(tmp_path, tuple(toys.values()))
    assert names(tmp_path) == ALL_FILES
    assert list(content(tmp_path)["studies"]) == ["2", "3"]


def test_what_an_earlier_run_left_stays_until_it_is_made_anew(
    tmp_path: Path, toys: dict[str, Study], monkeypatch: pytest.MonkeyPatch
) -> None:
    reproduce(tmp_path, tuple(toys.values()))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def until(wanted: str) -> Any:
        return lambda study: nullcontext(lambda done, total: study.name in wanted)

    # Called off at once: as if nothing had been asked for.
    with pytest.raises(CancelledError):
        reproduce(tmp_path, tuple(toys.values()), watch=until(""))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    # Called off half way: the first is new, and the second as it was, but for what it compares.
    changed = toys | {"2": toy("2", 3.0), "3": toy("3", 7.0)}
    monkeypatch.setattr(run, "STUDIES", changed)
    with pytest.raises(CancelledError):
        reproduce(tmp_path, tuple(changed.values()), watch=until("2"))
    studies = content(tmp_path)["studies"]
    assert {name: one["numbers"]["sum"] for name, one in studies.items()} == {"2": 9.0, "3": 15.0}
    assert studies["2"]["claims"][0]["ours"] == "3 beside 5"
    assert studies["3"]["claims"][0]["ours"] == "5 beside 3"
    assert (tmp_path / "figure_3.csv").read_bytes() == before["figure_3.csv"]
    assert names(tmp_path) == ALL_FILES


def test_a_damaged_table_that_is_made_anew_keeps_its_entry_until_then(
    tmp_path: Path, toys: dict[str, Study]
) -> None:
    reproduce(tmp_path, tuple(toys.values()))
    old = content(tmp_path)["studies"]["3"]
    (tmp_path / "figure_3.csv").write_text("x\n1\n")
    with pytest.raises(CancelledError):
        reproduce(
            tmp_path,
            tuple(toys.values()),
            watch=lambda study: nullcontext(lambda done, total: study.name == "2"),
        )
    studies = content(tmp_path)["studies"]
    assert studies["3"] == old
    assert studies["2"]["claims"][0]["ours"] == "1"  # there is nothing to compare it with
    reproduce(tmp_path, (toys["3"],))
    assert content(tmp_path)["studies"]["2"]["claims"][0]["ours"] == "1 beside 5"


def test_several_damaged_tables_are_made_anew_by_the_command_that_is_named(
    tmp_path: Path, toys: dict[str, Study], monkeypatch: pytest.MonkeyPatch
) -> None:
    three = toys | {"4": toy("4")}
    monkeypatch.setattr(run, "STUDIES", three)
    reproduce(tmp_path, tuple(three.values()))
    for name in "34":
        (tmp_path / f"figure_{name}.csv").write_text("x\n1\n")
    with pytest.raises(
        InputError, match=r"figure_3\.csv, figure_4\.csv are missing or damaged; "
    ) as caught:
        reproduce(tmp_path, (three["2"],))
    assert "`reproduce --figure 3 --figure 4`" in str(caught.value)
    reproduce(tmp_path, (three["3"], three["4"]))
    assert content(tmp_path)["studies"]["2"]["claims"][0]["ours"] == "1 beside 5 beside 1"


def test_the_same_again_leaves_the_same_tables_and_pages(
    tmp_path: Path, toys: dict[str, Study], monkeypatch: pytest.MonkeyPatch
) -> None:
    reproduce(tmp_path, tuple(toys.values()))
    kinds = ("csv", "html")
    before = [(tmp_path / f"figure_3.{kind}").read_bytes() for kind in kinds]
    reproduce(tmp_path, tuple(toys.values()))
    assert [(tmp_path / f"figure_3.{kind}").read_bytes() for kind in kinds] == before
    changed = toys | {"3": toy("3", 6.0)}
    monkeypatch.setattr(run, "STUDIES", changed)
    reproduce(tmp_path, (changed["3"],))
    assert content(tmp_path)["studies"]["3"]["numbers"] == {"sum": 18.0}
    assert content(tmp_path)["studies"]["2"]["claims"][0]["ours"] == "1 beside 6"


def test_a_folder_that_cannot_be_used_is_refused(tmp_path: Path, toys: dict[str, Study]) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="is a file"):
        reproduce(tmp_path / "file", (toys["2"],))
    with pytest.raises(InputError, match="cannot be made"):
        reproduce(tmp_path / "no" / "where", (toys["2"],))
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "report.json").write_text('{"mine": true}')
    with pytest.raises(InputError, match="no report of this program"):
        reproduce(tmp_path / "other", (toys["2"],))
    assert (tmp_path / "other" / "report.json").read_text() == '{"mine": true}'
    assert names(tmp_path / "other") == {"report.json"}


def test_a_study_of_a_later_version_is_left_alone(
    tmp_path: Path, toys: dict[str, Study], monkeypatch: pytest.MonkeyPatch
) -> None:
    later = toys | {"9": toy("9")}
    monkeypatch.setattr(run, "STUDIES", later)
    reproduce(tmp_path, (later["9"],))
    monkeypatch.setattr(run, "STUDIES", toys)
    with pytest.raises(InputError, match="'9' that this version does not know"):
        reproduce(tmp_path, (toys["2"],))


def test_a_damaged_table_is_named_unless_it_is_made_anew(
    tmp_path: Path, toys: dict[str, Study]
) -> None:
    reproduce(tmp_path, tuple(toys.values()))
    (tmp_path / "figure_3.csv").write_text("x\n1\n")
    with pytest.raises(InputError, match=r"figure_3.csv is not the table of Figure 3"):
        reproduce(tmp_path, (toys["2"],))
    reproduce(tmp_path, (toys["3"],))
    assert (tmp_path / "figure_3.csv").read_text() == HEAD + "0,5.0\n" + OWN + "1,10.0\n"


def test_a_full_disk_is_said_and_what_was_there_stays(
    tmp_path: Path, toys: dict[str, Study], monkeypatch: pytest.MonkeyPatch
) -> None:
    reproduce(tmp_path, (toys["2"],))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pd.DataFrame, "to_csv", full)
    with pytest.raises(WorkError, match="No space left on device"):
        reproduce(tmp_path, (toys["3"],))
    after = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    del after["figure_3.png"]  # drawn, but no entry names it
    assert after == before


def test_without_a_browser_nothing_is_begun(
    tmp_path: Path, toys: dict[str, Study], monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def missing() -> Iterator[Any]:
        raise WorkError("the picture could not be drawn, which takes Chromium; install one")
        yield

    monkeypatch.setattr(run, "drawing_pictures", missing)
    with pytest.raises(WorkError, match="Chromium"):
        reproduce(tmp_path / "paper", (toys["2"],))
    assert names(tmp_path / "paper") == set()
