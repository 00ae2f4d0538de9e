"""A state in which the rules have an answer, or one in which they have none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.shielding.shield import Shield

_AT_ONCE = 2_048
_MIXED = 8 * _AT_ONCE  # made-up states that are tried before giving up


def random_state(
    shield: Shield, observations: NDArray[np.float32], *, covered: bool, seed: int
) -> NDArray[np.float32] | None:
    """A random state with a rule for every action dimension, or without one for some.

    Demonstrated states are tried first. Where none will do, each feature is taken from a
    demonstrated state of its own: values that do occur, though not together.

    Args:
        shield: In force.
        observations: Demonstrated states, (N, d).
        covered: Whether every action dimension is to have a rule.
        seed: The same one gives the same state.

    Returns:
        Shape (d,), or None where no such state was found.
    """
    generator = np.random.default_rng(seed)
    order = generator.permutation(len(observations))
    for start in range(0, len(order), _AT_ONCE):
        state = _first(shield, observations[order[start : start + _AT_ONCE]], covered=covered)
        if state is not None:
            return state
    for _ in range(0, _MIXED, _AT_ONCE):
        rows = generator.integers(0, len(observations), (_AT_ONCE, observations.shape[1]))
        mixed = np.take_along_axis(observations, rows, axis=0)
        state = _first(shield, mixed, covered=covered)
        if state is not None:
            return state
    return None


def _first(
    shield: Shield, states: NDArray[np.float32], *, covered: bool
) -> NDArray[np.float32] | None:
    rows = np.flatnonzero((shield.rules_in_force(states) >= 0).all(axis=1) == covered)
    return states[rows[0]].copy() if len(rows) else None


class Span(NamedTuple):
    """Where the demonstrated values of one feature lie, as float32 numbers.

    Attributes:
        low: The least, lower where all are the same.
        middle: The median.
        high: The largest, higher where all are the same.
    """

    low: float
    middle: float
    high: float


def feature_spans(observations: NDArray[np.float32]) -> tuple[Span, ...]:
    """Where the demonstrated values of each feature lie.

    Args:
        observations: Shape (N, d).

    Returns:
        One entry a feature; `low` is below `high`.
    """
    low, high = observations.min(axis=0), observations.max(axis=0)
    same = low == high
    low, high = (
        np.where(same, low - np.float32(0.5), low),
        np.where(same, high + np.float32(0.5), high),
    )
    # One after the other: the median of all at once would take a second copy of them.
    middle = np.array([np.median(column) for column in observations.T], dtype=np.float32)
    return tuple(map(Span, low.tolist(), middle.tolist(), high.tolist()))


def within(state: NDArray[np.float32], spans: Sequence[Span]) -> NDArray[np.float32]:
    """The nearest state whose every value was demonstrated.

    Args:
        state: Shape (d,).
        spans: Of the d features.

    Returns:
        Shape (d,); the same where it lies within.
    """
    low, _, high = (np.array(ends, dtype=np.float32) for ends in zip(*spans, strict=True))
    return np.clip(state, low, high)
