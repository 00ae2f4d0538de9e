"""The examples run as they are, from another folder, and print what they promise."""

from __future__ import annotations

import re
import sys

import pytest

from .examples import ROOT, run

PRINTED = {
    "mine_and_shield": r"shielded\s+mean return +([\d.]+)",
    "choose_thresholds": r"are right in (\d+)%",
    "scikit_learn": r"right on ([\d.]+) ?%",
    "train_under_shield": r"mean return (\d+)",
    "crane": r"broke the rules in ([\d.]+)%",
    "prove_cartpole": r"stays on the track: for (\d+) of 500 steps",
}
LEAST = {
    "mine_and_shield": 100,  # alone about 22
    "choose_thresholds": 60,
    "scikit_learn": 85,
    "train_under_shield": 9,
    "crane": 15,
    "prove_cartpole": 150,
}


@pytest.mark.parametrize("name", PRINTED)
def test_an_example_runs_from_another_folder(name, tmp_path):
    printed = run([sys.executable, str(ROOT / "examples" / f"{name}.py")], tmp_path, library=ROOT)
    number = re.search(PRINTED[name], printed)
    assert number, printed
    assert float(number[1]) >= LEAST[name]


def test_every_example_is_run():
    assert {path.stem for path in (ROOT / "examples").glob("*.py")} == set(PRINTED)
