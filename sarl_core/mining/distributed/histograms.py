"""What is done with the rows of a piece while a tree grows: counted by bins, sent on, handed over.

All that leaves a piece are whole numbers that are added up, so it does not matter how rows were
cut into pieces, nor who adds them up first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.growing.exact import fitted
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.tree import LEAF

NOWHERE = -1
"""Of a row whose node is a leaf."""
_SORTED_ROWS = 10_000  # of fewer, sorting is faster than counting a thousand bins


@dataclass(frozen=True, eq=False)
class BinnedRows:
    """The rows of a piece as numbers of bins.

    Attributes:
        bins: Shape (n, d), uint16, one feature after the other in memory.
        labels: In each of m action dimensions, (n, m), uint16.
    """

    bins: NDArray[np.uint16]
    labels: NDArray[np.uint16]

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.labels)


@dataclass(frozen=True, eq=False)
class Queries:
    """Some nodes that are split, k of them.

    Attributes:
        node: Their numbers, (k,), ascending.
        feature: Queried, (k,).
        border: A row goes left whose bin is at most this, (k,).
        left: Number of the left child, (k,); `NOWHERE` where it is a leaf.
        right: Of the right one, likewise.
    """

    node: NDArray[np.int64]
    feature: NDArray[np.int64]
    border: NDArray[np.int64]
    left: NDArray[np.int64]
    right: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BestQueries:
    """For each of k nodes the query that parts its labels best.

    Attributes:
        feature: Shape (k,); `LEAF` where no border parts its rows.
        border: Shape (k,).
        left: Rows of each label that go left, (k, labels).
        right: That go right, likewise.
    """

    feature: NDArray[np.int64]
    border: NDArray[np.int64]
    left: NDArray[np.int64]
    right: NDArray[np.int64]


def at_root(rows: BinnedRows) -> NDArray[np.int32]:
    """The node of each row before anything is asked, (n,)."""
    return np.zeros(len(rows), dtype=np.int32)


def sent_on(rows: BinnedRows, nodes: NDArray[np.int32], queries: Queries) -> NDArray[np.int32]:
    """The node of each row one query further down.

    Args:
        rows: Of a piece.
        nodes: Where each is, (n,).
        queries: Of some of these nodes; rows of others stay.

    Returns:
        Shape (n,).
    """
    at, inside = _places(nodes, queries.node)
    which = np.flatnonzero(inside)
    query = at[which]
    goes_left = rows.bins[which, queries.feature[query]] <= queries.border[query]
    further = nodes.copy()
    further[which] = np.where(goes_left, queries.left[query], queries.right[query])
    return further


def histogram(
    rows: BinnedRows,
    nodes: NDArray[np.int32],
    wanted: NDArray[np.int64],
    shape: tuple[int, int],
    dimension: int,
) -> NDArray[np.int64]:
    """Count the rows of some nodes by feature, bin and label.

    Args:
        rows: Of a piece.
        nodes: Where each is, (n,).
        wanted: Numbers of k nodes, ascending.
        shape: Bins of a feature, and labels.
        dimension: Whose labels are counted.

    Returns:
        Shape (d, k, bins, labels).
    """
    bins, labels = shape
    at, inside = _places(nodes, wanted)
    which = slice(None) if inside.all() else np.flatnonzero(inside)
    begin = at[which] * (bins * labels) + rows.labels[which, dimension]
    size = len(wanted) * bins * labels
    counts = np.empty((rows.bins.shape[1], size), dtype=np.int64)
    for feature in range(rows.bins.shape[1]):
        key = rows.bins[which, feature].astype(np.int64)
        key *= labels
        key += begin
        counts[feature] = np.bincount(key, minlength=size)
    return counts.reshape(-1, len(wanted), bins, labels)


def added(*several: NDArray[np.int64]) -> NDArray[np.int64]:
    """The sum of arrays of one shape."""
    total = several[0].copy()
    for one in several[1:]:
        total += one
    return total


def best_queries(counts: NDArray[np.int64]) -> BestQueries:
    """Choose queries, as CART does by Gini's impurity; of equals the first feature and border.

    Args:
        counts: Of all rows of k nodes, (d, k, bins, labels).

    Returns:
        One a node.
    """
    d, k, _, labels = counts.shape
    best = np.full(k, -1.0)
    feature = np.full(k, LEAF, dtype=np.int64)
    border = np.zeros(k, dtype=np.int64)
    left = np.zeros((k, labels), dtype=np.int64)
    total = counts[0].sum(axis=1)
    nodes = np.arange(k)
    for index in range(d):
        below = counts[index].cumsum(axis=1)[:, :-1]
        above = total[:, None] - below
        n_below, n_above = below.sum(axis=2), above.sum(axis=2)
        parts = (n_below > 0) & (n_above > 0)
        # The impurity that is left is the number of rows less this.
        purity = np.square(below.astype(np.float64)).sum(axis=2) / np.maximum(n_below, 1)
        purity += np.square(above.astype(np.float64)).sum(axis=2) / np.maximum(n_above, 1)
        purity[~parts] = -1.0
        if not purity.shape[1]:
            continue
        at = purity.argmax(axis=1)
        here = purity[nodes, at]
        better = here > best
        # Between two bins that hold rows there may be empty ones: the border is in their middle.
        last = (n_below <= n_below[nodes, at][:, None]).sum(axis=1) - 1
        best = np.where(better, here, best)
        feature[better] = index
        border[better] = ((at + last) // 2)[better]
        left[better] = below[nodes, at][better]
    return BestQueries(feature, border, left, total - left)


def taken(
    rows: BinnedRows, nodes: NDArray[np.int32], groups: Sequence[NDArray[np.int64]]
) -> list[tuple[BinnedRows, NDArray[np.int32]]]:
    """The rows of some nodes, for whoever goes on with them.

    Args:
        rows: Of a piece.
        nodes: Where each is, (n,).
        groups: Numbers of nodes, ascending, each for another one.

    Returns:
        One entry a group: its rows, and the node of each.
    """
    parts = []
    for group in groups:
        which = np.flatnonzero(_places(nodes, group)[1])
        parts.append((BinnedRows(rows.bins[which], rows.labels[which]), nodes[which]))
    return parts


def grown_parts(
    wanted: NDArray[np.int64],
    depths: Sequence[int | None],
    least: int,
    seed: int,
    dimension: int,
    *pieces: tuple[BinnedRows, NDArray[np.int32]],
) -> list[TreeStructure]:
    """Grow what is to stand below nodes of which all rows fit into one memory.

    Args:
        wanted: Numbers of these nodes, ascending.
        depths: How deep each part may be; None for no limit.
        least: Rows that a node needs to be split.
        seed: For choosing among equally good queries.
        dimension: Whose labels the tree is about.
        pieces: Of each piece the rows that it has, and the node of each.

    Returns:
        One structure a node, whose thresholds are borders, as whole numbers.
    """
    nodes = np.concatenate([at for _, at in pieces])
    bins = np.concatenate([rows.bins for rows, _ in pieces])
    labels = np.concatenate([rows.labels[:, dimension] for rows, _ in pieces])
    parts = []
    for node, depth in zip(wanted.tolist(), depths, strict=True):
        which = nodes == node
        parts.append(_grown(bins[which], labels[which], depth, max(2, least), seed))
    return parts


def _grown(
    bins: NDArray[np.uint16],
    labels: NDArray[np.uint16],
    max_depth: int | None,
    least: int,
    seed: int,
) -> TreeStructure:
    """Grow a tree in memory: by counts as long as that is faster, then by scikit-learn."""
    mixed = len(labels) >= least and (labels != labels[0]).any() and max_depth != 0
    best = None
    if mixed and len(labels) > _SORTED_ROWS:
        n_bins, n_labels = int(bins.max()) + 1, int(labels.max()) + 1
        rows = BinnedRows(bins, labels[:, None])
        counts = histogram(rows, at_root(rows), np.zeros(1, dtype=np.int64), (n_bins, n_labels), 0)
        best = best_queries(counts)
        mixed = best.feature[0] != LEAF
    if not mixed:
        leaf = np.full(1, LEAF, dtype=np.int64)
        return TreeStructure(leaf, np.zeros(1), leaf, leaf)
    if best is None:
        from sklearn.tree import DecisionTreeClassifier

        learner = DecisionTreeClassifier(
            max_depth=max_depth, min_samples_split=least, random_state=seed
        )
        part = fitted(learner, bins.astype(np.float32), labels.astype(np.int64))
        return replace(part, threshold=np.floor(part.threshold))
    feature, border = int(best.feature[0]), int(best.border[0])
    left = bins[:, feature] <= border
    below = None if max_depth is None else max_depth - 1
    return joined(
        feature,
        border,
        _grown(bins[left], labels[left], below, least, seed),
        _grown(bins[~left], labels[~left], below, least, seed),
    )


def joined(feature: int, border: float, left: TreeStructure, right: TreeStructure) -> TreeStructure:
    """A query with what stands below it, the left part before the right one."""
    n = len(left.feature)

    def placed(own: NDArray[np.int64], before: int) -> NDArray[np.int64]:
        return np.where(own == LEAF, LEAF, own + before)

    return TreeStructure(
        np.concatenate([[feature], left.feature, right.feature]),
        np.concatenate([[float(border)], left.threshold, right.threshold]),
        np.concatenate([[1], placed(left.children_left, 1), placed(right.children_left, n + 1)]),
        np.concatenate(
            [[n + 1], placed(left.children_right, 1), placed(right.children_right, n + 1)]
        ),
    )


def _places(
    nodes: NDArray[np.int32], wanted: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Where each row's node is among some, and whether it is one of them."""
    table = np.full(int(wanted[-1]) + 2, NOWHERE, dtype=np.int64)  # the last one is for `NOWHERE`
    table[wanted] = np.arange(len(wanted))
    known = nodes <= wanted[-1]
    at = table[np.where(known, nodes, NOWHERE)]
    return at, at != NOWHERE
