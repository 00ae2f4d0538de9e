"""Near misses of whole logs: steps at which a rule that the action breaks all but applied.

The notion is that of `shielding.neighbourhood`: a rule that would apply if one feature were a
little different, measured in that feature's spread.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.distributed.survey import Keys, episode_keys
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.neighbourhood import feature_spreads

NEAR = 0.1
"""Of a feature's spread (its interquartile range): what a near miss is away at most."""

_MOST_TESTS = 400_000_000  # of a state with a rule; beyond, some of the states are looked at
SAMPLE = 100_000
"""States that say how far a feature spreads."""


def sample_keys(log: Demonstrations) -> Keys:
    """A number by chance for each step, by the numbers of its episode and of the step.

    Args:
        log: N steps.

    Returns:
        Shape (N,); a step has the same one wherever it stands.
    """
    assert log.steps is not None
    return episode_keys(episode_keys(log.episodes.astype(np.uint64)) + log.steps.astype(np.uint64))


def in_sample(keys: Keys) -> NDArray[np.bool_]:
    """Which steps say how far a feature spreads.

    Args:
        keys: Of N steps.

    Returns:
        Shape (N,): about `SAMPLE`, those with the least keys, so that those of some logs together
        are among those of each; all of fewer.
    """
    if len(keys) <= SAMPLE:
        return np.ones(len(keys), dtype=np.bool_)
    return np.asarray(keys <= np.partition(keys, SAMPLE - 1)[SAMPLE - 1])


def spreads_of(observations: NDArray[np.float32], keys: Keys) -> NDArray[np.float64]:
    """What a change of each feature is measured in.

    Args:
        observations: Shape (N, d).
        keys: Of `sample_keys`, (N,).

    Returns:
        Shape (d,), above 0.
    """
    return feature_spreads(observations[in_sample(keys)])


def looked_at(rule_set: RuleSet, steps: int) -> int:
    """Every which step is looked at, so that a long log with many rules takes seconds.

    Args:
        rule_set: R rules.
        steps: Number N of steps.

    Returns:
        1 where all are.
    """
    return -(-steps * len(rule_set) // _MOST_TESTS) or 1


def near_misses(
    rule_set: RuleSet,
    observations: NDArray[np.float32],
    labels: NDArray[np.int64],
    spreads: NDArray[np.float64],
) -> NDArray[np.int64]:
    """The rule that each step nearly broke.

    Args:
        rule_set: R rules.
        observations: Shape (N, d), in the rules' order.
        labels: Of what was done, (N, m).
        spreads: Of the features, (d,).

    Returns:
        The first rule in the set's order that one feature is at most `NEAR` spreads away from,
        and that what was done does not obey; -1 where there is none, (N,).
    """
    nearest = np.full(len(observations), -1, dtype=np.int64)
    columns = np.asfortranarray(observations)
    for place, rule in enumerate(rule_set.rules):
        if not rule.enabled or not rule.conditions:
            continue
        rows: NDArray[np.int64] | None = None
        # What lies in the rule's box, made wider by what is near; few do after a feature or two.
        for feature, low, high in rule.bounds:
            room = NEAR * spreads[feature]
            values = columns[:, feature] if rows is None else columns[rows, feature]
            inside = (values > low - room) & (values <= high + room)
            rows = np.flatnonzero(inside) if rows is None else rows[inside]
            if not len(rows):
                break
        assert rows is not None
        rows = rows[~rule.obeyed_by(labels[rows, rule.dimension]) & (nearest[rows] < 0)]
        if not len(rows):
            continue
        broken = np.zeros(len(rows), dtype=np.int64)
        for feature, low, high in rule.bounds:
            values = columns[rows, feature]
            broken += (values <= np.float64(low)) | (values > np.float64(high))
        nearest[rows[broken == 1]] = place
    return nearest
