"""Moving thresholds, ratios and intervals of trees to where they achieve more.

An evolution strategy that learns which of them move together (CMA-ES, Hansen 2016) tries many
neighbours on the same episodes and follows those that bring more. The queries' features, of
combinations the two that are combined, their order, and the labels of discrete dimensions stay.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import LARGEST_RATIO, Combination, DerivedFeature
from sarl_core.improving.candidate import Candidate
from sarl_core.mining.combining.candidates import rounded_ratio
from sarl_core.mining.combining.queries import with_ratios
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.tree import LEAF, PolicyTree

POPULATION = 20  # neighbours a generation

# How far each number goes at first, in units of half the spread of a feature where it is asked
# about.
FIRST_STEP = 0.15
_WIDE_STEP, _FEW = 0.6, 4  # of so few numbers, which one generation can look for everywhere
_LEAST_STEP = 0.01
_WIDER = 1.5  # times, where all neighbours do alike
_MANY = 120  # numbers to move: of more, which move together takes longer to learn than there is
_SPREAD = (0.1, 0.9)  # quantiles
_INTERVALS = 8.0  # that a leaf's action moves by, where a threshold moves by half its spread


@dataclass(frozen=True)
class _CombinedQuery:
    """A query about a combination, and how its line is turned.

    Attributes:
        node: Of the query.
        ratio: From which it starts.
        scale: What the ratio changes by, so that values change by their spread.
        centre: Value of the second feature around which the line turns.
    """

    node: int
    ratio: float
    scale: float
    centre: float


@dataclass(frozen=True)
class Parameters:
    """What is moved.

    Attributes:
        trees: One an action dimension.
        spreads: Of each tree, half the spread of the queried feature at each node, (n,).
        lines: Of each tree, its queries about combinations.
        derived: What the trees derive.
        observed: Number of features that are observed.
    """

    trees: tuple[PolicyTree, ...]
    spreads: tuple[NDArray[np.float64], ...]
    lines: tuple[tuple[_CombinedQuery, ...], ...]
    derived: tuple[DerivedFeature, ...]
    observed: int

    @classmethod
    def of(cls, trees: Sequence[PolicyTree], pairs: Demonstrations) -> Parameters:
        """What may be moved in trees that were counted over these pairs."""
        spreads = tuple(_spread(tree, pairs) for tree in trees)
        lines = tuple(
            _lines(tree, pairs, spread) for tree, spread in zip(trees, spreads, strict=True)
        )
        return cls(tuple(trees), spreads, lines, pairs.derived, len(pairs.observed))

    @property
    def count(self) -> int:
        """How many numbers are moved: of each tree thresholds, ratios, and actions of leaves."""
        return sum(
            int((tree.feature != LEAF).sum()) + len(lines) + len(_moving_leaves(tree))
            for tree, lines in zip(self.trees, self.lines, strict=True)
        )

    def candidate(self, values: NDArray[np.float64]) -> Candidate:
        """The trees with everything moved by so much, (count,)."""
        structures = []
        derived: list[DerivedFeature] = list(self.derived)
        at = 0

        def take(count: int) -> NDArray[np.float64]:
            nonlocal at
            at += count
            return values[at - count : at]

        for tree, spread, lines in zip(self.trees, self.spreads, self.lines, strict=True):
            inner, leaves = tree.feature != LEAF, _moving_leaves(tree)
            threshold, label = tree.threshold.copy(), tree.label.copy()
            threshold[inner] += take(int(inner.sum())) * spread[inner]
            ratios = {}
            for line, turn in zip(lines, take(len(lines)).tolist(), strict=True):
                ratio = rounded_ratio(line.ratio + turn * line.scale)
                # Of 0 the query would ask about one feature.
                if 0.0 < abs(ratio) <= LARGEST_RATIO:
                    ratios[line.node] = ratio
                    threshold[line.node] += (ratio - line.ratio) * line.centre
            moved = np.rint(label[leaves] + take(len(leaves)) * _INTERVALS).astype(np.int64)
            label[leaves] = np.clip(moved, 0, tree.dimension.n_labels - 1)
            structure, derived = with_ratios(
                TreeStructure(
                    tree.feature, threshold, tree.children_left, tree.children_right, label
                ),
                derived,
                ratios,
                observed=self.observed,
            )
            structures.append(structure)
        return Candidate.of(structures, derived, observed=self.observed)


class Movement:
    """A search around trees for better ones of the same shape."""

    def __init__(
        self,
        trees: Sequence[PolicyTree],
        pairs: Demonstrations,
        *,
        step: float = FIRST_STEP,
        seed: int,
    ) -> None:
        """Begin where the trees are.

        Args:
            trees: One an action dimension, counted over `pairs`.
            pairs: That say how widely features are spread.
            step: How far each number goes at first; of few numbers farther.
            seed: Another one gives another way.
        """
        self._parameters = Parameters.of(trees, pairs)
        self.count = self._parameters.count
        self.here = self._parameters.candidate(np.zeros(self.count))
        self._begun = _WIDE_STEP if self.count <= _FEW else step
        self._strategy = _evolution_strategy(self.count, self._begun, seed) if self.count else None
        self._points: list[NDArray[np.float64]] = []

    @property
    def step(self) -> float:
        """How far each number goes now; at most as far as the first step of all."""
        now = self._begun if self._strategy is None else float(self._strategy.sigma)
        return min(max(now, _LEAST_STEP), FIRST_STEP)

    def ask(self) -> list[Candidate]:
        """`POPULATION` neighbours of where it has come to."""
        assert self._strategy is not None
        self._points = self._strategy.ask()
        return [self._parameters.candidate(point) for point in self._points]

    def tell(self, means: NDArray[np.float64]) -> None:
        """Take a step.

        Args:
            means: What the neighbours have achieved, or their places by it, (POPULATION,).
        """
        assert self._strategy is not None
        if np.ptp(means) == 0:
            # There is nothing to follow; further around there may be, and away from what does
            # worse there is the middle of what does well.
            self._strategy.sigma *= _WIDER
            return
        self._strategy.tell(self._points, -ranks(means))  # which follows the least
        self.here = self._parameters.candidate(self._strategy.mean)


def _evolution_strategy(count: int, step: float, seed: int) -> Any:
    """A search from 0 in so many dimensions."""
    import cma
    from cma.evolution_strategy import InjectionWarning

    # Where all neighbours do alike it is not told of them, which it takes for an oversight.
    warnings.simplefilter("ignore", InjectionWarning)
    generator = np.random.default_rng(seed)
    return cma.CMAEvolutionStrategy(
        np.zeros(count),
        step,
        {
            "popsize": POPULATION,
            "CMA_diagonal": count > _MANY,
            # A generator of its own: else it would seed everybody's.
            "seed": np.nan,
            "randn": lambda *shape: generator.standard_normal(shape),
            "verbose": -9,
        },
    )


def ranks(means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places from -0.5, the least, to 0.5.

    Args:
        means: Shape (n,).

    Returns:
        Shape (n,). Equal means share theirs, so that nothing is followed where all do alike.
    """
    from scipy.stats import rankdata

    places: NDArray[np.float64] = (rankdata(means) - 1) / max(len(means) - 1, 1) - 0.5
    return places


def _moving_leaves(tree: PolicyTree) -> NDArray[np.int64]:
    """Leaves whose action is an amount."""
    leaves: NDArray[np.int64] = np.flatnonzero(tree.feature == LEAF)
    return leaves if tree.dimension.is_interval else leaves[:0]


def _spread(tree: PolicyTree, pairs: Demonstrations) -> NDArray[np.float64]:
    """Half the spread of the queried feature among the pairs that reach each inner node, (n,)."""
    spread = np.zeros(tree.n_nodes)
    for node in np.flatnonzero(tree.feature != LEAF).tolist():
        values = pairs.observations[tree.rows(node), tree.feature[node]]
        values = values[np.isfinite(values)]  # a formula may be infinite
        if len(values):
            low, high = np.quantile(values, _SPREAD)
            spread[node] = 0.5 * float(high - low)
    return spread


def _lines(
    tree: PolicyTree, pairs: Demonstrations, spread: NDArray[np.float64]
) -> tuple[_CombinedQuery, ...]:
    """The queries of a tree about combinations."""
    lines = []
    observed = len(pairs.observed)
    for node in np.flatnonzero(tree.feature >= observed).tolist():
        queried = pairs.derived[int(tree.feature[node]) - observed].definition
        values = pairs.observations[tree.rows(node)]
        if not isinstance(queried, Combination) or not len(values):
            continue
        second = values[:, queried.features[1]]
        low, high = np.quantile(second, _SPREAD)
        if high > low:
            scale = spread[node] / (0.5 * float(high - low))
            lines.append(_CombinedQuery(node, queried.ratio, scale, float(np.median(second))))
    return tuple(lines)
