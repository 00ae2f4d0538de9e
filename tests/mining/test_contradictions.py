"""Contradictions against a look at every pair of states."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError
from sarl_core.mining.validation.contradictions import (
    by_episode,
    find_contradictions,
    identical_contradictions,
)


@st.composite
def crowded(draw):
    """States on a coarse grid, with some noise, so that some are equal and many are near."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, d = draw(st.integers(2, 70)), draw(st.integers(1, 3))
    states = rng.integers(0, 3, (n, d)) + draw(st.sampled_from([0, 0.02])) * rng.normal(size=(n, d))
    if draw(st.booleans()):
        states[:, 0] = -0.0 * rng.integers(0, 2, n)  # no spread, and zero with either sign
    episodes = np.sort(rng.integers(0, draw(st.integers(1, 6)), n))
    return Demonstrations(states, rng.integers(0, 2, (n, 2)), episodes)


@settings(max_examples=150)
@given(crowded(), st.sampled_from([0.0, 0.1, 1.0]))
def test_every_pair_of_states_was_looked_at(demonstrations, reach):
    found = find_contradictions(demonstrations, reach=reach)
    states = demonstrations.observations.astype(np.float64)
    spread = states.std(axis=0)
    scaled = states / np.where(spread > 0, spread, 1)
    apart = np.abs(scaled[:, None] - scaled[None]).max(axis=2)
    actions, episodes = demonstrations.action_columns, demonstrations.episodes
    for row in range(len(states)):
        alike = (demonstrations.observations == demonstrations.observations[row]).all(axis=1)
        assert (found.identical[row] == (actions[alike] != actions[row]).any(axis=0)).all()
        elsewhere = episodes != episodes[row]
        least = apart[row][elsewhere].min(initial=np.inf)
        other = found.neighbour[row]
        if least > reach:
            assert other == -1
            assert not found.near[row].any()
            assert found.distance[row] == np.inf
        else:
            assert episodes[other] != episodes[row]
            assert found.distance[row] == apart[row, other] == least
            assert (found.near[row] == (actions[other] != actions[row])).all()
    assert np.array_equal(found.identical, identical_contradictions(demonstrations))


def test_an_episode_that_does_the_opposite_stands_out():
    rng = np.random.default_rng(0)
    episodes = np.repeat(np.arange(8), 60)
    states = rng.uniform(-1, 1, (len(episodes), 1))
    says = (states[:, 0] > 0).astype(int)
    actions = np.where(episodes == 5, 1 - says, says)
    shown = Demonstrations(states, actions, episodes)
    counted = by_episode(shown, find_contradictions(shown))
    assert counted[0].episode == 5
    assert counted[0].share > 0.9
    assert counted[1].share < 0.5
    assert sum(one.steps for one in counted) == len(shown)


def test_counts_an_episode_are_sums_of_the_flags():
    rng = np.random.default_rng(1)
    shown = Demonstrations(
        rng.integers(0, 3, (40, 2)), rng.integers(0, 2, (40, 2)), np.repeat([3, 7, 9, 11], 10)
    )
    found = find_contradictions(shown)
    for dimension in (None, 0, 1):
        for one in by_episode(shown, found, dimension):
            rows = shown.episodes == one.episode
            assert one.contradicting == found.contradicting(dimension)[rows].sum()
    assert [one.share for one in by_episode(shown, found)] == sorted(
        (one.share for one in by_episode(shown, found)), reverse=True
    )


def test_one_episode_contradicts_only_itself():
    alone = Demonstrations(np.array([[1.0], [1.0], [2.0]]), np.array([0, 1, 1]), np.zeros(3, int))
    found = find_contradictions(alone)
    assert found.identical[:, 0].tolist() == [True, True, False]
    assert not found.near.any()


def test_continuous_actions_disagree_by_their_intervals():
    states = np.array([[0.0], [0.0], [5.0], [5.0]])
    actions = np.array([[-0.5], [-0.35], [-0.3], [0.3]])
    shown = Demonstrations(
        states, actions, np.array([0, 1, 2, 3]), action_low=(-1.0,), action_high=(1.0,)
    )
    assert identical_contradictions(shown)[:, 0].tolist() == [False, False, True, True]
    assert identical_contradictions(shown, divider=20).all()


@pytest.mark.parametrize("reach", [-0.1, float("nan"), float("inf")])
def test_a_distance_that_is_none_is_refused(lander_like, reach):
    with pytest.raises(InputError, match="give 0 or more standard deviations"):
        find_contradictions(lander_like, reach=reach)


def test_looking_for_equal_states_takes_little_more_than_the_states():
    rng = np.random.default_rng(0)
    states = rng.integers(-1, 2, size=(100_000, 20)).astype(np.float32)
    states[:, 7] = np.arange(100_000)
    demonstrations = Demonstrations(
        np.tile(states, (2, 1)), rng.integers(0, 2, 200_000), np.zeros(200_000, dtype=int)
    )
    tracemalloc.start()
    try:
        found = identical_contradictions(demonstrations)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    actions = np.asarray(demonstrations.actions)
    assert np.array_equal(found[:, 0], np.tile(actions[:100_000] != actions[100_000:], 2))
    assert peak < 2 * np.asarray(demonstrations.observations).nbytes
