"""A decision tree as neutral and immutable arrays, whichever learner grew it.

The demonstrations are kept in the order of the leaves, which makes the rows that reach a node a
slice.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.demonstrations.splits import Splits
from sarl_core.errors import require
from sarl_core.mining.labels import LabelledDimension

LEAF = -1
_MANY_STATES = 50_000  # of which each feature's are sorted by a thread

Learner = Literal["exact", "histogram"]
"""What chose the queries of a tree: all borders between two values, or those of bins."""


@dataclass(frozen=True)
class Source:
    """Where trees and rules come from.

    Attributes:
        env_id: Environment, "" where unknown.
        features: Names and units of the observation vector's d entries, and of what is derived.
        digest: Fingerprint of the demonstrations.
        steps: Number N of state-action pairs.
        episodes: Number of episodes.
    """

    env_id: str
    features: tuple[Feature, ...]
    digest: str
    steps: int
    episodes: int

    @classmethod
    def of(cls, demonstrations: Demonstrations) -> Source:
        """What is kept of demonstrations.

        Args:
            demonstrations: N pairs, or a sample of them.

        Returns:
            Where trees and rules of them come from.
        """
        whole = demonstrations.whole
        return cls(
            env_id=demonstrations.env_id,
            features=demonstrations.features,
            digest=whole.digest,
            steps=whole.steps,
            episodes=whole.episodes,
        )

    def with_splits(self, splits: Sequence[Splits | None]) -> Source:
        """The same, with what is known of thresholds.

        Args:
            splits: Of each of the d features.

        Returns:
            Features with these splits in the place of what they had.
        """
        return replace(
            self,
            features=tuple(
                replace(feature, splits=one)
                for feature, one in zip(self.features, splits, strict=True)
            ),
        )


@dataclass(frozen=True, eq=False, repr=False)
class PolicyTree:
    """A decision tree of one action dimension, with n nodes over N demonstrated pairs.

    Attributes:
        index: Which action dimension.
        dimension: The action dimension and its labels.
        divider: Number of intervals of continuous dimensions.
        source: What it was grown from.
        feature: Feature queried at each node, (n,) int64; `LEAF` at leaves.
        threshold: A state goes left where ``x[feature] <= threshold``, (n,) float64.
        children_left: Node number of the left child, (n,) int64, `LEAF` at leaves.
        children_right: Node number of the right child, (n,) int64, `LEAF` at leaves.
        parent: Node number of the parent, (n,) int64, -1 at the root.
        depth: Number of queries above each node, (n,) int64.
        counts: Demonstrated pairs of each label at each node, (n, labels) int64.
        sample_order: Row numbers of the demonstrations, sorted by leaf, (N,) int64; or, where far
            more pairs were counted than anybody holds, of those that are held, (M,).
        sample_start: Where each node's pairs begin, were all of them sorted by leaf, (n,) int64.
        demonstrated: Action of each row in this dimension, (N,) or (M,); what a projection may use.
        label: What a rule cut at each node says, (n,) int64: the most frequent label, the lowest
            where several are, unless the tree was improved by what it achieves.
        number: What stands in the id of a rule cut at each node, (n,) int64: its place, unless a
            part of the tree was regrown; the other nodes then keep theirs.
        learner: What chose its queries.
        sample_place: Where the pairs of the row's leaf begin, for each row of `sample_order`, (M,)
            int64, ascending; None where that holds all pairs.
        least_support: No node with less was split further: at a lower minimum support there are
            rules that this tree does not know.
    """

    index: int
    dimension: LabelledDimension
    divider: int
    source: Source
    feature: NDArray[np.int64]
    threshold: NDArray[np.float64]
    children_left: NDArray[np.int64]
    children_right: NDArray[np.int64]
    parent: NDArray[np.int64]
    depth: NDArray[np.int64]
    counts: NDArray[np.int64]
    sample_order: NDArray[np.int64]
    sample_start: NDArray[np.int64]
    demonstrated: NDArray[np.int64] | NDArray[np.float32]
    label: NDArray[np.int64]
    number: NDArray[np.int64]
    learner: Learner = "exact"
    sample_place: NDArray[np.int64] | None = None
    least_support: float = 0.0

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        make_read_only(self)

    def __repr__(self) -> str:
        """Its size, as `PolicyTree('push', nodes=301, depth=14, steps=15000)`."""
        return (
            f"PolicyTree({self.dimension.name!r}, nodes={self.n_nodes}, "
            f"depth={int(self.depth.max())}, steps={self.source.steps})"
        )

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.feature)

    @cached_property
    def digest(self) -> str:
        """Fingerprint (blake2b, 32 hex digits) of the tree, and of what is known of its data."""
        digest = hashlib.blake2b(digest_size=16)
        splits = [feature.splits for feature in self.source.features]
        for place, part in enumerate([self, *splits]):
            for column in fields(part) if part is not None else ():
                value = getattr(part, column.name)
                if isinstance(value, np.ndarray):
                    digest.update(f"{place} {column.name} {value.dtype}{value.shape}".encode())
                    digest.update(np.ascontiguousarray(value).data)
                else:
                    digest.update(f"{place} {column.name} {value!r}".encode())
        return digest.hexdigest()

    @cached_property
    def samples(self) -> NDArray[np.int64]:
        """Pairs that reach each node, (n,)."""
        return np.asarray(self.counts.sum(axis=1))

    @cached_property
    def correct(self) -> NDArray[np.int64]:
        """Pairs at each node that carry its label, (n,)."""
        return np.asarray(np.take_along_axis(self.counts, self.label[:, None], axis=1)[:, 0])

    @cached_property
    def support(self) -> NDArray[np.float64]:
        """Share of all pairs that reach each node, (n,)."""
        return np.asarray(self.samples / self.samples[0])

    @cached_property
    def confidence(self) -> NDArray[np.float64]:
        """Share of each node's pairs that carry its label, 0 where there are none, (n,)."""
        return np.asarray(self.correct / np.maximum(self.samples, 1))

    @cached_property
    def lift(self) -> NDArray[np.float64]:
        """Confidence over the label's share of all pairs, 0 where no pair carries it, (n,)."""
        # One quotient of whole numbers, and so the float nearest to it: with two, a lift of 11/10
        # may come out below 1.1.
        expected = self.samples * self.counts[0][self.label]
        lift = np.zeros(self.n_nodes)
        np.divide(self.correct * self.samples[0], expected, out=lift, where=expected > 0)
        return lift

    @cached_property
    def confidence_above(self) -> NDArray[np.float64]:
        """Highest confidence among the ancestors of each node, -inf at the root, (n,)."""
        return highest_above(self, self.confidence)

    def path(self, node: int) -> tuple[int, ...]:
        """Node numbers from the root to a node, both included.

        Args:
            node: Node number.

        Returns:
            The root first.
        """
        nodes = [int(node)]
        while (above := int(self.parent[nodes[-1]])) >= 0:
            nodes.append(above)
        return tuple(reversed(nodes))

    def place_of(self, number: int) -> int | None:
        """Where the node is by whose number rules are called.

        Args:
            number: As `number` has it.

        Returns:
            Node number; None where there is no such node.
        """
        places = np.flatnonzero(self.number == number)
        return int(places[0]) if len(places) else None

    def rows(self, node: int) -> NDArray[np.int64]:
        """Rows of the demonstrations that reach a node.

        Args:
            node: Node number.

        Returns:
            Row numbers, shape (samples[node],); of the rows that are held, where those are some.
        """
        start = int(self.sample_start[node])
        end = start + int(self.samples[node])
        if self.sample_place is not None:
            start, end = np.searchsorted(self.sample_place, [start, end]).tolist()
        return self.sample_order[start:end]

    def apply(self, observations: NDArray[np.float32]) -> NDArray[np.int64]:
        """The leaf that each state reaches.

        Args:
            observations: Shape (B, d), float32.

        Returns:
            Node numbers, shape (B,).
        """
        return walk(
            observations, self.feature, self.threshold, self.children_left, self.children_right
        )


def without_rows(tree: PolicyTree) -> PolicyTree:
    """A tree that holds no longer which pairs reach its nodes, only how many.

    Args:
        tree: Any.

    Returns:
        The same, with M = 0 rows.
    """
    none = tree.sample_order[:0].copy()
    return replace(
        tree, sample_order=none, sample_place=none, demonstrated=tree.demonstrated[:0].copy()
    )


def source_of(trees: Sequence[PolicyTree]) -> Source:
    """What the trees of one rule set were grown from.

    Args:
        trees: One an action dimension, over the same demonstrations.

    Returns:
        Where they come from; its features know the thresholds of all of them.
    """
    known = zip(*(tree.source.features for tree in trees), strict=True)
    splits = [[one.splits for one in same if one.splits is not None] for same in known]
    return trees[0].source.with_splits([Splits.together(some) if some else None for some in splits])


def splits_of(
    feature: NDArray[np.int64], threshold: NDArray[np.float64], states: NDArray[np.float32]
) -> list[Splits | None]:
    """What demonstrations tell of thresholds.

    Args:
        feature: Feature that each is asked of, (k,); `LEAF` where nothing is asked.
        threshold: Shape (k,).
        states: That were demonstrated, (N, d).

    Returns:
        One entry a feature; None where it is not asked.
    """
    is_used = np.isin(np.arange(states.shape[1]), feature)

    def of(index: int) -> Splits | None:
        return Splits.of(states[:, index], threshold[feature == index]) if is_used[index] else None

    if len(states) < _MANY_STATES:
        return list(map(of, range(states.shape[1])))
    from loky import cpu_count

    with ThreadPoolExecutor(cpu_count()) as threads:  # sorting lets others run
        return list(threads.map(of, range(states.shape[1])))


def highest_above(tree: PolicyTree, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The highest value among the ancestors of each node.

    Args:
        tree: With n nodes.
        values: One a node, (n,).

    Returns:
        Shape (n,); -inf at the root.
    """
    above = np.full(tree.n_nodes, -np.inf)
    # By depth, so that a parent is final before its children ask.
    by_depth = np.argsort(tree.depth, kind="stable")
    ends = np.cumsum(np.bincount(tree.depth))
    for start, end in pairwise(ends.tolist()):
        level = by_depth[start:end]
        parent = tree.parent[level]
        above[level] = np.maximum(above[parent], values[parent])
    return above


def walk(
    observations: NDArray[np.float32],
    feature: NDArray[np.int64],
    threshold: NDArray[np.float64],
    children_left: NDArray[np.int64],
    children_right: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Send states down a tree, all at once, one level a turn.

    Args:
        observations: Shape (B, d), float32.
        feature: Feature queried at each node, `LEAF` where a walk ends, (n,).
        threshold: Shape (n,).
        children_left: Shape (n,).
        children_right: Shape (n,).

    Returns:
        Where each state's walk ends, shape (B,).
    """
    nodes = np.zeros(len(observations), dtype=np.int64)
    active = np.arange(len(observations)) if feature[0] != LEAF else np.zeros(0, dtype=np.int64)
    while len(active):
        here = nodes[active]
        left = observations[active, feature[here]] <= threshold[here]
        here = np.where(left, children_left[here], children_right[here])
        nodes[active] = here
        active = active[feature[here] != LEAF]
    return nodes


def several_trees(
    trees: PolicyTree | Sequence[PolicyTree], must: str, advice: str
) -> tuple[PolicyTree, ...]:
    """The trees that a public function was given.

    Args:
        trees: One tree, or several.
        must: What has to be trees, for errors.
        advice: What to do where they are none, likewise.

    Returns:
        Those.

    Raises:
        InputError: If they are something else.
    """
    if isinstance(trees, PolicyTree):
        return (trees,)
    if not isinstance(trees, (list, tuple)) or not all(isinstance(t, PolicyTree) for t in trees):
        require(trees, PolicyTree, must, advice)
    return tuple(trees)
