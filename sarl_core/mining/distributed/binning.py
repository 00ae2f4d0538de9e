"""The second pass: the rows of a piece as numbers of bins, which stay where they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.distributed.histograms import BinnedRows
from sarl_core.mining.distributed.pieces import Piece, Reading, read_piece
from sarl_core.mining.distributed.survey import Placement
from sarl_core.mining.labels import label_dimensions


def bin_piece(
    piece: Piece,
    reading: Reading,
    placement: Placement,
    borders: Sequence[NDArray[np.float64]],
    divider: int,
) -> BinnedRows:
    """Read a piece as numbers of bins.

    Args:
        piece: To read.
        reading: How.
        placement: What all pieces have in common; what it holds out is left out.
        borders: For each feature what lies between two bins, ascending.
        divider: Number of intervals of continuous dimensions.

    Returns:
        Those that are mined from.
    """
    given = read_piece(piece, reading)
    assert given is not None  # others were left out when they were surveyed
    rows = placement.placed(given.steps, piece.file)
    mined = given.real & ~np.isin(rows.episodes, placement.held_out)
    states, actions = rows.observations[mined], rows.action_columns[mined]
    bins = np.empty(states.shape[::-1], dtype=np.uint16)
    for feature, own in enumerate(borders):
        # As a tree compares: float32 with float64; what is no number is at most no border.
        bins[feature] = np.searchsorted(own, states[:, feature].astype(np.float64))
    labels = np.stack(
        [
            dimension.labels_of(actions[:, index])
            for index, dimension in enumerate(label_dimensions(rows, divider))
        ]
    )
    return BinnedRows(bins, labels.astype(np.uint16))


def label_counts(rows: BinnedRows, labels: int) -> NDArray[np.int64]:
    """Rows of each label in each action dimension, (m, labels)."""
    return np.stack([np.bincount(column, minlength=labels) for column in rows.labels])


def bin_counts(rows: BinnedRows, bins: int) -> NDArray[np.int64]:
    """Rows in each bin of each feature, (d, bins)."""
    return np.stack([np.bincount(column, minlength=bins) for column in rows.bins])
