"""The never-rules at every support and epsilon at once.

Node v forbids label a at (s, e) exactly when s <= support(v) and e lies at or above the upper bound
of the label's share there, and below that of all ancestors: a rectangle. Rules overlap, so what
they cover and leave is counted by how many labels are forbidden: k or more are, in the pairs of v
and of no node above, exactly when s <= support(v) and e lies at or above the k-th smallest of the
labels' least bounds on the path down to v, and below that of the path down to its parent: a
rectangle again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.mining.never.never_rules import never_thresholds, upper_bound
from sarl_core.mining.thresholds.grids import (
    Floats,
    Places,
    drawn_trees,
    grid_axis,
    places_of,
    rectangle_sums,
)
from sarl_core.mining.tree import PolicyTree, highest_above

if TYPE_CHECKING:
    import pandas as pd

NEVER_LAYERS = ("rule_count", "mean_length", "coverage", "fidelity", "freedom")
"""What is counted and measured of every set of never-rules."""


@dataclass(frozen=True, eq=False, repr=False)
class NeverLandscape:
    """What never-rules come to for every pair of a support and an epsilon of a grid.

    All layers have the shape (supports, epsilons). They are of the demonstrated pairs.

    Attributes:
        supports: Minimum supports, ascending.
        epsilons: Most that the upper bound of a forbidden label's share may be, ascending.
        rule_count: Number of rules, over all action dimensions, int64.
        mean_length: Mean number of queries a rule, 0 where there is no rule.
        coverage: Share of pairs to which a rule applies, averaged over action dimensions.
        fidelity: Share of the covered pairs whose label is not forbidden; NaN where none is
            covered.
        freedom: Mean over the pairs of log(labels still allowed) / log(labels), of which one at
            least counts as allowed, averaged over action dimensions.
        dimensions: The same for each action dimension alone; () in such a part itself.
    """

    supports: Floats
    epsilons: Floats
    rule_count: NDArray[np.int64]
    mean_length: Floats
    coverage: Floats
    fidelity: Floats
    freedom: Floats
    dimensions: tuple[NeverLandscape, ...] = ()

    def __repr__(self) -> str:
        """Its size, as `NeverLandscape(supports=11, epsilons=21, rules=0 to 312, dimensions=1)`."""
        return (
            f"NeverLandscape(supports={len(self.supports)}, epsilons={len(self.epsilons)}, "
            f"rules={self.rule_count.min()} to {self.rule_count.max()}, "
            f"dimensions={len(self.dimensions)})"
        )

    def to_frame(self) -> pd.DataFrame:
        """One row a cell, by support, then by epsilon.

        Returns:
            `support`, `epsilon`, `rule_count`, `mean_length`, `coverage`, `fidelity`, `freedom`.
        """
        import pandas as pd

        return pd.DataFrame(
            {
                "support": np.repeat(self.supports, len(self.epsilons)),
                "epsilon": np.tile(self.epsilons, len(self.supports)),
                **{name: getattr(self, name).ravel() for name in NEVER_LAYERS},
            }
        )


def never_landscape(
    trees: PolicyTree | Sequence[PolicyTree],
    supports: ArrayLike,
    epsilons: ArrayLike,
    *,
    max_depth: int | None = None,
) -> NeverLandscape:
    """Count and measure the never-rules of every cell of a grid, in one pass.

    Exact: every cell equals mining at its support and epsilon.

    Args:
        trees: One an action dimension, or a single one.
        supports: Minimum supports, 0 to 1, ascending, shape (S,).
        epsilons: As of `mine_never_rules`, above 0 and below 1, ascending, shape (E,).
        max_depth: Longest rule.

    Returns:
        Layers of shape (S, E), for all dimensions and for each.

    Raises:
        InputError: If there is no tree, a grid is empty, not ascending or out of its range, or
            the maximum depth is none.
    """
    trees = drawn_trees(trees)
    supports, epsilons = grid_axis(supports, "supports"), grid_axis(epsilons, "epsilons")
    for end in (epsilons[0], epsilons[-1]):
        never_thresholds(float(end), 0.0, max_depth)
    sums = [_sums(tree, supports, epsilons, max_depth) for tree in trees]
    steps = trees[0].source.steps
    parts = tuple(_layers(supports, epsilons, [one], steps) for one in sums)
    return replace(_layers(supports, epsilons, sums, steps), dimensions=parts)


class _Sums(NamedTuple):
    """Of one action dimension, (S, E) each.

    Attributes:
        rules: Number of rules.
        length: Of queries in them.
        broken: Of pairs whose label is forbidden.
        covered: Of pairs to which a rule applies.
        freedom: Sum over the pairs.
    """

    rules: NDArray[np.int64]
    length: NDArray[np.int64]
    broken: NDArray[np.int64]
    covered: NDArray[np.int64]
    freedom: Floats


def _sums(tree: PolicyTree, supports: Floats, epsilons: Floats, max_depth: int | None) -> _Sums:
    bound = upper_bound(tree.counts, tree.samples[:, None])
    if max_depth is not None:
        bound[tree.depth > max_depth] = np.inf
    above = np.stack([-highest_above(tree, -column) for column in bound.T], axis=1)
    # The least bounds on the paths, in order: the k-th says whether k labels are forbidden.
    order, order_above = np.sort(np.minimum(above, bound)), np.sort(above)
    rows = np.searchsorted(supports, tree.support, side="right")
    shape = len(supports), len(epsilons)

    def places(least: Floats, below: Floats) -> Places:
        first, last = (np.searchsorted(epsilons, edge, side="left") for edge in (least, below))
        return places_of(np.arange(tree.n_nodes), rows, first, last, shape[1])

    count = tree.dimension.n_labels
    choices = _choices(count)
    of_rules = np.zeros((3, *shape), dtype=np.int64)
    reached, freedom = [np.full(shape, tree.samples[0])], np.zeros(shape)
    for label in range(count):
        cut = places(bound[:, label], above[:, label])
        ones = np.ones(len(cut.node), dtype=np.int64)
        weights = [ones, tree.depth[cut.node], tree.counts[cut.node, label]]
        of_rules += rectangle_sums(cut, weights, shape)
        more = places(order[:, label], order_above[:, label])
        reached.append(rectangle_sums(more, [tree.samples[more.node]], shape)[0])
        freedom += choices[label] * (reached[label] - reached[label + 1])
    rules, length, broken = of_rules
    return _Sums(rules, length, broken, reached[1], freedom + choices[count] * reached[count])


def _choices(count: int) -> Floats:
    """What is left to choose from where 0, 1, ... of so many labels are forbidden, (count + 1,)."""
    if count == 1:  # there was nothing to choose from
        return np.ones(2)
    left = np.maximum(count - np.arange(count + 1), 1)
    return np.asarray(np.log(left) / np.log(count))


def _layers(
    supports: Floats, epsilons: Floats, sums: Sequence[_Sums], steps: int
) -> NeverLandscape:
    rules, length, broken, covered, freedom = (
        np.sum(one, axis=0) for one in zip(*sums, strict=True)
    )
    return NeverLandscape(
        supports=supports,
        epsilons=epsilons,
        rule_count=rules,
        mean_length=np.divide(length, rules, out=np.zeros(rules.shape), where=rules > 0),
        coverage=covered / (steps * len(sums)),
        fidelity=np.divide(
            covered - broken, covered, out=np.full(covered.shape, np.nan), where=covered > 0
        ),
        freedom=freedom / (steps * len(sums)),
    )
