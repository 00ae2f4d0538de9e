from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core.explaining.words.comparison import verdict, verdict_on_all
from sarl_core.rollouts.episodes import Episodes, rollout


@pytest.fixture(scope="module")
def alone() -> Episodes:
    return rollout("CartPole-v1", "novice", episodes=8, keep_steps=False)


def with_returns(episodes: Episodes, returns: list[float], failures: int) -> Episodes:
    terminated = np.arange(len(episodes)) < failures
    return replace(episodes, returns=np.array(returns), terminated=terminated)


NOVICE = [20.0, 21.0, 22.0, 23.0, 20.0, 21.0, 22.0, 23.0]
LIKE = [18.0, 21.0, 22.0, 26.0, 20.0, 21.0, 22.0, 23.0]


def test_a_rise_a_fall_and_neither(alone: Episodes) -> None:
    alone = with_returns(alone, NOVICE, 8)
    better, like = with_returns(alone, [500.0] * 8, 0), with_returns(alone, LIKE, 8)
    assert verdict("novice", "the filtered rules", alone, better) == (
        "With the filtered rules the typical return of the novice rises from 21.5 to 500 (its "
        "mean from 21.5 to 500, a difference of 478, 95 % interval 477 to 480), and 0 % instead of "
        "100 % of its episodes fail."
    )
    fall = verdict("expert", "the rules", better, alone)
    assert "falls from 500 to 21.5" in fall
    assert fall.endswith("these rules harm it.")
    assert verdict("novice", "the rules", alone, like).endswith(
        "does not clearly change (21.5, without them 21.5; its mean from 21.5 to 21.6, a "
        "difference of 0.12, 95 % interval −1.00 to 1.50), and 100 % of its episodes fail, "
        "as without."
    )


def test_harm_among_the_worst_episodes_is_told_as_harm() -> None:
    """Most episodes are as before, and a quarter of them crash: the middle half says little."""
    rng = np.random.default_rng(7)
    safe = rollout("CartPole-v1", "novice", episodes=20, keep_steps=False)
    before = with_returns(safe, (250 + rng.normal(0, 15, 20)).tolist(), 0)
    after = before.returns - 10.0
    after[[1, 4, 9, 13, 17]] -= 400.0
    worse = replace(before, returns=after, terminated=np.isin(np.arange(20), [1, 4, 9, 13, 17]))
    told = verdict("expert", "the unfiltered rules", before, worse)
    assert "falls" in told
    assert "25 % instead of 0 % of its episodes fail" in told
    assert told.endswith("these rules harm it.")


def test_more_crashes_alone_are_harm() -> None:
    safe = rollout("CartPole-v1", "novice", episodes=20, keep_steps=False)
    before = with_returns(safe, [100.0, 300.0] * 10, 0)
    worse = with_returns(safe, [101.0, 299.0] * 10, 9)
    told = verdict("expert", "the rules", before, worse)
    assert "does not clearly change" in told
    assert told.endswith("45 % instead of 0 % of its episodes fail: these rules harm it.")


def test_a_typical_return_that_hides_the_change_is_not_the_last_word() -> None:
    safe = rollout("CartPole-v1", "novice", episodes=40, keep_steps=False)
    before = with_returns(safe, [500.0] * 40, 0)
    worse = with_returns(safe, [100.0] * 9 + [500.0] * 31, 9)
    told = verdict("expert", "the rules", before, worse)
    assert "its mean falls (its mean from 500 to 410" in told
    assert told.endswith("these rules harm it.")


def test_few_episodes_are_told_with_a_caution(alone: Episodes) -> None:
    few = with_returns(alone, NOVICE, 8).part(0, 4)
    better = with_returns(few, [500.0] * 4, 0)
    assert "rises from 21.5 to 500" in verdict("novice", "the rules", few, better)
    assert "4 episodes are too few to rule out chance" in verdict("novice", "it", few, better)
    assert "harm" not in verdict("novice", "the rules", better, few)


def test_where_nothing_crashes_nothing_is_said_of_it(alone: Episodes) -> None:
    safe = with_returns(alone, [500.0] * 8, 0)
    assert "fail" not in verdict("expert", "the rules", safe, safe)


def test_every_shield_is_told_the_best_one_first(alone: Episodes) -> None:
    alone = with_returns(alone, NOVICE, 8)
    shielded = [
        ("the coarse rules", with_returns(alone, [9.0] * 8, 8)),
        ("the filtered rules", with_returns(alone, [305.0] * 8, 6)),
        ("the unfiltered rules", with_returns(alone, [500.0] * 8, 0)),
        ("the compact rules", with_returns(alone, [18.0, 21.0, 22.0, 26.0] * 2, 8)),
    ]
    told = verdict_on_all("novice", alone, shielded)
    parts = told.split("; with ")
    assert [part.split(" rules")[0] for part in parts] == [
        "With the unfiltered",
        "the filtered",
        "the compact",
        "the coarse",
    ]
    assert "rises to 305" in parts[1]
    assert "75 % of its episodes fail" in parts[1]
    assert "does not clearly change (21.5" in parts[2]
    assert "falls to 9" in parts[3]
    assert "these rules harm it" in parts[3]
    assert "harm" not in " ".join(parts[:3])
    safe = with_returns(alone, [500.0] * 8, 0)
    same = verdict_on_all("expert", safe, [("the rules", safe), ("the filtered rules", safe)])
    assert "fail" not in same
    assert same.endswith("every episode has the same return with them and without).")
