"""Where a derived feature passes a threshold while one feature of a state is moved.

All float32 numbers stand in one order without gaps, in which a place is halved until the two
numbers beside it are neighbours: the answer is exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.derived import Combination, Definition

States = NDArray[np.float32]

_LAST = int(np.array(np.finfo(np.float32).max).view(np.int32))
_HALVINGS = 33  # of the way between two float32 numbers
_LOOKED_AT = 2_049  # numbers between which a formula may pass a threshold; it may turn anywhere


def places_of(values: States) -> NDArray[np.int64]:
    """Whole numbers in the order of float32 ones, without gaps.

    Args:
        values: Finite, any shape.

    Returns:
        Likewise; 0 for zero.
    """
    bits = np.ascontiguousarray(values, dtype=np.float32).view(np.int32).astype(np.int64)
    return np.where(bits < 0, -(bits & 0x7FFFFFFF), bits)


def numbers_at(places: NDArray[np.int64]) -> States:
    """The float32 numbers at places of that order."""
    values = np.abs(places).astype(np.int32).view(np.float32)
    return np.where(places < 0, -values, values)


def crossings(
    definition: Definition, state: States, feature: int, bounds: NDArray[np.float32]
) -> States:
    """Where a derived feature goes from below a bound to at least it, or back.

    Args:
        definition: Of the derived feature.
        state: Shape (d,), finite.
        feature: Which of the d is moved.
        bounds: Shape (k,); those that are not finite are never passed.

    Returns:
        Values of the feature, in no order: from each of them on the derived feature is on another
        side of a bound than just below it. Of a combination all there are; of a formula those that
        lie between two of some 2,000 numbers on different sides.
    """
    bounds = np.unique(bounds[np.isfinite(bounds)])
    if not len(bounds) or feature not in definition.features:
        return np.zeros(0, dtype=np.float32)
    count = 2 if isinstance(definition, Combination) else _LOOKED_AT
    grid = np.linspace(-_LAST, _LAST, count).astype(np.int64)
    reached = _values(definition, state, feature, grid)[None] >= bounds[:, None]
    rows, columns = np.nonzero(reached[:, 1:] != reached[:, :-1])
    below, above, bound = grid[columns], grid[columns + 1], bounds[rows]
    side = reached[rows, columns + 1]
    for _ in range(_HALVINGS):
        between = (below + above) // 2
        passed = (_values(definition, state, feature, between) >= bound) == side
        above = np.where(passed, between, above)
        below = np.where(passed, below, between)
    return numbers_at(np.unique(above))


def _values(
    definition: Definition, state: States, feature: int, places: NDArray[np.int64]
) -> States:
    """The derived feature where another one is at these places, (B,)."""
    states = np.repeat(state[None], len(places), axis=0)
    states[:, feature] = numbers_at(places)
    with np.errstate(all="ignore"):
        return definition.values(states).astype(np.float32)
