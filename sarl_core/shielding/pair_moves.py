"""The least move of two features after which linear conditions hold."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_ROUNDING = 1e-9  # part of what is compared that rounding may take


class PairMoves(NamedTuple):
    """The least move of each of P pairs of features.

    Attributes:
        by: How far each of the two goes, (P, 2).
        distance: Sum of both in units of their spreads, (P,); inf where no move does.
        alone: Whether one of the two could do it alone, perhaps by going further, (P,).
    """

    by: Floats
    distance: Floats
    alone: NDArray[np.bool_]


def pair_moves(
    normals: Floats, room: Floats, pairs: NDArray[np.int64], spreads: Floats
) -> PairMoves:
    """Move pairs of features as little as possible.

    The conditions are half-planes of the two features, and the least sum of both ways lies where
    the borders of two of them meet, or one meets a line along which only one feature moves.

    Args:
        normals: What each of n conditions uses up where a feature grows by 1, (n, d).
        room: What is left of it now, (n,); below 0 where it does not hold.
        pairs: Indices of the features, (P, 2).
        spreads: What a change of each feature is measured in, (d,), above 0.

    Returns:
        The moves.
    """
    one, other = normals[:, pairs[:, 0]].T, normals[:, pairs[:, 1]].T  # (P, n)
    fixed = np.zeros((len(pairs), 1))
    lines = (
        np.concatenate([one, fixed + 1, fixed], axis=1),
        np.concatenate([other, fixed, fixed + 1], axis=1),
        np.concatenate([room, [0.0, 0.0]]),
    )
    first, second = np.triu_indices(lines[0].shape[1], 1)
    a, b, c = (part[..., first] for part in lines)
    d, e, f = (part[..., second] for part in lines)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        determinant = a * e - d * b
        by = np.stack([(c * e - f * b) / determinant, (a * f - d * c) / determinant], axis=-1)
        parts = one[:, None] * by[..., :1], other[:, None] * by[..., 1:]
        rounding = _ROUNDING * (np.abs(parts[0]) + np.abs(parts[1]) + np.abs(room))
        holds = (parts[0] + parts[1] <= room + rounding).all(axis=2)
        distance = (np.abs(by) / spreads[pairs][:, None]).sum(axis=2)
    distance[~holds | ~np.isfinite(distance)] = np.inf
    alone = (np.isfinite(distance) & (by == 0.0).any(axis=2)).any(axis=1)
    best = distance.argmin(axis=1)
    rows = np.arange(len(pairs))
    return PairMoves(by[rows, best], distance[rows, best], alone)
