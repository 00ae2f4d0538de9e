"""Thresholds with as few digits as the data allow, and conditions with one interval a feature.

A threshold is a number halfway between two demonstrated values: any other number between them
decides every demonstrated state in the same way. Of those, the one with the fewest digits is the
one to read, to write down, and to carry into other code.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.decimals import short_decimal
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Bounds, Condition, Operator, Rule, share_bounds

ONE_SIDED = "no demonstrated state tells its two sides apart"
SHORTEST = "no shorter number decides every state as it does"
EMPTIED = "shorter, its rule would apply to no number at all"
_LARGEST = float(np.finfo(np.float32).max)
_OPERATORS: tuple[Operator, Operator] = ("<=", ">")


class UnroundedThreshold(NamedTuple):
    """A threshold that stayed as it was.

    Attributes:
        dimension: Action dimension of the rules that ask it.
        feature: Index into the observation vector.
        threshold: At full precision.
        rules: Ids of the rules that ask it.
        why: As the rest of a sentence: `ONE_SIDED`, `SHORTEST` or `EMPTIED`.
    """

    dimension: int
    feature: int
    threshold: float
    rules: tuple[str, ...]
    why: str


@dataclass(frozen=True)
class Rounding:
    """A rule set with shorter thresholds.

    Attributes:
        rule_set: The rules; all but their thresholds is what it was.
        rounded: How many thresholds have become shorter. One that several rules share, because
            they share the beginning of their paths, counts once.
        unrounded: Those that stayed as they were.
    """

    rule_set: RuleSet
    rounded: int
    unrounded: tuple[UnroundedThreshold, ...]


class _Query(NamedTuple):
    """One query, which all rules ask whose paths begin alike."""

    depth: int
    feature: int
    threshold: float
    places: tuple[int, ...]
    rows: NDArray[np.int64]


def rounded_rules(rule_set: RuleSet, demonstrations: Demonstrations) -> Rounding:
    """Give every threshold the fewest digits that change no decision on the data.

    Queries are taken from the root downwards. Each keeps the demonstrated states that reach it on
    the side they are on, so none changes its path, whichever rules are in force and in whatever
    order. Rules with a common beginning keep it in common: those of one tree stay one tree. A rule
    that would come to apply to no float32 keeps its thresholds, for whoever shares them too.

    Args:
        rule_set: To round.
        demonstrations: N states that shall be decided as before.

    Returns:
        The rules, and which thresholds could not be made shorter.

    Raises:
        InputError: If the demonstrations have another number of features than the rules.
    """
    rule_set = rules_for(rule_set, demonstrations).rule_set
    columns = demonstrations.observations.T
    able = _can_apply(rule_set.rules)
    whole: frozenset[int] = frozenset()
    while True:
        rounding = _rounding(rule_set, columns, whole)
        still = _can_apply(rounding.rule_set.rules)
        emptied = {place for place, can in enumerate(able) if can and not still[place]}
        if not emptied:
            return rounding
        whole |= emptied


def _rounding(rule_set: RuleSet, columns: NDArray[np.float32], whole: frozenset[int]) -> Rounding:
    """Round every threshold that none of the rules asks which are to stay whole."""
    paths = [list(rule.conditions) for rule in rule_set.rules]
    rounded = 0
    unrounded: list[UnroundedThreshold] = []
    for dimension in range(len(rule_set.actions)):
        places = [i for i, rule in enumerate(rule_set.rules) if rule.dimension == dimension]
        waiting = [(0, places, np.arange(columns.shape[1]))]
        while waiting:
            depth, group, rows = waiting.pop()
            for query in _queries(rule_set.rules, group, depth, rows):
                threshold, why = _shortened(columns[query.feature][rows], query.threshold)
                if threshold != query.threshold and not whole.isdisjoint(query.places):
                    threshold, why = query.threshold, EMPTIED
                # One of each for all who ask it: what they share is then seen to be the same.
                below, above = (Condition(query.feature, op, threshold) for op in _OPERATORS)
                for place in query.places:
                    path = paths[place]
                    path[depth] = below if path[depth].op == "<=" else above
                if why:
                    ids = tuple(rule_set.rules[place].id for place in query.places)
                    unrounded.append(
                        UnroundedThreshold(dimension, query.feature, query.threshold, ids, why)
                    )
                rounded += threshold != query.threshold
                waiting += _sides(rule_set.rules, query, columns)
    rules = tuple(
        replace(rule, conditions=tuple(path))
        for rule, path in zip(rule_set.rules, paths, strict=True)
    )
    return Rounding(replace(rule_set, rules=rules), rounded, tuple(unrounded))


def _can_apply(rules: Sequence[Rule]) -> list[bool]:
    """Whether there is a float32 for each of a rule's bounds; states are, thresholds are not."""
    share_bounds(rules)
    has_number = cache(_has_number)  # many rules ask for the same
    return [all(map(has_number, rule.bounds)) for rule in rules]


def _has_number(bounds: Bounds) -> bool:
    top = np.float32(min(max(bounds.high, -_LARGEST), _LARGEST))
    if float(top) > bounds.high:
        top = np.nextafter(top, np.float32(-np.inf))
    return bool(bounds.low < float(top) <= bounds.high)


def merged_rules(rule_set: RuleSet) -> RuleSet:
    """Make several conditions on one feature one interval; no decision changes.

    Args:
        rule_set: Any number of rules.

    Returns:
        The rules with at most two conditions a feature, in the order of `Rule.bounds`. They apply
        where they did, but are no longer the paths of one tree.
    """
    share_bounds(rule_set.rules)
    return replace(rule_set, rules=tuple(map(_merged, rule_set.rules)))


def digits_of(threshold: float) -> int:
    """Number of significant digits of a threshold.

    Args:
        threshold: A finite number.

    Returns:
        Of its shortest form; 0 for zero.
    """
    return len("".join(map(str, Decimal(repr(threshold)).as_tuple().digits)).strip("0"))


def _queries(
    rules: Sequence[Rule], group: list[int], depth: int, rows: NDArray[np.int64]
) -> list[_Query]:
    """What rules with the same beginning ask next; of rules of one tree, one query."""
    by_query: dict[tuple[int, float], list[int]] = {}
    for place in group:
        if rules[place].length > depth:
            condition = rules[place].conditions[depth]
            by_query.setdefault((condition.feature, condition.threshold), []).append(place)
    return [
        _Query(depth, feature, threshold, tuple(places), rows)
        for (feature, threshold), places in by_query.items()
    ]


def _sides(
    rules: Sequence[Rule], query: _Query, columns: NDArray[np.float32]
) -> list[tuple[int, list[int], NDArray[np.int64]]]:
    """The rules and the states on either side of a query."""
    below = columns[query.feature][query.rows] <= np.float64(query.threshold)
    sides: dict[str, list[int]] = {"<=": [], ">": []}
    for place in query.places:
        sides[rules[place].conditions[query.depth].op].append(place)
    return [
        (query.depth + 1, sides["<="], query.rows[below]),
        (query.depth + 1, sides[">"], query.rows[~below]),
    ]


def _shortened(values: NDArray[np.float32], threshold: float) -> tuple[float, str]:
    """The shortest threshold that divides values as before, and why it stayed if it did."""
    below = values <= np.float64(threshold)
    if below.all() or not below.any():
        return threshold, ONE_SIDED
    least, most = float(values[below].max()), float(values[~below].min())
    if least <= 0.0 < most:
        return 0.0, SHORTEST if threshold == 0.0 else ""
    shorter = short_decimal(threshold, least, most)
    if shorter is None or digits_of(shorter) >= digits_of(threshold):
        return threshold, SHORTEST
    return shorter, ""


def _merged(rule: Rule) -> Rule:
    conditions: list[Condition] = []
    for bounds in rule.bounds:
        if not math.isinf(bounds.low):
            conditions.append(Condition(bounds.feature, ">", bounds.low))
        if not math.isinf(bounds.high):
            conditions.append(Condition(bounds.feature, "<=", bounds.high))
    return replace(rule, conditions=tuple(conditions))
