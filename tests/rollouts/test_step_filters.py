from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core.rollouts.step_filters import StepFilter, used_rules
from sarl_core.rollouts.steps import StepTable


def table(seed: int, count: int = 300, dimensions: int = 2) -> StepTable:
    """Steps of four episodes, one of them empty."""
    rng = np.random.default_rng(seed)
    episode = np.sort(rng.choice([0, 1, 3, 4], size=count)).astype(np.int64)
    first = np.searchsorted(episode, episode)
    return StepTable(
        episode=episode,
        step=np.arange(count) - first,
        observation=rng.normal(size=(count, 3)).astype(np.float32),
        proposed=rng.integers(0, 2, size=(count, dimensions)),
        executed=rng.integers(0, 2, size=(count, dimensions)),
        rules=rng.integers(-1, 4, size=(count, dimensions)),
        intervened=rng.random(count) < 0.3,
        margin=rng.random(count),
        reward=rng.normal(size=count),
        outside=rng.random(count) < 0.2,
    )


def by_hand(chosen: StepFilter, steps: StepTable) -> list[int]:
    found = []
    for row in range(len(steps)):
        if chosen.intervened and not steps.intervened[row]:
            continue
        if chosen.outside and not steps.outside[row]:
            continue
        if chosen.rule is not None and chosen.rule not in steps.rules[row].tolist():
            continue
        if chosen.episode is not None and chosen.episode != steps.episode[row]:
            continue
        found.append(row)
    return found


@given(
    st.integers(0, 50),
    st.booleans(),
    st.booleans(),
    st.none() | st.integers(0, 5),
    st.none() | st.integers(0, 6),
)
def test_a_filter_lets_through_what_it_says(
    seed: int, intervened: bool, outside: bool, rule: int | None, episode: int | None
) -> None:
    steps = table(seed)
    chosen = StepFilter(intervened, outside, rule, episode)
    assert chosen.rows(steps).tolist() == by_hand(chosen, steps)


def test_used_rules_come_by_how_often_they_are_in_force() -> None:
    steps = table(1)
    counts = {rule: int((steps.rules == rule).sum()) for rule in range(4)}
    found = used_rules(steps).tolist()
    assert sorted(found) == [0, 1, 2, 3]
    assert [counts[rule] for rule in found] == sorted(counts.values(), reverse=True)


@pytest.mark.parametrize("count", [0, 1])
def test_few_steps(count: int) -> None:
    steps = table(2, count)
    assert len(StepFilter().rows(steps)) == count
    assert StepFilter(episode=9).rows(steps).tolist() == []
    assert len(used_rules(steps)) <= 2
