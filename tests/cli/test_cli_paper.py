"""The command that reproduces the paper: what it says, and what can go wrong."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sarl_core.cli.app import main
from sarl_core.paper.report import read_report
from sarl_core.paper.studies import STUDIES
from sarl_core.paper.tables import read_table
from sarl_core.rollouts import episodes
from tests.paper.test_report import ENTRY


def test_help_has_an_example_and_tells_its_options(run):
    text = run("reproduce", "--help")
    assert "python -m sarl_core reproduce" in text.split("Example:")[1]
    for option in ("--figure", "--quick", "--out", "--json"):
        assert option in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--figure", "8"), "choose from 2, 3, table-1, 4, 5, 6, 7, divider"),
        (("--figure", "1"), "drawing of the method"),
        (("--figure", ""), "choose from"),
        (("--figure", "two\nthree"), "choose from"),
        (("--quick", "--out", "a-file"), "is a file"),
        (("--quick", "--out", "no/where"), "no/where cannot be made"),
        (("--episodes", "0"), "--episodes"),
    ],
)
def test_what_a_user_got_wrong_is_one_line_and_code_2(
    arguments, words, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Path("a-file").write_text("mine")
    assert main(["reproduce", "--out", "paper", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith("error: ")
    assert words in line
    assert [path.name for path in tmp_path.iterdir()] == ["a-file"]


def test_out_is_needed(capsys):
    assert main(["reproduce", "--quick"]) == 2
    assert "--out" in capsys.readouterr().err


def test_without_a_browser_it_is_code_1_before_any_work(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("BROWSER_PATH", "/nowhere/chromium")
    assert main(["reproduce", "--quick", "--out", str(tmp_path / "paper")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "installed Chromium or Chrome" in line


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((), list(STUDIES)),
        (("--figure", "5"), ["5"]),
        (("--figure", "divider", "--figure", "Figure 2", "--figure", "2"), ["2", "divider"]),
    ],
)
def test_some_figures_or_all_in_the_order_of_the_paper(arguments, expected, monkeypatch):
    chosen = []

    def noted(folder, studies, **_):
        chosen.extend(study.name for study in studies)
        raise KeyboardInterrupt

    monkeypatch.setattr("sarl_core.paper.run.reproduce", noted)
    assert main(["reproduce", "--out", "paper", *arguments]) == 130
    assert chosen == expected


@pytest.mark.parametrize(
    ("done", "words"),
    [
        ([], "stopped; no figure was finished"),
        (["2"], "stopped; Figure 2 in paper can be used"),
    ],
)
def test_control_c_says_what_was_finished(done, words, capsys, monkeypatch):
    def interrupted(*_, finished, **__):
        for name in done:
            finished(name, ENTRY)
        raise KeyboardInterrupt

    monkeypatch.setattr("sarl_core.paper.run.reproduce", interrupted)
    assert main(["reproduce", "--out", "paper"]) == 130
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"error: {words}"


def to_nine_digits(numbers):
    """As JSON; pandas 2 reads the last digits of a table's numbers as it likes."""
    return json.loads(
        json.dumps(numbers),
        parse_constant=lambda _: None,
        parse_float=lambda text: float(f"{float(text):.9g}"),
    )


def in_nine_digits(content):
    """A file's bytes, with the numbers in it as `to_nine_digits` has them."""

    def written_out(packed):
        values = np.frombuffer(base64.b64decode(json.loads(b'"' + packed[1] + b'"')), "<f8")
        return b",".join(b"%.9g" % value for value in values.tolist())

    content = re.sub(rb'(?<="dtype":"f8","bdata":")([^"]*)', written_out, content)
    return re.sub(rb"\d+\.\d+(e-?\d+)?", lambda number: b"%.9g" % float(number[0]), content)


@pytest.mark.slow
def test_the_paper_quickly(capsys, tmp_path, monkeypatch):
    """Every study is measured, drawn and judged; only the numbers mean little."""
    monkeypatch.setattr(episodes, "MAX_STEPS", 100)  # most of the time is the walker's
    folder = tmp_path / "paper"
    assert main(["reproduce", "--quick", "--out", str(folder)]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    assert "This was a quick run" in printed.out
    report = read_report(folder)
    assert report is not None
    assert list(report.studies) == list(STUDIES)
    left = {"report.json", "plotly.min.js"}
    for name, entry in report.studies.items():
        study = STUDIES[name]
        assert f"{study.place} is finished" in printed.out
        left |= set(entry.files.values())
        frame = read_table(study, folder / entry.files["table"])
        # What the report says follows from the table that was left.
        assert to_nine_digits(study.numbers(frame)) == to_nine_digits(entry.numbers)
        with Image.open(folder / entry.files["picture"]) as picture:
            assert picture.width == 2480
            assert picture.convert("L").getextrema()[0] < 100
        page = (folder / entry.files["page"]).read_text()
        drawings = [one for part in study.parts(frame) for one in study.draw(frame, part, False)]
        assert page.count("Plotly.newPlot") == len(drawings)
        assert entry.quick
        assert entry.settings["seeds"]
        assert entry.claims
        # Two recordings decide nothing.
        assert {claim.verdict for claim in entry.claims} == {"cannot be judged"}
        assert all(claim.by_chance is None for claim in entry.claims)
        assert "nan" not in " ".join(claim.ours for claim in entry.claims)
    assert {path.name for path in folder.iterdir()} == left
    assert sum(path.stat().st_size for path in folder.iterdir()) < 10_000_000
    # One figure again, with the others there: the same table, and nothing else is touched.
    before = {path.name: in_nine_digits(path.read_bytes()) for path in folder.iterdir()}
    assert main(["reproduce", "--quick", "--figure", "5", "--out", str(folder), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert list(document["studies"]) == list(STUDIES)
    after = {path.name: in_nine_digits(path.read_bytes()) for path in folder.iterdir()}
    changed = {name for name in after if after[name] != before[name]}
    assert "figure_5.csv" not in changed
    # Figure 6 compares its falls with those of Figure 5, and these are the same as before.
    assert changed <= {"report.json", "figure_5.html", "figure_5.png"}
