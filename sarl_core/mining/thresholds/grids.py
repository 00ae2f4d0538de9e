"""Sums over rectangles in a threshold plane, for every cell of a grid at once.

Whatever is a rule at (s, c) exactly when s lies at or below one number, and c between two others,
adds to the cells of a rectangle that begins at support 0. Entered at its corners, all of them are
summed in one pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.errors import InputError
from sarl_core.mining.tree import PolicyTree, several_trees

Floats = NDArray[np.float64]


class Places(NamedTuple):
    """Where on the grid k nodes are rules: cells of a plane that is one column wider than it.

    Attributes:
        node: Node numbers, (k,).
        enters: Cell of the largest support from which on the node counts, (k,).
        leaves: Cell from which on it does no longer, (k,).
    """

    node: NDArray[np.int64]
    enters: NDArray[np.int64]
    leaves: NDArray[np.int64]


def drawn_trees(trees: PolicyTree | Sequence[PolicyTree]) -> tuple[PolicyTree, ...]:
    """The trees that a landscape is drawn of.

    Args:
        trees: One an action dimension, or a single one.

    Raises:
        InputError: If there is none.
    """
    trees = several_trees(
        trees,
        "what a landscape is drawn of must be trees",
        "grow them: grow_policy_trees(demonstrations)",
    )
    if not trees:
        raise InputError("there is no tree to draw a landscape of; grow the trees first")
    return trees


def grid_axis(values: ArrayLike, name: str) -> Floats:
    """The thresholds of one axis of a grid.

    Args:
        values: Ascending, 0 to 1.
        name: What they are, for errors.

    Returns:
        The same, (S,).

    Raises:
        InputError: If there is none, or they are not ascending, or not from 0 to 1.
    """
    try:
        axis = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        axis = np.zeros(0)
    usable = axis.ndim == 1 and len(axis) > 0 and np.isfinite(axis).all()
    if not usable or (np.diff(axis) <= 0).any():
        raise InputError(f"the {name} of a landscape must be finite numbers in ascending order")
    if axis[0] < 0.0 or axis[-1] > 1.0:
        raise InputError(
            f"the {name} of a landscape go from {axis[0]:g} to {axis[-1]:g}; "
            "give shares from 0 to 1"
        )
    return axis


def places_of(
    node: NDArray[np.int64],
    rows: NDArray[np.int64],
    first: NDArray[np.int64],
    last: NDArray[np.int64],
    columns: int,
) -> Places:
    """The rectangles in which some cell lies.

    Args:
        node: Node numbers, (k,).
        rows: How many of the S supports each reaches, from the lowest, (k,).
        first: Its first column, (k,).
        last: The column after its last, (k,).
        columns: C.

    Returns:
        Where they enter and leave a plane of (S, C + 1) cells.
    """
    inside = (rows > 0) & (first < last)
    row = (rows[inside] - 1) * (columns + 1)  # room for those that reach the right edge
    return Places(node[inside], row + first[inside], row + last[inside])


def rectangle_sums(
    places: Places, weights: Sequence[NDArray[np.int64]], shape: tuple[int, int]
) -> NDArray[np.int64]:
    """What the rectangles add up to in every cell.

    Args:
        places: Of k rectangles.
        weights: What each of them adds, W of (k,).
        shape: S and C.

    Returns:
        Shape (W, S, C).
    """
    planes = np.zeros((len(weights), shape[0], shape[1] + 1), dtype=np.int64)
    for plane, weight in zip(planes.reshape(len(weights), -1), weights, strict=True):
        np.add.at(plane, places.enters, weight)
        np.subtract.at(plane, places.leaves, weight)
    return summed(planes)


def summed(planes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Sum what enters and leaves over the last two axes.

    Args:
        planes: Shape (..., S, C + 1); overwritten.

    Returns:
        Shape (..., S, C).
    """
    # Along confidence from the left; along support from the largest downwards, because every
    # rectangle begins at support 0. In place: fresh memory is what would cost the time.
    np.cumsum(planes, axis=-1, out=planes)
    from_top = planes[..., ::-1, :]
    np.cumsum(from_top, axis=-2, out=from_top)
    return planes[..., :-1]
