"""Successive halving: most episodes go to the good ones, and luck is shared."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core.improving.successive_halving import planned_episodes, successive_halving


def noisy(means, spread=1.0):
    """Candidates whose episode of a seed is always the same."""

    def score(candidates, first, count):
        assert count > 0
        return [
            means[candidate]
            + spread
            * np.array(
                [
                    np.random.default_rng([candidate, seed]).normal()
                    for seed in range(first, first + count)
                ]
            )
            for candidate in candidates
        ]

    return score


def test_the_best_of_many_is_found_although_single_episodes_deceive():
    means = np.linspace(0.0, 2.0, 20)
    found = successive_halving(20, noisy(means, 2.0), seed=0, first=16, most=512)
    assert found.best in (18, 19)
    assert found.episodes[found.best] == 512
    assert found.episodes.min() == 16
    assert found.means[found.best] == pytest.approx(means[found.best], abs=0.3)


@settings(max_examples=50)
@given(st.integers(1, 30), st.integers(1, 20), st.integers(1, 90))
def test_the_plan_is_what_is_run(candidates, first, most):
    calls = []

    def score(left, seed, count):
        calls.append(len(left) * count)
        return [np.full(count, float(candidate)) for candidate in left]

    found = successive_halving(candidates, score, seed=5, first=first, most=most)
    assert sum(calls) == planned_episodes(candidates, first, most)
    assert found.best == candidates - 1
    assert found.episodes[found.best] == most
    assert int(found.episodes.sum()) == sum(calls)


def test_all_are_given_the_same_seeds_and_none_twice():
    seen: dict[int, list[int]] = {}

    def score(candidates, first, count):
        for candidate in candidates:
            seen.setdefault(candidate, []).extend(range(first, first + count))
        return [np.zeros(count) for _ in candidates]

    successive_halving(5, score, seed=100, first=4, most=32)
    for seeds in seen.values():
        assert seeds == list(range(100, 100 + len(seeds)))


def test_who_stayed_longer_stands_before_who_left():
    found = successive_halving(7, noisy([3.0, 9, 1, 7, 0, 5, 2], 0.0), seed=0, first=2, most=8)
    assert found.ranking == (1, 3, 5, 0, 6, 2, 4)
    assert found.episodes[list(found.ranking)].tolist() == [8, 8, 4, 4, 2, 2, 2]


def test_failures_come_first_and_the_return_second():
    """Of those that fail least often the one with the highest return, whatever others bring."""
    failing, returns = [0.5, 0.0, 0.0, 0.1], [900.0, 1.0, 2.0, 50.0]

    def score(candidates, first, count):
        return [
            np.column_stack(
                [
                    -(np.arange(first, first + count) % 10 < 10 * failing[one]).astype(float),
                    np.full(count, returns[one]),
                ]
            )
            for one in candidates
        ]

    found = successive_halving(4, score, seed=0, first=10, most=40)
    assert found.best == 2
    assert found.means.tolist() == returns


def test_who_left_early_lies_behind_who_stayed() -> None:
    found = successive_halving(4, noisy([1.0, 9, 3, 8], 0.0), seed=0, first=2, most=4)
    assert found.episodes.tolist() == [2, 4, 2, 4]
    one, best, two, second = found.places()
    assert one < two < second < best
    one_stage = successive_halving(3, noisy([5.0, 6.5, 5.0], 0.0), seed=0, first=4, most=4)
    assert one_stage.places().tolist() == [1.5, 3.0, 1.5]


def test_who_did_as_well_as_one_that_stayed_does_not_lie_behind() -> None:
    """Luck is that of the episodes, so that who acts alike achieves the same in each."""
    luck = np.random.default_rng(3).normal(0, 50, 100)

    def score(means):
        return lambda left, first, count: [means[one] + luck[first : first + count] for one in left]

    alike = successive_halving(20, score(np.zeros(20)), seed=0, first=6, most=16)
    assert np.ptp(alike.means) > 1
    assert np.ptp(alike.places()) == 0
    one_worse = successive_halving(20, score(np.r_[np.zeros(19), -1]), seed=0, first=6, most=16)
    assert len(np.unique(one_worse.places())) == 2
    assert one_worse.places().argmin() == 19
    better = successive_halving(8, score(np.r_[np.zeros(6), 1.0, 2.0]), seed=0, first=2, most=8)
    *many, second, best = better.places()
    assert max(many) < second < best
