"""The rule set at every threshold at once.

Support shrinks along a path. So node v is a rule at (s, c) exactly when s <= support(v) and
c lies above the confidence of all its ancestors and not above its own: a rectangle. Whatever is
summed over rules is, over a grid of thresholds, a sum of rectangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.errors import InputError
from sarl_core.mining.tree import PolicyTree, highest_above

Floats = NDArray[np.float64]

# The grid of the paper's Figures 2 and 3. Written as quotients, so that 0.15 is 0.15.
PAPER_SUPPORTS: Floats = np.arange(11) / 20
PAPER_CONFIDENCES: Floats = np.arange(21) / 20


class Rectangles(NamedTuple):
    """Where in the threshold plane each node of a tree is a rule; empty ones left out.

    Attributes:
        node: Node numbers, (k,).
        support: The node is a rule up to this minimum support, inclusive, (k,).
        above: ... and above this minimum confidence, exclusive (-inf at the root), (k,).
        confidence: ... up to this minimum confidence, inclusive, (k,).
    """

    node: NDArray[np.int64]
    support: Floats
    above: Floats
    confidence: Floats


@dataclass(frozen=True, eq=False)
class Landscape:
    """Sums over the rule set, for every pair of thresholds of a grid.

    All layers have the shape (supports, confidences).

    Attributes:
        supports: Minimum supports, ascending.
        confidences: Minimum confidences, ascending.
        rule_count: Number of rules, over all action dimensions, int64.
        mean_length: Mean number of queries a rule, 0 where there is no rule.
        coverage: Share of pairs to which a rule applies, averaged over action dimensions.
        fidelity: Share of the covered pairs whose label the rule gives; NaN where none is
            covered.
        dimensions: The same for each action dimension alone; () in such a part itself.
        held_out_fidelity: As `fidelity`, over pairs held out; None where none were given.
    """

    supports: Floats
    confidences: Floats
    rule_count: NDArray[np.int64]
    mean_length: Floats
    coverage: Floats
    fidelity: Floats
    dimensions: tuple[Landscape, ...] = ()
    held_out_fidelity: Floats | None = None


def rule_rectangles(
    tree: PolicyTree, *, lift_min: float = 0.0, max_depth: int | None = None
) -> Rectangles:
    """The thresholds at which each node is a rule.

    Args:
        tree: With n nodes.
        lift_min: Nodes with less lift never qualify.
        max_depth: Nodes below this depth are ignored.

    Returns:
        One rectangle for each node that is a rule anywhere.
    """
    above = confidence_above(tree, lift_min=lift_min)
    rule = (above < tree.confidence) & (tree.lift >= lift_min)
    if max_depth is not None:
        rule &= tree.depth <= max_depth
    node = np.flatnonzero(rule)
    return Rectangles(node, tree.support[node], above[node], tree.confidence[node])


def confidence_above(tree: PolicyTree, *, lift_min: float = 0.0) -> Floats:
    """Highest confidence among the ancestors of each node that qualify by their lift.

    Args:
        tree: With n nodes.
        lift_min: Ancestors with less lift do not count.

    Returns:
        Shape (n,); -inf where there is no such ancestor.
    """
    if lift_min <= 0.0:
        return tree.confidence_above
    return highest_above(tree, np.where(tree.lift >= lift_min, tree.confidence, -np.inf))


def threshold_landscape(
    trees: Sequence[PolicyTree],
    supports: ArrayLike,
    confidences: ArrayLike,
    *,
    lift_min: float = 0.0,
    max_depth: int | None = None,
    held_out: Sequence[NodeCounts] | None = None,
) -> Landscape:
    """Count, measure and test the rule sets of every cell of a threshold grid, in one pass.

    Exact: every cell equals mining at its thresholds (the paper's Figures 2 and 3).

    Args:
        trees: One an action dimension.
        supports: Minimum supports, ascending, shape (S,).
        confidences: Minimum confidences, ascending, shape (C,).
        lift_min: Minimum lift of a rule.
        max_depth: Longest rule.
        held_out: What `count_held_out` counted at the nodes of these trees; None for nothing.

    Returns:
        Layers of shape (S, C), for all dimensions and for each.

    Raises:
        InputError: If there is no tree, or a grid is empty, not ascending or not finite.
    """
    if not trees:
        raise InputError("there is no tree to draw a landscape of; grow the trees first")
    supports = _axis(supports, "supports")
    confidences = _axis(confidences, "confidences")
    counted = [None] * len(trees) if held_out is None else list(held_out)
    sums = [
        _sums(tree, supports, confidences, lift_min, max_depth, other)
        for tree, other in zip(trees, counted, strict=True)
    ]
    parts = tuple(
        _layers(supports, confidences, one, tree.source.steps)
        for one, tree in zip(sums, trees, strict=True)
    )
    if len(parts) == 1:
        return replace(parts[0], dimensions=parts)
    total = np.sum(sums, axis=0)
    steps = sum(tree.source.steps for tree in trees)
    return replace(_layers(supports, confidences, total, steps), dimensions=parts)


class NodeCounts(NamedTuple):
    """Other pairs at the nodes of a tree.

    Attributes:
        samples: Pairs that reach each node, (n,).
        correct: Those of them that carry its label, (n,).
    """

    samples: NDArray[np.int64]
    correct: NDArray[np.int64]


def _axis(values: ArrayLike, name: str) -> Floats:
    axis = np.asarray(values, dtype=np.float64)
    usable = axis.ndim == 1 and len(axis) > 0 and np.isfinite(axis).all()
    if not usable or (np.diff(axis) <= 0).any():
        raise InputError(f"the {name} of a landscape must be finite numbers in ascending order")
    return axis


def _sums(
    tree: PolicyTree,
    supports: Floats,
    confidences: Floats,
    lift_min: float,
    max_depth: int | None,
    held_out: NodeCounts | None,
) -> NDArray[np.int64]:
    """Rules, queries, pairs covered and right; these two held out, if any; (4 or 6, S, C)."""
    rectangles = rule_rectangles(tree, lift_min=lift_min, max_depth=max_depth)
    # Row s is inside while s <= support; column c while above < c <= confidence.
    rows = np.searchsorted(supports, rectangles.support, side="right")
    first = np.searchsorted(confidences, rectangles.above, side="right")
    last = np.searchsorted(confidences, rectangles.confidence, side="right")
    inside = (rows > 0) & (first < last)
    node, rows = rectangles.node[inside], rows[inside] - 1
    first, last = first[inside], last[inside]
    width = len(confidences) + 1  # one more column, for rectangles that reach the right edge
    enters, leaves = rows * width + first, rows * width + last
    each = np.ones(len(node), dtype=np.int64)
    weights = [each, tree.depth[node], tree.samples[node], tree.correct[node]]
    if held_out is not None:
        weights += [held_out.samples[node], held_out.correct[node]]
    planes = np.zeros((len(weights), len(supports), width), dtype=np.int64)
    for plane, weight in zip(planes.reshape(len(weights), -1), weights, strict=True):
        np.add.at(plane, enters, weight)
        np.subtract.at(plane, leaves, weight)
    # Along confidence from the left; along support from the largest downwards, because every
    # rectangle begins at support 0. In place: fresh memory is what would cost the time.
    np.cumsum(planes, axis=2, out=planes)
    from_top = planes[:, ::-1]
    np.cumsum(from_top, axis=1, out=from_top)
    return planes[:, :, :-1]


def _layers(
    supports: Floats, confidences: Floats, sums: NDArray[np.int64], steps: int
) -> Landscape:
    rules, length, covered, correct, *held_out = sums
    with np.errstate(invalid="ignore"):
        fidelity = correct / covered
        held_out_fidelity = held_out[1] / held_out[0] if held_out else None
    return Landscape(
        supports=supports,
        confidences=confidences,
        rule_count=rules,
        mean_length=np.divide(length, rules, out=np.zeros(rules.shape), where=rules > 0),
        coverage=covered / steps,
        fidelity=fidelity,
        held_out_fidelity=held_out_fidelity,
    )


class Changes(NamedTuple):
    """Thresholds next to a point at which the rule set changes; None where there is none.

    Attributes:
        support_below: Setting the minimum support here changes the rule set.
        support_above: Likewise.
        confidence_below: Likewise for the minimum confidence.
        confidence_above: Likewise.
    """

    support_below: float | None
    support_above: float | None
    confidence_below: float | None
    confidence_above: float | None


def next_changes(
    trees: Sequence[PolicyTree],
    *,
    supp_min: float,
    conf_min: float,
    lift_min: float = 0.0,
    max_depth: int | None = None,
) -> Changes:
    """The nearest thresholds at which anything changes.

    A rule set is the same between two edges of the rectangles. Going up, a rule is lost just
    above its edge, so the value given is the next float; going down, it comes back at the edge.

    Args:
        trees: One an action dimension.
        supp_min: Minimum support in force.
        conf_min: Minimum confidence in force.
        lift_min: Minimum lift in force.
        max_depth: Longest rule.

    Returns:
        The nearest value below and above for each threshold, within [0, 1].
    """
    below_s, above_s, below_c, above_c = [], [], [], []
    for tree in trees:
        rectangles = rule_rectangles(tree, lift_min=lift_min, max_depth=max_depth)
        # At this confidence, a rule vanishes above its support ...
        here = (rectangles.above < conf_min) & (conf_min <= rectangles.confidence)
        edges = rectangles.support[here]
        above_s += np.nextafter(edges[edges >= supp_min], np.inf).tolist()
        below_s += edges[edges < supp_min].tolist()
        # ... and at this support, above its confidence and at that of its ancestors.
        here = rectangles.support >= supp_min
        edges = np.concatenate([rectangles.confidence[here], rectangles.above[here]])
        above_c += np.nextafter(edges[edges >= conf_min], np.inf).tolist()
        below_c += edges[edges < conf_min].tolist()

    def pick(values: list[float], *, largest: bool) -> float | None:
        inside = [value for value in values if 0.0 <= value <= 1.0]
        if not inside:
            return None
        return max(inside) if largest else min(inside)

    return Changes(
        pick(below_s, largest=True),
        pick(above_s, largest=False),
        pick(below_c, largest=True),
        pick(above_c, largest=False),
    )
