from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core.explaining.comparison_text import clear_change, verdict, verdict_on_all
from sarl_core.rollouts.episodes import Episodes, rollout


@pytest.fixture(scope="module")
def alone() -> Episodes:
    return rollout("CartPole-v1", "novice", episodes=8, keep_steps=False)


def with_returns(episodes: Episodes, returns: list[float], failures: int) -> Episodes:
    terminated = np.arange(len(episodes)) < failures
    return replace(episodes, returns=np.array(returns), terminated=terminated)


def test_a_rise_a_fall_and_neither(alone: Episodes) -> None:
    alone = with_returns(alone, [20.0, 21.0, 22.0, 23.0, 20.0, 21.0, 22.0, 23.0], 8)
    better = with_returns(alone, [500.0] * 8, 0)
    like = with_returns(alone, [18.0, 21.0, 22.0, 26.0, 20.0, 21.0, 22.0, 23.0], 8)
    assert clear_change(alone, better) == 1
    assert clear_change(better, alone) == -1
    assert clear_change(alone, like) == 0
    assert verdict("novice", "the filtered rules", alone, better) == (
        "With the filtered rules the typical return of the novice rises from 22 to 500, and 0 % "
        "instead of 100 % of its episodes end in a crash."
    )
    assert "falls from 500 to 22" in verdict("expert", "the rules", better, alone)
    assert verdict("novice", "the rules", alone, like).endswith(
        "does not clearly change (22, without them 22), and 100 % of its episodes end in a crash, "
        "as without."
    )


def test_where_nothing_crashes_nothing_is_said_of_it(alone: Episodes) -> None:
    safe = with_returns(alone, [500.0] * 8, 0)
    assert "crash" not in verdict("expert", "the rules", safe, safe)


def test_every_shield_is_told_the_best_one_first(alone: Episodes) -> None:
    alone = with_returns(alone, [20.0, 21.0, 22.0, 23.0, 20.0, 21.0, 22.0, 23.0], 8)
    shielded = [
        ("the coarse rules", with_returns(alone, [9.0] * 8, 8)),
        ("the filtered rules", with_returns(alone, [305.0] * 8, 6)),
        ("the unfiltered rules", with_returns(alone, [500.0] * 8, 0)),
        ("the compact rules", with_returns(alone, [18.0, 21.0, 22.0, 26.0] * 2, 8)),
    ]
    assert verdict_on_all("novice", alone, shielded) == (
        "With the unfiltered rules the typical return of the novice rises from 22 to 500, and 0 % "
        "instead of 100 % of its episodes end in a crash; with the filtered rules it rises to 305 "
        "(75 % of its episodes crash); with the compact rules it does not clearly change (22; "
        "100 % of its episodes crash); "
        "with the coarse rules it falls to 9 (100 % of its episodes crash)."
    )
    safe = with_returns(alone, [500.0] * 8, 0)
    told = verdict_on_all("expert", safe, [("the rules", safe), ("the filtered rules", safe)])
    assert "crash" not in told
    assert told.endswith("with the filtered rules it does not clearly change (500).")
