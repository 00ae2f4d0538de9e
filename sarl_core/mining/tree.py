"""Growing a decision tree and reading it, once, into neutral and immutable arrays.

Nothing outside this file touches scikit-learn's tree, so that another learner can hand over the
same type. The demonstrations are kept in the order of the leaves, which makes the rows that reach
a node a slice.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.demonstrations.requirements import LARGEST
from sarl_core.demonstrations.splits import Splits
from sarl_core.errors import InputError, quoted, require
from sarl_core.mining.labels import LabelledDimension, label_dimensions

LEAF = -1

_SMALL = 2.0**-10  # a feature with no larger spread is multiplied before a tree is grown
_CROWDED = 1e-6  # and one of which half of the values lie as close together
_SCALED_TO = 20  # the power of two that spreads are brought to
_LARGEST_EXPONENT = 126  # of a float32, with some room
_LOOKED_AT = 1_000


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
            demonstrations: N pairs.

        Returns:
            Where trees and rules of them come from.
        """
        return cls(
            env_id=demonstrations.env_id,
            features=demonstrations.features,
            digest=demonstrations.digest,
            steps=len(demonstrations),
            episodes=demonstrations.n_episodes,
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
        sample_order: Row numbers of the demonstrations, sorted by leaf, (N,) int64.
        sample_start: Where each node's rows begin in `sample_order`, (n,) int64.
        demonstrated: Action of each row in this dimension, (N,); what a projection may use.
        label: What a rule cut at each node says, (n,) int64: the most frequent label, the lowest
            where several are, unless the tree was improved by what it achieves.
        number: What stands in the id of a rule cut at each node, (n,) int64: its place, unless a
            part of the tree was regrown; the other nodes then keep theirs.
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
            Row numbers, shape (samples[node],).
        """
        start = int(self.sample_start[node])
        return self.sample_order[start : start + int(self.samples[node])]

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
    feature: NDArray[np.int64], threshold: NDArray[np.float64], demonstrations: Demonstrations
) -> list[Splits | None]:
    """What demonstrations tell of thresholds.

    Args:
        feature: Feature that each is asked of, (k,); `LEAF` where nothing is asked.
        threshold: Shape (k,).
        demonstrations: N states.

    Returns:
        One entry a feature; None where it is not asked.
    """
    states = demonstrations.observations
    is_used = np.isin(np.arange(states.shape[1]), feature)
    return [
        Splits.of(states[:, index], threshold[feature == index]) if is_used[index] else None
        for index in range(states.shape[1])
    ]


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


def grow_policy_trees(
    demonstrations: Demonstrations,
    *,
    divider: int = 2,
    max_depth: int | None = None,
    seed: int = 0,
) -> tuple[PolicyTree, ...]:
    """Grow one CART tree an action dimension (the paper's "Derive Safety Rules").

    Args:
        demonstrations: N pairs.
        divider: Number of intervals of each continuous dimension.
        max_depth: Of the trees; None grows them fully. A limit can also be set afterwards,
            at the thresholds, without growing anything again.
        seed: For choosing among equally good queries.

    Returns:
        One tree an action dimension.

    Raises:
        InputError: If the divider or the depth is out of range.
    """
    from loky import cpu_count
    from sklearn.tree import DecisionTreeClassifier

    must = "what trees are grown from must be Demonstrations"
    require(demonstrations, Demonstrations, must, "load them: load_demonstrations(path)")
    if max_depth is not None and not (isinstance(max_depth, Integral) and max_depth >= 1):
        raise InputError(f"the maximum depth is {quoted(max_depth)}; give 1 or more, or none")
    dimensions = label_dimensions(demonstrations, divider)

    def grown(index: int) -> PolicyTree:
        labels = dimensions[index].labels_of(demonstrations.action_columns[:, index])
        learner = DecisionTreeClassifier(criterion="gini", max_depth=max_depth, random_state=seed)
        structure = fitted(learner, demonstrations.observations, labels)
        return count_tree(structure, demonstrations, index, divider=divider)

    if len(dimensions) == 1:
        return (grown(0),)
    # scikit-learn lets other threads run while it grows a tree.
    with ThreadPoolExecutor(min(len(dimensions), cpu_count())) as threads:
        return tuple(threads.map(grown, range(len(dimensions))))


@dataclass(frozen=True, eq=False)
class TreeStructure:
    """The queries of a tree with n nodes, the root first, and what its nodes say.

    Attributes:
        feature: Feature queried at each node, (n,) int64; `LEAF` at leaves.
        threshold: A state goes left where ``x[feature] <= threshold``, (n,) float64.
        children_left: Node number of the left child, (n,) int64, `LEAF` at leaves.
        children_right: Node number of the right child, (n,) int64, `LEAF` at leaves.
        label: What each node says, (n,) int64, -1 for the most frequent label; None for that
            everywhere.
    """

    feature: NDArray[np.int64]
    threshold: NDArray[np.float64]
    children_left: NDArray[np.int64]
    children_right: NDArray[np.int64]
    label: NDArray[np.int64] | None = None

    def apply(self, observations: NDArray[np.float32]) -> NDArray[np.int64]:
        """The leaf that each state reaches, (B,), as `PolicyTree.apply`."""
        return walk(
            observations, self.feature, self.threshold, self.children_left, self.children_right
        )


def fitted(
    learner: Any,
    observations: NDArray[np.float32],
    targets: NDArray[Any],
    weights: NDArray[np.float64] | None = None,
) -> TreeStructure:
    """Fit a tree of scikit-learn to states of any scale, and read its queries.

    scikit-learn takes values within 1e-7 of each other for equal. Features that small are grown on
    multiplied by a power of two, which is exact, and so are the thresholds on the way back: the
    tree splits the states themselves as it split their multiples.

    Args:
        learner: A `DecisionTreeClassifier` or `DecisionTreeRegressor`; it is fitted.
        observations: Shape (N, d), float32.
        targets: Labels (N,), or values (N,) or (N, k).
        weights: Of the pairs, (N,), or None.

    Returns:
        Its queries, without labels.
    """
    # A formula may be infinite, which scikit-learn refuses; thresholds lie below the limit.
    if observations.max() > LARGEST or observations.min() < -LARGEST:
        observations = np.clip(observations, -LARGEST, LARGEST)
    exponents = _exponents(observations)
    states = np.ldexp(observations, exponents) if exponents.any() else observations
    learner.fit(states, targets, sample_weight=weights)
    tree = learner.tree_
    left = np.asarray(tree.children_left, dtype=np.int64)
    feature = np.where(left == LEAF, LEAF, tree.feature).astype(np.int64)
    threshold = np.array(tree.threshold, dtype=np.float64)
    inner = feature != LEAF
    threshold[inner] = np.ldexp(threshold[inner], -exponents[feature[inner]])
    return TreeStructure(
        feature=feature,
        threshold=threshold,
        children_left=left,
        children_right=np.asarray(tree.children_right, dtype=np.int64),
    )


def _exponents(observations: NDArray[np.float32]) -> NDArray[np.int64]:
    """By which powers of two features are multiplied, (d,); 0 for those of a usual scale."""
    low, high = observations.min(axis=0), observations.max(axis=0)
    width = high.astype(np.float64) - low
    # An outlier may hide how small the others are; some rows are enough to see it.
    some = np.sort(observations[:: max(1, len(observations) // _LOOKED_AT)].astype(np.float64), 0)
    half = len(some) // 2
    dense = (some[half:] - some[: len(some) - half]).min(axis=0)
    width = np.where((dense > 0) & (dense < _CROWDED), dense, width)
    small = (width > 0) & (width < _SMALL)
    exponents = np.zeros(observations.shape[1], dtype=np.int64)
    wanted = _SCALED_TO - np.frexp(width[small])[1]
    most = np.frexp(np.maximum(np.abs(low[small]), np.abs(high[small])))[1]
    exponents[small] = np.clip(wanted, 0, _LARGEST_EXPONENT - most)
    return exponents


def count_tree(
    structure: TreeStructure, demonstrations: Demonstrations, index: int, *, divider: int
) -> PolicyTree:
    """Send demonstrations down a tree and count what the expert did at every node.

    Args:
        structure: Its queries, over the demonstrations' features.
        demonstrations: N pairs.
        index: Which action dimension.
        divider: Number of intervals of continuous dimensions.

    Returns:
        The tree.

    Raises:
        InputError: If the divider is out of range.
    """
    dimension = label_dimensions(demonstrations, divider)[index]
    demonstrated = demonstrations.action_columns[:, index].copy()
    labels = dimension.labels_of(demonstrated)
    left, right = structure.children_left, structure.children_right
    levels = _levels(left, right)
    n = len(left)
    parent = np.full(n, -1, dtype=np.int64)
    depth = np.zeros(n, dtype=np.int64)
    leaves = structure.apply(demonstrations.observations)
    # Counted here, since scikit-learn keeps fractions and the positions of the labels it saw.
    counts = np.bincount(
        leaves * dimension.n_labels + labels, minlength=n * dimension.n_labels
    ).reshape(n, dimension.n_labels)
    for number, level in enumerate(levels):
        depth[level] = number
        inner = level[left[level] != LEAF]
        parent[left[inner]] = inner
        parent[right[inner]] = inner
    for level in reversed(levels):
        inner = level[left[level] != LEAF]
        counts[inner] = counts[left[inner]] + counts[right[inner]]
    samples = counts.sum(axis=1)
    frequent = counts.argmax(axis=1).astype(np.int64)
    start = np.zeros(n, dtype=np.int64)
    for level in levels:
        inner = level[left[level] != LEAF]
        start[left[inner]] = start[inner]
        start[right[inner]] = start[inner] + samples[left[inner]]
    return PolicyTree(
        index=index,
        dimension=dimension,
        divider=int(divider),
        source=Source.of(demonstrations).with_splits(
            splits_of(structure.feature, structure.threshold, demonstrations)
        ),
        feature=structure.feature,
        threshold=structure.threshold,
        children_left=left,
        children_right=right,
        parent=parent,
        depth=depth,
        counts=counts.astype(np.int64),
        # Stable, so that the rows of a leaf keep their order in time.
        sample_order=np.argsort(start[leaves], kind="stable").astype(np.int64),
        sample_start=start,
        demonstrated=demonstrated,
        label=(
            frequent
            if structure.label is None
            else np.where(structure.label < 0, frequent, structure.label)
        ),
        number=np.arange(n, dtype=np.int64),
    )


def _levels(left: NDArray[np.int64], right: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Node numbers, one array a depth, the root first."""
    levels = [np.zeros(1, dtype=np.int64)]
    while len(inner := levels[-1][left[levels[-1]] != LEAF]):
        levels.append(np.concatenate([left[inner], right[inner]]))
    return levels
