"""How claims are decided: over recordings, with margins, and not where there is too little."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from sarl_core.paper.criteria import Finding, InMost, MeanBounds, Sample, Together
from sarl_core.paper.verdicts import Verdict, over_recordings, share_over_recordings
from sarl_core.paper.words import interval, shares

EXPERTS = ("a", "b", "c", "a", "b", "c")
SPREAD = np.array([-1.0, 0.0, 1.0, 1.0, 0.0, -1.0])  # the experts' means are the same


def verdict(
    criterion: MeanBounds, values: np.ndarray, experts: tuple[str, ...] = EXPERTS
) -> Verdict:
    return criterion.finding(Sample(values, experts)).verdict


def in_most(
    holds: Sequence[bool],
    experts: tuple[str, ...],
    judged: Sequence[bool] | None = None,
    *,
    existence: bool = False,
) -> Finding:
    there = None if judged is None else np.array(judged)
    criterion = InMost(existence=existence, only_judged=judged is not None)
    return criterion.finding(Sample(np.array(holds, dtype=bool), experts, judged=there))


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (0.9 + 0.01 * SPREAD, "agrees"),
        (0.79 + 0.01 * SPREAD, "partly"),
        (0.82 + 0.1 * SPREAD, "partly"),  # more than the bound, but that is not shown
        (0.3 + 0.01 * SPREAD, "does not agree"),
        (0.52 + 0.1 * SPREAD, "does not agree"),  # not even in part, as far as is shown
        (0.65 + 0.5 * SPREAD, "cannot be judged"),
    ],
)
def test_the_whole_interval_has_to_lie_where_a_claim_puts_it(
    values: np.ndarray, expected: Verdict
) -> None:
    assert verdict(MeanBounds("above", 0.8, 0.5), values) == expected
    assert verdict(MeanBounds("below", -0.8, -0.5), -values) == expected
    found = MeanBounds("below", -0.8, -0.5).finding(Sample(-values, EXPERTS))
    assert found.interval is not None
    assert found.interval.mean == pytest.approx(-values.mean())
    assert found.interval.low < found.interval.high


def test_the_same_value_everywhere_is_not_more_than_itself() -> None:
    assert verdict(MeanBounds("above", 0, 0), np.zeros(6)) == "does not agree"
    assert verdict(MeanBounds("above", 0, -0.1), np.zeros(6)) == "partly"
    assert verdict(MeanBounds("above", 0, 0), np.full(6, 0.01)) == "agrees"


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (0.02 * SPREAD, "agrees"),
        (0.09 + 0.02 * SPREAD, "partly"),  # alike, but not shown to be
        (0.2 * SPREAD, "partly"),
        (0.6 + 0.02 * SPREAD, "does not agree"),
        (-0.6 + 0.02 * SPREAD, "does not agree"),
        (0.3 + 0.02 * SPREAD, "partly"),
        (0.5 + 0.2 * SPREAD, "does not agree"),
        (0.1 + 0.8 * SPREAD, "cannot be judged"),
    ],
)
def test_that_two_things_are_the_same_has_to_be_shown(
    values: np.ndarray, expected: Verdict
) -> None:
    assert verdict(MeanBounds("within", 0.1, 0.5), values) == expected
    assert verdict(MeanBounds("within", 0.1, 0.5), -values) == expected


def test_few_recordings_or_experts_decide_nothing() -> None:
    for count in (1, 2, 4):
        values = np.full(count, 0.9)
        assert verdict(MeanBounds("above", 0.8, 0.5), values, EXPERTS[:count]) == "cannot be judged"
        assert in_most([True] * count, EXPERTS[:count]).verdict == "cannot be judged"
    alike = ("a", "b") * 3
    found = MeanBounds("above", 0.8, 0.5).finding(Sample(np.full(6, 0.9), alike))
    assert found.verdict == "cannot be judged"
    assert "5 recordings of 3 experts are needed" in found.sentence
    assert verdict(MeanBounds("above", 0.8, 0.5), np.full(5, 0.9), EXPERTS[:5]) == "agrees"


def test_experts_that_differ_make_the_interval_wide() -> None:
    by_expert = np.array([-1.0, 0.0, 1.0, -1.0, 0.0, 1.0])
    alike = over_recordings(SPREAD, EXPERTS)
    apart = over_recordings(by_expert, EXPERTS)
    # Student's over three means of experts, and over six recordings.
    assert apart.high == pytest.approx(4.3027 * 1.0 / 3**0.5, rel=1e-3)
    assert alike.high == pytest.approx(2.5706 * (4 / 5) ** 0.5 / 6**0.5, rel=1e-3)


def test_one_expert_alone_has_no_interval() -> None:
    found = over_recordings(np.array([1.0, 3.0]), ("a", "a"))
    assert found.mean == 2
    assert np.isnan([found.low, found.high]).all()
    assert interval(found) == "2"
    share = share_over_recordings(np.ones((1, 20), dtype=np.bool_), ("a",))
    assert np.isnan(share.low)
    assert shares(share) == "100 %"
    assert verdict(MeanBounds("above", 0, 0), np.array([9.0]), ("a",)) == "cannot be judged"


@pytest.mark.parametrize("between", [0.0, 0.3, 0.7, 1.0])
def test_the_interval_covers_however_much_experts_differ(between: float) -> None:
    rng = np.random.default_rng(5)
    draws = 1500
    experts = rng.normal(size=(draws, 3)) * between**0.5
    values = np.tile(experts, (1, 2)) + rng.normal(size=(draws, 6)) * (1 - between) ** 0.5
    found = [over_recordings(one, EXPERTS) for one in values]
    covered = np.mean([one.low <= 0 <= one.high for one in found])
    assert covered >= 0.94


def test_no_failure_in_few_episodes_is_no_proof() -> None:
    few = share_over_recordings(np.zeros((6, 5), dtype=np.bool_), EXPERTS)
    many = share_over_recordings(np.zeros((6, 50), dtype=np.bool_), EXPERTS)
    assert (few.mean, few.low) == (0.0, 0.0)
    # 1 - 0.025 ** (1 / 30), and of 300.
    assert few.high == pytest.approx(0.1157, abs=1e-4)
    assert many.high == pytest.approx(0.0122, abs=1e-4)
    every = share_over_recordings(np.ones((6, 5), dtype=np.bool_), EXPERTS)
    assert every.low == pytest.approx(1 - few.high)
    assert every.high == 1.0
    # Recordings that differ count more than their episodes.
    mixed = np.zeros((6, 50), dtype=np.bool_)
    mixed[0] = True
    found = share_over_recordings(mixed, EXPERTS)
    assert (found.low, found.mean) == (0.0, pytest.approx(1 / 6))
    assert found.high > 0.5


@pytest.mark.parametrize(
    ("holds", "expected"),
    [
        ((1, 1, 1, 1, 1, 1), "agrees"),
        ((1, 1, 1, 1, 1, 0), "agrees"),
        ((1, 1, 1, 1, 0, 0), "partly"),
        ((1, 0, 1, 0, 1, 0), "partly"),
        ((1, 0, 0, 0, 0, 0), "does not agree"),
        ((0, 0, 0, 0, 0, 0), "does not agree"),
    ],
)
def test_recordings_are_counted(holds: tuple[int, ...], expected: Verdict) -> None:
    found = in_most(holds, EXPERTS)
    assert found.verdict == expected
    assert f"{sum(holds)} of 6 recordings" in found.sentence


def test_every_expert_has_to_bear_it_out() -> None:
    experts = ("a", "a", "a", "b", "b", "c")
    assert in_most([True] * 5 + [False], experts).verdict == "partly"
    assert in_most([False] + [True] * 5, experts).verdict == "agrees"


def test_one_recording_that_shows_it_does_not_refute_that_there_is_something() -> None:
    one = [False, False, True, False, False, False]
    assert in_most(one, EXPERTS, existence=True).verdict == "partly"
    assert in_most([False] * 6, EXPERTS, existence=True).verdict == "does not agree"


def test_nothing_to_judge_is_not_judged() -> None:
    holds = [True] * 6
    for there, expected in ((0, "cannot be judged"), (2, "cannot be judged"), (3, "agrees")):
        judged = [number < there for number in range(6)]
        found = in_most(holds, EXPERTS, judged=judged)
        assert found.verdict == expected
        assert len(found.held) == there
        assert not found.too_few
    assert in_most(holds, EXPERTS, judged=[False] * 6).sentence == ""


def test_several_findings_are_one() -> None:
    yes = Sample(np.ones(6, dtype=bool), EXPERTS)
    no = Sample(np.zeros(6, dtype=bool), EXPERTS)
    in_all = Together(InMost(), "")
    assert in_all.finding(yes, yes).verdict == "agrees"
    assert in_all.finding(yes, no).verdict == "partly"
    assert in_all.finding(no, no).verdict == "does not agree"
    positive = Together(MeanBounds("above", 0.1, -0.1), "")
    assert positive.finding(Sample(SPREAD - 9, EXPERTS), Sample(SPREAD, EXPERTS)).verdict == (
        "cannot be judged"
    )
    # Of the same recordings: both have to hold.
    assert sum(in_all.finding(yes, no).held) == 0
    apart = in_all.finding(yes, Sample(np.ones(6, dtype=bool), tuple("defdef")))
    assert "12 of 12 recordings, with 6 of 6 experts" in apart.sentence


def test_so_many_may_have_to_agree_before_a_claim_does_in_part() -> None:
    more, less, unclear = (Sample(SPREAD + shift, EXPERTS) for shift in (9, -9, 0))
    two = Together(MeanBounds("above", 0, 0), "", in_part_of=2)
    assert two.finding(more, more, less).verdict == "partly"
    assert two.finding(more, more, unclear).verdict == "partly"
    assert two.finding(more, less, unclear).verdict == "does not agree"
    assert two.finding(more, unclear, unclear).verdict == "cannot be judged"
    assert two.finding(less, unclear, unclear).verdict == "cannot be judged"
