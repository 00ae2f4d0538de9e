"""The table of the paper's claims."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core.paper import claims
from sarl_core.paper.claims import ClaimRow, decided
from sarl_core.paper.criteria import MeanBounds, Measurement, Sample
from sarl_core.paper.verdicts import Verdict

EXPERTS = ("a", "b", "c") * 2
ROW: ClaimRow[float] = ClaimRow(
    id="some",
    paper="Some.",
    where="Figure 9",
    measured="How many.",
    metric=lambda value: Measurement((Sample(np.full(6, value), EXPERTS),), "So many.", {"n": 6}),
    criterion=MeanBounds("above", 0.5, 0.25),
)


def test_every_claim_has_a_name_of_its_own() -> None:
    tables = [
        getattr(claims, name)
        for name in (*(f"FIGURE_{number}" for number in range(2, 8)), "TABLE_1", "DIVIDER")
    ]
    names = [row.id for table in tables for row in table]
    assert len(names) == len(set(names)) == 35


def test_a_row_is_decided_on_what_its_metric_measures() -> None:
    (claim,) = decided((ROW,), 0.9)
    assert claim.verdict == "agrees"
    assert claim.ours == "So many. It holds in 6 of 6 recordings, with 3 of 3 experts."
    assert claim.decided_by.startswith("How many. Agrees if the whole 95 % interval")
    assert "lies above 50 %, partly if all of it lies above 25 %" in claim.decided_by
    assert (claim.numbers["n"], claim.numbers["mean"], claim.numbers["held_in"]) == (6, 0.9, 6)


@pytest.mark.parametrize(
    ("value", "best", "expected"),
    [
        (0.9, "partly", "partly"),
        (0.3, "partly", "partly"),
        (0.1, "partly", "does not agree"),
        (0.9, "cannot be judged", "cannot be judged"),
        (0.1, "cannot be judged", "cannot be judged"),
    ],
)
def test_what_else_was_measured_may_leave_no_better_verdict(
    value: float, best: Verdict, expected: Verdict
) -> None:
    measured = replace(ROW.metric(value), no_better_than=best)
    (claim,) = decided((replace(ROW, metric=lambda _: measured),), value)
    assert claim.verdict == expected


def test_what_cannot_be_measured_is_left_out() -> None:
    assert decided((replace(ROW, metric=lambda _: None), ROW), 0.9) == decided((ROW,), 0.9)
