"""The queries of a tree, whichever learner chose them, and the demonstrations sent down them.

A learner chooses queries; supports and confidences are counted here, of all demonstrations, by the
comparison that shield and exports make. So they are exact, whatever the learner saw.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.tree import LEAF, Learner, PolicyTree, Source, splits_of, walk


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


def count_tree(
    structure: TreeStructure,
    demonstrations: Demonstrations,
    index: int,
    *,
    divider: int,
    learner: Learner = "exact",
    leaves: NDArray[np.int64] | None = None,
) -> PolicyTree:
    """Send demonstrations down a tree and count what the expert did at every node.

    Args:
        structure: Its queries, over the demonstrations' features.
        demonstrations: N pairs.
        index: Which action dimension.
        divider: Number of intervals of continuous dimensions.
        learner: What chose the queries.
        leaves: The leaf that each pair reaches, (N,), where that is known.

    Returns:
        The tree.

    Raises:
        InputError: If the divider is out of range.
    """
    dimension = label_dimensions(demonstrations, divider)[index]
    labels = dimension.labels_of(demonstrations.action_columns[:, index])
    if leaves is None:
        leaves = structure.apply(demonstrations.observations)
    # Counted here, since scikit-learn keeps fractions and the positions of the labels it saw.
    n = len(structure.feature)
    counts = np.bincount(
        leaves * dimension.n_labels + labels, minlength=n * dimension.n_labels
    ).reshape(n, dimension.n_labels)
    splits = splits_of(structure.feature, structure.threshold, demonstrations.observations)
    return tree_of_counts(
        structure,
        counts,
        demonstrations,
        leaves,
        index,
        divider=divider,
        learner=learner,
        source=Source.of(demonstrations).with_splits(splits),
    )


def tree_of_counts(
    structure: TreeStructure,
    counts: NDArray[np.int64],
    demonstrations: Demonstrations,
    leaves: NDArray[np.int64],
    index: int,
    *,
    divider: int,
    learner: Learner,
    source: Source,
) -> PolicyTree:
    """Put together a tree whose leaves are counted.

    Args:
        structure: Its queries.
        counts: Pairs of each label at each leaf, and 0 at other nodes, (n, labels).
        demonstrations: These pairs; or some of them, where there are far more.
        leaves: The leaf that each of those reaches, (N,).
        index: Which action dimension.
        divider: Number of intervals of continuous dimensions.
        learner: What chose the queries.
        source: What was counted.

    Returns:
        The tree.

    Raises:
        InputError: If the divider is out of range.
    """
    dimension = label_dimensions(demonstrations, divider)[index]
    left, right = structure.children_left, structure.children_right
    levels = tree_levels(left, right)
    n = len(left)
    parent = np.full(n, -1, dtype=np.int64)
    depth = np.zeros(n, dtype=np.int64)
    counts = counts.astype(np.int64)
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
    place = np.zeros(n, dtype=np.min_scalar_type(n))  # numbers of two bytes are sorted fastest
    place[np.argsort(start, kind="stable")] = np.arange(n)
    # Stable, so that the rows of a leaf keep their order in time.
    order = np.argsort(place[leaves], kind="stable").astype(np.int64)
    return PolicyTree(
        index=index,
        dimension=dimension,
        divider=int(divider),
        source=source,
        feature=structure.feature,
        threshold=structure.threshold,
        children_left=left,
        children_right=right,
        parent=parent,
        depth=depth,
        counts=counts,
        sample_order=order,
        sample_start=start,
        sample_place=None if len(leaves) == samples[0] else start[leaves][order],
        demonstrated=demonstrations.action_columns[:, index].copy(),
        label=(
            frequent
            if structure.label is None
            else np.where(structure.label < 0, frequent, structure.label)
        ),
        number=np.arange(n, dtype=np.int64),
        learner=learner,
    )


def tree_levels(left: NDArray[np.int64], right: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """The nodes of each depth.

    Args:
        left: Node number of the left child, (n,), `LEAF` at leaves.
        right: Of the right child, likewise.

    Returns:
        Node numbers, one array a depth, the root first.
    """
    levels = [np.zeros(1, dtype=np.int64)]
    while len(inner := levels[-1][left[levels[-1]] != LEAF]):
        levels.append(np.concatenate([left[inner], right[inner]]))
    return levels
