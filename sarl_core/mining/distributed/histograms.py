"""What is done with the rows of a piece while a tree grows: counted by bins, sent on, handed over.

All that leaves a piece are whole numbers that are added up, so it does not matter how rows were
cut into pieces, nor who adds them up first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.growing.histogram import Query, best_queries, binned_structure
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.tree import LEAF

NOWHERE = -1
"""Of a row whose node is a leaf."""


@dataclass(frozen=True, eq=False)
class BinnedRows:
    """The rows of a piece as numbers of bins.

    Attributes:
        bins: Shape (d, n), uint16.
        labels: In each of m action dimensions, (m, n), uint16.
    """

    bins: NDArray[np.uint16]
    labels: NDArray[np.uint16]

    def __len__(self) -> int:
        """Number of rows."""
        return int(self.bins.shape[1])


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
    goes_left = rows.bins[queries.feature[query], which] <= queries.border[query]
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
    """Count the rows of some nodes by feature, label and bin.

    Args:
        rows: Of a piece.
        nodes: Where each is, (n,).
        wanted: Numbers of k nodes, ascending.
        shape: Labels, and bins of a feature.
        dimension: Whose labels are counted.

    Returns:
        Shape (d, k, labels, bins).
    """
    labels, bins = shape
    at, inside = _places(nodes, wanted)
    which = slice(None) if inside.all() else np.flatnonzero(inside)
    begin = (at[which] * labels + rows.labels[dimension, which]) * bins
    size = len(wanted) * labels * bins
    counts = np.empty((len(rows.bins), size), dtype=np.int64)
    for feature, numbers in enumerate(rows.bins):
        counts[feature] = np.bincount(numbers[which] + begin, minlength=size)
    return counts.reshape(-1, len(wanted), labels, bins)


def added(*several: NDArray[np.int64]) -> NDArray[np.int64]:
    """The sum of arrays of one shape."""
    total = several[0].copy()
    for one in several[1:]:
        total += one
    return total


def chosen_queries(counts: NDArray[np.int64]) -> list[Query | None]:
    """The best query of each of k nodes; None where no border parts its rows.

    Args:
        counts: Of all their rows, (d, k, labels, bins).

    Returns:
        k entries.
    """
    # One node at a time: the sums of all of them would take several times the room of the counts.
    return [best_queries(counts[None, :, node])[0] for node in range(counts.shape[1])]


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
        parts.append((BinnedRows(rows.bins[:, which], rows.labels[:, which]), nodes[which]))
    return parts


def grown_parts(
    wanted: NDArray[np.int64],
    depths: Sequence[int | None],
    least: int,
    seed: int,
    dimension: int,
    counts: Sequence[int],
    *pieces: tuple[BinnedRows, NDArray[np.int32]],
) -> list[TreeStructure]:
    """Grow what is to stand below nodes of which all rows fit into one memory.

    Args:
        wanted: Numbers of these nodes, ascending.
        depths: How deep each part may be; None for no limit.
        least: Rows that a node needs to be split.
        seed: For choosing among equally good queries.
        dimension: Whose labels the tree is about.
        counts: How many bins each feature has.
        pieces: Of each piece the rows that it has, and the node of each.

    Returns:
        One structure a node, whose thresholds are borders, as whole numbers.
    """
    nodes = np.concatenate([at for _, at in pieces])
    bins = np.concatenate([rows.bins for rows, _ in pieces], axis=1)
    labels = np.concatenate([rows.labels[dimension] for rows, _ in pieces]).astype(np.int64)
    parts = []
    for node, depth in zip(wanted.tolist(), depths, strict=True):
        which = np.flatnonzero(nodes == node)
        part, _ = binned_structure(
            bins[:, which], counts, labels[which], least=least, max_depth=depth, seed=seed
        )
        parts.append(part)
    return parts


def joined(feature: int, border: int, left: TreeStructure, right: TreeStructure) -> TreeStructure:
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
    if not len(wanted):
        return np.full(len(nodes), NOWHERE, dtype=np.int64), np.zeros(len(nodes), dtype=np.bool_)
    table = np.full(int(wanted[-1]) + 2, NOWHERE, dtype=np.int64)  # the last one is for `NOWHERE`
    table[wanted] = np.arange(len(wanted))
    known = nodes <= wanted[-1]
    at = table[np.where(known, nodes, NOWHERE)]
    return at, at != NOWHERE
