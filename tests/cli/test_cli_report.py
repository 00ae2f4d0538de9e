"""The command report: one file, whole or not at all."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from sarl_core.cli.app import main

ROOT = Path(__file__).resolve().parents[2]
CART = str(ROOT / "data" / "demonstrations" / "cartpole.parquet")
LANDER = str(ROOT / "data" / "demonstrations" / "lunar_lander.parquet")


@pytest.fixture(scope="module")
def filtered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "rules.json"
    assert main(["mine", CART, "--setting", "filtered", "--out", str(path)]) == 0
    return path


def test_the_same_command_gives_the_same_bytes(run, filtered, tmp_path):
    out = tmp_path / "report.html"
    arguments = ("report", filtered, "--demonstrations", CART, "--out", out, "--episodes", 2)
    document = json.loads(run(*arguments, "--frames", 1, "--json"))
    assert document["rules"] == document["in_full"] == 5
    assert document["pictures"] >= 2
    assert document["without_pictures"] is None
    first = out.read_bytes()
    assert document["bytes"] == len(first)
    assert b"--frames 1 --episodes 2 --out" in first
    assert "Wrote" in run(*arguments, "--frames", 1)
    assert out.read_bytes() == first
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_results_and_the_card_stand_in_it(run, tmp_path):
    rules = tmp_path / "few.json"
    shutil.copy(ROOT / "data" / "rules" / "cartpole_compact.json", rules)
    shutil.copy(ROOT / "data" / "rules" / "cartpole_compact.card.json", tmp_path / "few.card.json")
    for agent in ("novice", "expert"):
        told = run("evaluate", "--env", "CartPole-v1", "--agent", agent, "--episodes", 2, "--json")
        (tmp_path / f"{agent}.json").write_text(told)
    out = tmp_path / "report.html"
    results = [tmp_path / "novice.json", tmp_path / "expert.json"]
    run(
        *("report", rules, "--demonstrations", CART, "--frames", 0, "--out", out),
        *(word for path in results for word in ("--comparison", path)),
    )
    html = out.read_text(encoding="utf-8")
    assert "The card of these rules" in html
    assert '<th scope="row">novice</th>' in html
    assert '<th scope="row">expert</th>' in html
    assert "<img" not in html


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--demonstrations", LANDER), "4 features and the demonstrations have 8"),
        (("--demonstrations", "missing.parquet"), "missing.parquet"),
        (("--demonstrations", CART, "--out", "report.docx"), ".html"),
        (("--demonstrations", CART, "--comparison", "missing.csv"), "missing.csv"),
        (("--demonstrations", CART, "--frames", "99"), "number of pictures a rule is 99"),
        (("--demonstrations", CART, "--agent", "nobody"), "'nobody'"),
        (("--demonstrations", CART, "--env", "Nowhere-v9"), "Nowhere-v9"),
        (("--demonstrations", CART, "--slides", "report.html"), "both name report.html"),
        ((), "--demonstrations"),
    ],
)
def test_what_cannot_be_reported_is_one_line(
    capsys, filtered, tmp_path, monkeypatch, options, words
):
    monkeypatch.chdir(tmp_path)
    assert main(["report", str(filtered), "--out", "report.html", *options]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert line.startswith("error: ")
    assert words in line
    assert list(tmp_path.iterdir()) == []
