"""The rule set at every threshold at once.

Support shrinks along a path. So node v is a rule at (s, c) exactly when s <= support(v) and
c lies above the confidence of all its ancestors and not above its own: a rectangle. Whatever is
summed over rules is, over a grid of thresholds, a sum of rectangles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.mining.evidence import EpisodeCounts, EpisodeSums
from sarl_core.mining.language import limit_text
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.grids import (
    Floats,
    Places,
    drawn_trees,
    grid_axis,
    places_of,
    rectangle_sums,
    summed,
)
from sarl_core.mining.tree import PolicyTree, highest_above
from sarl_core.notebooks import table_html

if TYPE_CHECKING:
    import pandas as pd

# The grid of the paper's Figures 2 and 3. Written as quotients, so that 0.15 is 0.15.
PAPER_SUPPORTS: Floats = np.arange(11) / 20
PAPER_CONFIDENCES: Floats = np.arange(21) / 20

LAYERS = ("rule_count", "mean_length", "coverage", "fidelity")
"""What is counted and measured of every rule set."""
_HELD_OUT_LAYERS = ("held_out_fidelity", "held_out_low", "held_out_high")
_MOST_IN_NOTEBOOK = 21  # lines of an axis, as the paper's grid has

_CELLS_AT_ONCE = 2_000_000  # of the planes of some episodes: 32 MB


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


@dataclass(frozen=True, eq=False, repr=False)
class Landscape:
    """Rule count, length, coverage and fidelity for every pair of thresholds of a grid.

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
        held_out_fidelity: The same over pairs held out, as a mean over their episodes; None where
            none were given.
        held_out_low: Lower end of its 95 % interval, NaN where too few episodes are covered.
        held_out_high: Upper end.
    """

    supports: Floats
    confidences: Floats
    rule_count: NDArray[np.int64]
    mean_length: Floats
    coverage: Floats
    fidelity: Floats
    dimensions: tuple[Landscape, ...] = ()
    held_out_fidelity: Floats | None = None
    held_out_low: Floats | None = None
    held_out_high: Floats | None = None

    def __repr__(self) -> str:
        """Its size, as `Landscape(supports=11, confidences=21, rules=0 to 312, dimensions=1)`."""
        return (
            f"Landscape(supports={len(self.supports)}, confidences={len(self.confidences)}, "
            f"rules={self.rule_count.min()} to {self.rule_count.max()}, "
            f"dimensions={len(self.dimensions)})"
        )

    def to_frame(self, *, by_dimension: bool = False) -> pd.DataFrame:
        """One row a cell, by support, then by confidence.

        Args:
            by_dimension: Whether to give the cells of each action dimension alone, one after the
                other, with a column `dimension` before the others; else those of all together.

        Returns:
            `support`, `confidence`, `rule_count`, `mean_length`, `coverage`, `fidelity`, and the
            layers of pairs held out where there are some.
        """
        import pandas as pd

        if by_dimension:
            parts = [part.to_frame() for part in self.dimensions]
            return pd.concat(parts, keys=range(len(parts)), names=["dimension", None]).reset_index(
                "dimension"
            )
        layers = {name: getattr(self, name) for name in (*LAYERS, *_HELD_OUT_LAYERS)}
        return pd.DataFrame(
            {
                "support": np.repeat(self.supports, len(self.confidences)),
                "confidence": np.tile(self.confidences, len(self.supports)),
                **{name: layer.ravel() for name, layer in layers.items() if layer is not None},
            }
        )

    def _repr_html_(self) -> str:
        """The number of rules over the grid, for a notebook; a large grid is thinned out."""
        rows, columns = (
            np.unique(np.linspace(0, len(axis) - 1, _MOST_IN_NOTEBOOK).astype(np.int64))
            for axis in (self.supports, self.confidences)
        )
        cells = self.rule_count[np.ix_(rows, columns)]
        caption = "Number of rules, by minimum support and, across, minimum confidence"
        if cells.size < self.rule_count.size:
            caption += f" ({cells.size:,} of {self.rule_count.size:,} cells)"
        lines = zip(self.supports[rows].tolist(), cells.tolist(), strict=True)
        return table_html(
            caption,
            ["", *map(limit_text, self.confidences[columns].tolist())],
            (
                [limit_text(support), *(f"{count:,}" for count in counts)]
                for support, counts in lines
            ),
        )


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
    trees: PolicyTree | Sequence[PolicyTree],
    supports: ArrayLike,
    confidences: ArrayLike,
    *,
    lift_min: float = 0.0,
    max_depth: int | None = None,
    held_out: Sequence[EpisodeCounts] | None = None,
) -> Landscape:
    """Count, measure and test the rule sets of every cell of a threshold grid, in one pass.

    Exact: every cell equals mining at its thresholds (the paper's Figures 2 and 3).

    Args:
        trees: One an action dimension, or a single one.
        supports: Minimum supports, 0 to 1, ascending, shape (S,).
        confidences: Minimum confidences, 0 to 1, ascending, shape (C,).
        lift_min: Minimum lift of a rule.
        max_depth: Longest rule.
        held_out: What `count_held_out` counted at the nodes of these trees; None for nothing.

    Returns:
        Layers of shape (S, C), for all dimensions and for each.

    Raises:
        InputError: If there is no tree, a grid is empty, not ascending or not from 0 to 1, or
            another threshold is out of range.
    """
    Thresholds(0.0, 0.0, lift_min, max_depth)
    trees = drawn_trees(trees)
    supports = grid_axis(supports, "supports")
    confidences = grid_axis(confidences, "confidences")
    places = [
        _places(tree, supports, confidences, lift_min=lift_min, max_depth=max_depth)
        for tree in trees
    ]
    shape = len(supports), len(confidences)
    sums = [_sums(tree, one, shape) for tree, one in zip(trees, places, strict=True)]
    tried: list[EpisodeSums] | list[None] = [None] * (len(trees) + 1)
    if held_out is not None:
        tried = [plane.fidelity for plane in _tried(trees, places, held_out, shape)]
    parts = tuple(
        _layers(supports, confidences, one, tree.source.steps, other)
        for one, tree, other in zip(sums, trees, tried[1:], strict=True)
    )
    if len(parts) == 1:
        return replace(parts[0], dimensions=parts)
    total = np.sum(sums, axis=0)
    steps = sum(tree.source.steps for tree in trees)
    return replace(_layers(supports, confidences, total, steps, tried[0]), dimensions=parts)


def episode_sums(
    trees: Sequence[PolicyTree],
    supports: ArrayLike,
    confidences: ArrayLike,
    held_out: Sequence[EpisodeCounts],
    *,
    lift_min: float = 0.0,
    max_depth: int | None = None,
) -> list[EpisodePlane]:
    """Add up what held-out episodes say of the rule sets of every cell of a threshold grid.

    What it is the sum of can be added to that of other trees and other episodes, as a mean cannot.

    Args:
        trees: One an action dimension.
        supports: As of `threshold_landscape`, (S,).
        confidences: Likewise, (C,).
        held_out: What `count_held_out` counted at the nodes of these trees.
        lift_min: Minimum lift of a rule.
        max_depth: Longest rule.

    Returns:
        Sums of shape (S, C), of all dimensions together, and then of each.

    Raises:
        InputError: As `threshold_landscape`.
    """
    supports, confidences = grid_axis(supports, "supports"), grid_axis(confidences, "confidences")
    places = [
        _places(tree, supports, confidences, lift_min=lift_min, max_depth=max_depth)
        for tree in trees
    ]
    return _tried(trees, places, held_out, (len(supports), len(confidences)))


class EpisodePlane(NamedTuple):
    """What is added up over episodes at every cell of a grid of S supports and C confidences.

    Attributes:
        fidelity: Of the shares of an episode's covered pairs that are right, (S, C) each.
        coverage: Sum of the shares of the episodes' pairs that are covered, (S, C); of all
            episodes, also of those without any.
    """

    fidelity: EpisodeSums
    coverage: Floats


def _places(
    tree: PolicyTree,
    supports: Floats,
    confidences: Floats,
    *,
    lift_min: float,
    max_depth: int | None,
) -> Places:
    rectangles = rule_rectangles(tree, lift_min=lift_min, max_depth=max_depth)
    # Row s is inside while s <= support; column c while above < c <= confidence.
    rows = np.searchsorted(supports, rectangles.support, side="right")
    first = np.searchsorted(confidences, rectangles.above, side="right")
    last = np.searchsorted(confidences, rectangles.confidence, side="right")
    return places_of(rectangles.node, rows, first, last, len(confidences))


def _sums(tree: PolicyTree, places: Places, shape: tuple[int, int]) -> NDArray[np.int64]:
    """Rules, queries, pairs covered and right, (4, S, C)."""
    node = places.node
    each = np.ones(len(node), dtype=np.int64)
    weights = [each, tree.depth[node], tree.samples[node], tree.correct[node]]
    return rectangle_sums(places, weights, shape)


def _tried(
    trees: Sequence[PolicyTree],
    places: Sequence[Places],
    held_out: Sequence[EpisodeCounts],
    shape: tuple[int, int],
) -> list[EpisodePlane]:
    """What other episodes say of every cell: of all dimensions together, and of each."""
    layers = [
        EpisodePlane(
            EpisodeSums(*np.zeros((2, *shape), dtype=np.int64), *np.zeros((2, *shape))),
            np.zeros(shape),
        )
        for _ in range(len(trees) + 1)
    ]
    entries = []
    for tree, one, counts in zip(trees, places, held_out, strict=True):
        place = np.full(tree.n_nodes, -1)
        place[one.node] = np.arange(len(one.node))
        cut_place = place[counts.subject]
        by_episode = np.flatnonzero(cut_place >= 0)
        by_episode = by_episode[np.argsort(counts.episode[by_episode], kind="stable")]
        entries.append((counts, by_episode, cut_place))
    lengths = held_out[0].lengths
    count = len(lengths)
    at_once = max(_CELLS_AT_ONCE // (shape[0] * (shape[1] + 1)), 1)
    for start, end in pairwise([*range(0, count, at_once), count]):
        together = np.zeros((2, end - start, *shape), dtype=np.int64)
        for number, (one, (counts, rows, cut_place)) in enumerate(
            zip(places, entries, strict=True), start=1
        ):
            first, last = np.searchsorted(counts.episode[rows], [start, end])
            planes = _planes(one, counts, rows[first:last], cut_place, start, together.shape)
            _add(layers[number], planes, lengths[start:end])
            together += planes
        _add(layers[0], together, len(trees) * lengths[start:end])
    return layers


def _planes(
    places: Places,
    counts: EpisodeCounts,
    rows: NDArray[np.int64],
    cut_place: NDArray[np.int64],
    start: int,
    shape: tuple[int, ...],
) -> NDArray[np.int64]:
    """Pairs covered and right in some episodes, (2, episodes, S, C)."""
    planes = np.zeros((*shape[:3], shape[3] + 1), dtype=np.int64)
    first = (counts.episode[rows] - start) * (shape[2] * (shape[3] + 1))
    node = cut_place[rows]
    for plane, weight in zip(
        planes.reshape(2, -1), (counts.samples[rows], counts.correct[rows]), strict=True
    ):
        np.add.at(plane, first + places.enters[node], weight)
        np.subtract.at(plane, first + places.leaves[node], weight)
    return summed(planes)


def _add(layer: EpisodePlane, planes: NDArray[np.int64], pairs: NDArray[np.int64]) -> None:
    samples, correct = planes
    shares = correct / np.maximum(samples, 1)
    layer.fidelity.episodes[...] += (samples > 0).sum(axis=0)
    layer.fidelity.samples[...] += samples.sum(axis=0)
    layer.fidelity.total[...] += shares.sum(axis=0)
    layer.fidelity.squares[...] += np.square(shares).sum(axis=0)
    layer.coverage[...] += np.tensordot(1.0 / pairs, samples, axes=1)


def _layers(
    supports: Floats,
    confidences: Floats,
    sums: NDArray[np.int64],
    steps: int,
    tried: EpisodeSums | None,
) -> Landscape:
    rules, length, covered, correct = sums
    with np.errstate(invalid="ignore"):
        fidelity = correct / covered
    low, high = (None, None) if tried is None else tried.bounds(whole_set=True)
    return Landscape(
        supports=supports,
        confidences=confidences,
        rule_count=rules,
        mean_length=np.divide(length, rules, out=np.zeros(rules.shape), where=rules > 0),
        coverage=covered / steps,
        fidelity=fidelity,
        held_out_fidelity=None if tried is None else tried.mean,
        held_out_low=low,
        held_out_high=high,
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
