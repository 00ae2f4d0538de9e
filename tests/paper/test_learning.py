from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from sarl_core.paper.learning import LEARNING
from sarl_core.paper.replicates import named_rules, replicates_of
from sarl_core.paper.study import Effort
from sarl_core.paper.verdicts import Verdict
from tests.paper.frames import learning

DOWN = list(np.linspace(0.5, 0.05, 20))
A_LITTLE = list(np.linspace(0.5, 0.4, 20))
DOWN_AND_UP = [*np.linspace(0.5, 0.25, 10), *np.linspace(0.25, 0.42, 10)]


def verdicts(frame: pd.DataFrame) -> list[Verdict]:
    return [claim.verdict for claim in LEARNING.claims({"4": frame})]


def test_what_the_paper_shows_agrees_with_the_paper() -> None:
    frame = learning(DOWN, A_LITTLE)
    assert verdicts(frame) == ["agrees"] * 5
    ours = [claim.ours for claim in LEARNING.claims({"4": frame})]
    # Of all steps: rules applied at 80 % of them.
    assert "filtered from 40 % to 4.9 %" in ours[0]
    assert "unfiltered from 50 % to 40 %" in ours[0]
    assert "93.8 %" in ours[1]
    assert "100 % of the steps, in every test" in ours[3]
    assert "in 6.2 % of the cases, and the unfiltered one in 40 %" in ours[4]


@pytest.mark.parametrize(
    ("filtered", "unfiltered", "number", "expected"),
    [
        (DOWN, DOWN_AND_UP, 0, "partly"),  # violations become more again
        (DOWN, [0.5] * 20, 0, "partly"),  # they become fewer for one set only
        ([0.5] * 20, [0.5] * 20, 0, "does not agree"),
        (list(np.linspace(0.5, 0.08, 20)), A_LITTLE, 1, "partly"),
        (A_LITTLE, A_LITTLE, 1, "does not agree"),
        (DOWN, list(np.linspace(0.5, 0.08, 20)), 2, "partly"),
        (DOWN, list(np.linspace(0.5, 0.02, 20)), 2, "does not agree"),
        (A_LITTLE, DOWN, 4, "does not agree"),
    ],
)
def test_other_curves_do_not(
    filtered: list[float], unfiltered: list[float], number: int, expected: Verdict
) -> None:
    assert verdicts(learning(filtered, unfiltered))[number] == expected


def test_where_violations_were_fewest_is_said_if_they_rise_again() -> None:
    (claim, *_) = LEARNING.claims({"4": learning(DOWN, DOWN_AND_UP)})
    assert "after as little as 25 % at about 4,750 steps" in claim.ours
    (claim, *_) = LEARNING.claims({"4": learning(DOWN, A_LITTLE)})
    assert "as little as" not in claim.ours


def test_learners_far_apart_leave_a_doubt() -> None:
    apart = [(0.5 + shift, 0.4 - shift) for shift in (-0.2, 0.0, 0.2) * 2]
    frame = learning(DOWN, A_LITTLE)
    rows = frame["rules"] == "unfiltered"
    for seed, (first, last) in enumerate(apart):
        own = rows & (frame["seed"] == seed)
        values = np.linspace(first, last, 20) * frame.loc[own, "applied"]
        frame.loc[own, "broken"] = values.round().astype(np.int64).to_numpy()
    frame["kept"] = frame["applied"] - frame["broken"]
    assert verdicts(frame)[0] == "partly"
    assert "so it may be none" in LEARNING.claims({"4": frame})[0].ours


def test_rules_that_leave_states_out_are_noticed() -> None:
    frame = learning(DOWN, A_LITTLE)
    row = frame.index[(frame["rules"] == "unfiltered")][7]
    for missing, expected in ((5, "agrees"), (50, "partly"), (500, "cannot be judged")):
        frame.loc[row, "applied"] = 10_000 - missing
        assert verdicts(frame)[3] == expected
    assert "95 % of the steps or more" in LEARNING.claims({"4": frame})[3].ours
    # One learner of six leaves it open; all of them do not.
    frame.loc[frame["rules"] == "unfiltered", "applied"] = 9_500
    assert verdicts(frame)[3] == "does not agree"


def test_numbers_are_means_over_learners_with_intervals() -> None:
    numbers = LEARNING.numbers(learning(DOWN, A_LITTLE))
    assert numbers["filtered"]["rules"] == [5, 5]
    assert numbers["filtered"]["applied_first"] == pytest.approx(
        {"mean": 0.8, "low": 0.8, "high": 0.8}
    )
    first = numbers["unfiltered"]["kept_first"]
    assert first["mean"] == pytest.approx(0.5)
    # Student's interval of 0.495, 0.5, 0.505, each twice; the means of the three experts are equal.
    assert first["high"] - first["low"] == pytest.approx(
        2 * 2.5706 * 0.005 * 0.8**0.5 / 6**0.5, rel=1e-3
    )
    assert numbers["mean_return_first"]["mean"] == 20


def test_figures_have_a_line_for_kept_and_broken_of_each_set() -> None:
    kept, applied, learner = LEARNING.draw(learning(DOWN, A_LITTLE), "Cart Pole", False)
    lines = {trace.name: trace for trace in kept.figure.data if trace.name}
    assert set(lines) == {
        "kept, filtered",
        "broken, filtered",
        "kept, unfiltered",
        "broken, unfiltered",
    }
    assert lines["kept, filtered"].line.dash != lines["kept, unfiltered"].line.dash
    assert lines["kept, filtered"].line.color == lines["kept, unfiltered"].line.color
    assert np.asarray(lines["broken, filtered"].y)[[0, -1]] == pytest.approx([0.5, 0.05])
    assert list(lines["kept, filtered"].x)[:3] == [0, 500, 1000]
    assert {trace.name for trace in applied.figure.data if trace.name} == {"filtered", "unfiltered"}
    assert learner.share + applied.share == 1.0


def test_a_small_study_is_run_as_asked() -> None:
    effort = Effort(
        quick=True, recordings=2, phases=1, test_steps=150, episodes=1, snapped_episodes=1
    )
    told = []
    frame = LEARNING.measure(effort, lambda done, total: told.append((done, total)))
    assert tuple(frame.columns) == LEARNING.columns
    assert told[-1] == (4, 4)
    assert frame["learned_steps"].unique().tolist() == [0, 500]
    assert frame["test_steps"].unique().tolist() == [150]
    assert LEARNING.settings(effort)["seeds"]["learners"] == [0, 1]
    assert frame["seed"].unique().tolist() == [0, 1]
    # Each learner is watched by the rules of a recording of its own.
    assert frame.drop_duplicates("seed")["expert"].tolist() == ["cartpole", "cartpole_seed_1"]
    assert frame["rules"].tolist() == ["filtered"] * 4 + ["unfiltered"] * 4
    unfiltered = frame[frame["rules"] == "unfiltered"].drop_duplicates("seed")
    assert unfiltered["rule_count"].tolist() == [
        len(named_rules(one)["unfiltered"]) for one in replicates_of("CartPole-v1", 2)
    ]
    assert {claim.verdict for claim in LEARNING.claims({"4": frame})} == {"cannot be judged"}
    assert len(LEARNING.claims({"4": frame})) == 5
