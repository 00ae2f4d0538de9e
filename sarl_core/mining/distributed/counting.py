"""The last pass: what is counted of all rows at the nodes of finished trees, exactly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.splits import Splits
from sarl_core.mining.distributed.pieces import Piece, Reading, read_piece
from sarl_core.mining.distributed.survey import Placement
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.tree import LEAF, splits_of

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class TreeCounts:
    """What rows are at the nodes of one tree, n of them.

    Attributes:
        counts: Rows of each label at each leaf, (n, labels).
        least: Least value of each feature at each leaf, (n, d) float32; inf where there is no row.
        most: Largest, likewise; -inf.
        splits: Of each feature, for the thresholds of the tree; None where it is not queried.
        held_out: Of episodes that were held out: (leaf * episodes + place of the episode)
            * labels + label, ascending, and how many rows there are, (2, K).
    """

    counts: Integers
    least: NDArray[np.float32]
    most: NDArray[np.float32]
    splits: list[Splits | None]
    held_out: Integers


def count_piece(
    piece: Piece,
    reading: Reading,
    placement: Placement,
    structures: Sequence[TreeStructure],
    divider: int,
) -> list[TreeCounts]:
    """Send the rows of a piece down trees.

    Args:
        piece: To read.
        reading: How.
        placement: What all pieces have in common.
        structures: The trees, one an action dimension.
        divider: Number of intervals of continuous dimensions.

    Returns:
        One entry a tree.
    """
    given = read_piece(piece, reading)
    assert given is not None  # others were left out when they were surveyed
    rows = placement.placed(given.steps, piece.file)
    held = np.isin(rows.episodes, placement.held_out)
    sides = given.real & ~held, given.real & held
    dimensions = label_dimensions(rows, divider)
    counted = []
    for index, (structure, dimension) in enumerate(zip(structures, dimensions, strict=True)):
        labels = dimension.labels_of(rows.action_columns[:, index])
        counted.append(
            _counted(rows, structure, labels, dimension.n_labels, placement.held_out, sides)
        )
    return counted


def _counted(
    rows: Demonstrations,
    structure: TreeStructure,
    labels: Integers,
    n_labels: int,
    held_out: Integers,
    sides: tuple[NDArray[np.bool_], NDArray[np.bool_]],
) -> TreeCounts:
    mined, held = sides
    n, d = len(structure.feature), rows.observations.shape[1]
    leaves = structure.apply(rows.observations)
    counts = np.bincount(leaves[mined] * n_labels + labels[mined], minlength=n * n_labels)
    least = np.full((n, d), np.inf, dtype=np.float32)
    most = np.full((n, d), -np.inf, dtype=np.float32)
    there = leaves[mined]
    if len(there):
        order = np.argsort(there, kind="stable")
        first = np.flatnonzero(np.diff(there[order], prepend=-1))
        states = rows.observations[mined][order]
        least[there[order][first]] = np.minimum.reduceat(states, first) + 0  # of two zeros one
        most[there[order][first]] = np.maximum.reduceat(states, first) + 0
    episode = np.searchsorted(held_out, rows.episodes[held])
    key = (leaves[held] * len(held_out) + episode) * n_labels + labels[held]
    present, samples = np.unique(key, return_counts=True)
    states = rows.observations[mined]
    return TreeCounts(
        counts.reshape(n, n_labels),
        least,
        most,
        splits_of(structure.feature, structure.threshold, states) if len(states) else [None] * d,
        np.stack([present, samples]),
    )


def together(*several: list[TreeCounts]) -> list[TreeCounts]:
    """What several pieces come to, tree by tree."""
    return [reduce(_two, same) for same in zip(*several, strict=True)]


def _two(one: TreeCounts, other: TreeCounts) -> TreeCounts:
    return TreeCounts(
        one.counts + other.counts,
        np.minimum(one.least, other.least),
        np.maximum(one.most, other.most),
        [_split(*both) for both in zip(one.splits, other.splits, strict=True)],
        _merged(np.concatenate([one.held_out, other.held_out], axis=1)),
    )


def _split(one: Splits | None, other: Splits | None) -> Splits | None:
    if one is None or other is None:
        return one or other
    return Splits(
        one.thresholds,
        np.maximum(one.below, other.below),
        np.minimum(one.above, other.above),
        one.binary and other.binary,
    )


def _merged(held_out: Integers) -> Integers:
    """Rows of one leaf, episode and label added up."""
    order = np.argsort(held_out[0], kind="stable")
    key, samples = held_out[:, order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    return np.stack([key[first], np.add.reduceat(samples, first) if len(first) else samples])


def at_nodes(
    structure: TreeStructure,
    values: NDArray[np.float32],
    better: Callable[[NDArray[np.float32], NDArray[np.float32]], NDArray[np.float32]],
    levels: Sequence[Integers],
) -> NDArray[np.float32]:
    """What leaves have, at the nodes above them.

    Args:
        structure: Of n nodes.
        values: At leaves, (n, d).
        better: Of two, as `numpy.minimum`.
        levels: The nodes of each depth, the root first.

    Returns:
        Shape (n, d).
    """
    values = values.copy()
    left, right = structure.children_left, structure.children_right
    for level in reversed(levels):
        inner = level[left[level] != LEAF]
        values[inner] = better(values[left[inner]], values[right[inner]])
    return values
