"""Which thresholds are worth choosing: no other pair is better in every respect."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.thresholds.landscape import Landscape, rule_rectangles, threshold_landscape
from sarl_core.mining.tree import PolicyTree

# Above this many edges an axis, the front is that of evenly chosen ones.
MAX_EDGES = 600


class ParetoPoint(NamedTuple):
    """A rule set that no other one beats.

    Attributes:
        rules: Number of rules.
        coverage: Share of states with a rule.
        fidelity: Share of the covered pairs whose label the rule gives.
        support: Minimum support that gives it.
        confidence: Minimum confidence that gives it.
    """

    rules: int
    coverage: float
    fidelity: float
    support: float
    confidence: float


def pareto_front(
    trees: Sequence[PolicyTree],
    *,
    lift_min: float = 0.0,
    max_depth: int | None = None,
) -> tuple[ParetoPoint, ...]:
    """Rule sets for which no other has fewer rules, more coverage and more fidelity.

    "No other" means at least as good in all three and better in one. The edges of the
    rectangles are the only places where anything changes, so trying them all is exact as long
    as there are no more than `MAX_EDGES` on an axis.

    Args:
        trees: One an action dimension.
        lift_min: Minimum lift of a rule.
        max_depth: Longest rule.

    Returns:
        By number of rules; of several thresholds with one result, the lowest. At no lower minimum
        support than the trees were grown down to.
    """
    rectangles = [rule_rectangles(t, lift_min=lift_min, max_depth=max_depth) for t in trees]
    least = max(tree.least_support for tree in trees)
    supports = _edges([r.support[r.support >= least] for r in rectangles])
    confidences = _edges([r.confidence for r in rectangles])
    if not len(supports):
        return ()
    return _front(
        threshold_landscape(trees, supports, confidences, lift_min=lift_min, max_depth=max_depth)
    )


def _edges(values: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    edges = np.unique(np.concatenate(values))
    if len(edges) > MAX_EDGES:
        edges = edges[np.unique(np.linspace(0, len(edges) - 1, MAX_EDGES).round().astype(int))]
    return edges


def _front(landscape: Landscape) -> tuple[ParetoPoint, ...]:
    rules = landscape.rule_count.ravel()
    coverage = landscape.coverage.ravel()
    fidelity = landscape.fidelity.ravel()
    used = np.flatnonzero(rules > 0)
    # Best first, so that whoever comes later can be beaten but beats nobody before.
    order = used[np.lexsort((-fidelity[used], -coverage[used], rules[used]))]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (np.diff(rules[order]) != 0) | (np.diff(coverage[order]) != 0)
    order = order[first]
    points = []
    # The staircase of the points so far: coverage ascending, fidelity descending.
    stairs: list[tuple[float, float]] = []
    for cell, count, covered, correct in zip(
        order.tolist(),
        rules[order].tolist(),
        coverage[order].tolist(),
        fidelity[order].tolist(),
        strict=True,
    ):
        at = bisect_left(stairs, (covered, -np.inf))
        if at < len(stairs) and stairs[at][1] >= correct:
            continue
        if at < len(stairs) and stairs[at][0] == covered:
            at += 1
        start = at
        while start > 0 and stairs[start - 1][1] <= correct:
            start -= 1
        stairs[start:at] = [(covered, correct)]
        row, column = divmod(cell, len(landscape.confidences))
        points.append(
            ParetoPoint(
                count,
                covered,
                correct,
                float(landscape.supports[row]),
                float(landscape.confidences[column]),
            )
        )
    return tuple(points)
