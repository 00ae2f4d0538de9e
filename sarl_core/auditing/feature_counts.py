"""In how many steps of each episode a feature is where drift is told by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.auditing.drift import Shares, by_episode
from sarl_core.auditing.overlap import comparable, never_applications
from sarl_core.mining.rule_set import RuleSet

Counts = NDArray[np.int64]

_HALF = 0.5  # of a feature that says which word a column holds


class Edges(NamedTuple):
    """What logs are compared with, of demonstrations in E episodes.

    Attributes:
        quarters: Where the quarters of each feature lie, (3, d).
        before: What `quarter_counts` has of the demonstrations, and then `rule_counts`.
    """

    quarters: NDArray[np.float64]
    before: Shares


def numbers_and_words(rule_set: RuleSet) -> tuple[list[int], list[int]]:
    """Which features of rules are numbers, and which say which word a column holds."""
    features = rule_set.source.features
    numbers = [at for at, one in enumerate(features) if one.indicator is None]
    return numbers, [at for at, one in enumerate(features) if one.indicator is not None]


def quarter_counts(
    rule_set: RuleSet,
    observations: NDArray[np.float32],
    starts: NDArray[np.int64],
    quarters: NDArray[np.float64],
) -> Counts:
    """Steps at or below the quarters of demonstrations, and those with each word.

    Args:
        rule_set: R rules over d features, of which some are numbers and some say words.
        observations: As the rules see them, (N, d).
        starts: Row at which each of E episodes starts.
        quarters: Of the demonstrations, (3, d).

    Returns:
        Shape (E, 3 * numbers + words): the numbers at or below the first quarters, and so on.
    """
    numbers, words = numbers_and_words(rule_set)
    columns = [by_episode((observations <= edge)[:, numbers], starts) for edge in quarters]
    columns.append(by_episode(observations[:, words] > _HALF, starts))
    return np.hstack(columns).astype(np.int64)


def beyond_counts(
    rule_set: RuleSet,
    observations: NDArray[np.float32],
    in_force: NDArray[np.int64],
    starts: NDArray[np.int64],
) -> tuple[Counts, Counts]:
    """Steps whose feature lies outside the middle of the data of a rule that is in force.

    Args:
        rule_set: R rules over d features.
        observations: As the rules see them, (N, d).
        in_force: Index of the rule in force or -1, (N, m).
        starts: Row at which each of E episodes starts.

    Returns:
        Such steps (E, d), and all steps of rules that keep a box, (E,); a step counts once for
        each action dimension, and of never-rules once for each that applies. Those that are not
        `comparable` are left out.
    """
    d = observations.shape[1]
    counts, ruled = np.zeros((len(starts), d)), np.zeros(len(starts))
    boxes = [rule.box for rule in rule_set]
    compared = comparable(rule_set)
    forbids = np.array([bool(rule.forbids) for rule in rule_set], dtype=np.bool_)
    has_box = np.array([box is not None for box in boxes], dtype=np.bool_) & compared
    low, high = np.zeros((2, len(boxes), d))
    for place, box in enumerate(boxes):
        if box is not None:
            low[place], high[place] = box.low, box.high
    demands_with_box = np.append(has_box & ~forbids, [False])
    for column in in_force.T:
        known = demands_with_box[column]
        ruled += by_episode(known, starts)
        rules = np.where(known, column, 0)
        for feature in range(d if len(boxes) else 0):
            values = observations[:, feature]
            out = (values < low[rules, feature]) | (values > high[rules, feature])
            counts[:, feature] += by_episode(out & known, starts)
    lengths = np.diff(np.append(starts, len(observations)))
    episode = np.repeat(np.arange(len(starts)), lengths)
    for place, rows in never_applications(rule_set, observations, in_force):
        if not has_box[place]:
            continue
        ruled += np.bincount(episode[rows], minlength=len(starts))
        for feature in range(d):
            values = observations[rows, feature]
            out = (values < low[place, feature]) | (values > high[place, feature])
            counts[:, feature] += np.bincount(episode[rows[out]], minlength=len(starts))
    return counts.astype(np.int64), ruled.astype(np.int64)
