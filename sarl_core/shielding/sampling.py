"""A state in which the rules have an answer, or one in which they have none."""

from __future__ import annotations

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
        found = _first(shield, observations[order[start : start + _AT_ONCE]], covered=covered)
        if found is not None:
            return found
    for _ in range(0, _MIXED, _AT_ONCE):
        rows = generator.integers(0, len(observations), (_AT_ONCE, observations.shape[1]))
        mixed = np.take_along_axis(observations, rows, axis=0)
        found = _first(shield, mixed, covered=covered)
        if found is not None:
            return found
    return None


def _first(
    shield: Shield, states: NDArray[np.float32], *, covered: bool
) -> NDArray[np.float32] | None:
    any_action = np.zeros((len(states), len(shield.rule_set.actions)), dtype=np.float32)
    rules = shield.decide_batch(states, any_action).rules
    found = np.flatnonzero((rules >= 0).all(axis=1) == covered)
    return states[found[0]].copy() if len(found) else None
