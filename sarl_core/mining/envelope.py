"""Where the pairs of each rule lay, within its half-spaces and around its thresholds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.recoding import recoded
from sarl_core.mining.applications import Applications, applications
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule
from sarl_core.mining.tree import splits_of

LOW_QUANTILE, HIGH_QUANTILE = 0.01, 0.99

_LARGEST = float(np.finfo(np.float32).max)

Floats = NDArray[np.float64]


def with_boxes(rule_set: RuleSet, demonstrations: Demonstrations) -> RuleSet:
    """Give every rule the box of the pairs to which it applies.

    Args:
        rule_set: Its rules.
        demonstrations: What they were mined from; N pairs.

    Returns:
        The same rules with `Rule.box`; None for those to which no pair belongs.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    rule_set = rules_for(rule_set, demonstrations).rule_set
    applied = applications(rule_set, demonstrations.observations)
    boxes = _boxes(applied, demonstrations.observations, len(rule_set.rules))
    return replace(
        rule_set,
        rules=tuple(
            replace(rule, box=box) for rule, box in zip(rule_set.rules, boxes, strict=True)
        ),
    )


def with_splits(rule_set: RuleSet, demonstrations: Demonstrations) -> RuleSet:
    """Let rules that came without them know the demonstrated values around their thresholds.

    Args:
        rule_set: Its rules.
        demonstrations: What they were mined from, or others that they are shown beside.

    Returns:
        The same rules; features that know of thresholds keep what they know.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    demonstrations = recoded(demonstrations, rule_set.source.features, called="the demonstrations")
    rule_set = rules_for(rule_set, demonstrations).rule_set
    conditions = [condition for rule in rule_set.rules for condition in rule.conditions]
    splits = splits_of(
        np.array([feature for feature, _, _ in conditions], dtype=np.int64),
        np.array([threshold for _, _, threshold in conditions], dtype=np.float64),
        demonstrations.observations,
    )
    known = [feature.splits for feature in rule_set.source.features]
    return replace(
        rule_set,
        source=rule_set.source.with_splits(
            [new if old is None else old for old, new in zip(known, splits, strict=True)]
        ),
    )


def box_of(rule: Rule, observations: NDArray[np.float32]) -> DataBox | None:
    """The box of the states to which one rule applies, as `with_boxes` gives it.

    Args:
        rule: Any.
        observations: Shape (N, d), float32.

    Returns:
        None where it applies to none of them.
    """
    rows = np.flatnonzero(rule.applies(observations))
    applied = Applications(rule=np.zeros(len(rows), dtype=np.int64), row=rows)
    (box,) = _boxes(applied, observations, 1)
    return box


def _boxes(
    applied: Applications, observations: NDArray[np.float32], n_rules: int
) -> list[DataBox | None]:
    """One sort a feature; the quantiles of all rules are then picked at once.

    Applications ascend by rule, so that sorted values of a rule take the places of its states.
    """
    count = np.bincount(applied.rule, minlength=n_rules)
    there = np.flatnonzero(count)
    count = count[there]
    start = np.cumsum(count) - count
    d = observations.shape[1]
    corners: Floats = np.empty((4, len(there), d))
    groups = list(zip(start.tolist(), (start + count).tolist(), strict=True))
    for feature in range(d):
        values = observations[applied.row, feature]
        for first, end in groups:
            values[first:end].sort()
        ordered = values.astype(np.float64)
        # A formula may be infinite, which no file can say: the largest number stands for it.
        ordered = np.clip(ordered, -_LARGEST, _LARGEST)
        corners[0, :, feature] = ordered[start]
        corners[1, :, feature] = _quantile(ordered, start, count, LOW_QUANTILE)
        corners[2, :, feature] = _quantile(ordered, start, count, HIGH_QUANTILE)
        corners[3, :, feature] = ordered[start + count - 1]
    boxes: list[DataBox | None] = [None] * n_rules
    corners += 0.0  # of two zeros one
    for place, sides in zip(there.tolist(), np.moveaxis(corners, 1, 0).tolist(), strict=True):
        boxes[place] = DataBox(*sides)
    return boxes


def _quantile(
    ordered: Floats, start: NDArray[np.int64], count: NDArray[np.int64], share: float
) -> Floats:
    """Of each group of ascending values, between the two nearest, as NumPy's default."""
    place = (count - 1) * share
    below = np.floor(place).astype(np.int64)
    low = ordered[start + below]
    high = ordered[start + np.minimum(below + 1, count - 1)]
    return np.asarray(np.clip(low + (high - low) * (place - below), low, high))
