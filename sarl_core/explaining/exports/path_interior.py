"""States on the way to a query whose conditions ask about combinations of features.

Conditions on observed features and on combinations are half-spaces, so a state on the query's
border that fulfils all of them, as far from their borders as may be, is a linear program. What a
formula asks is then looked for along rays from there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.derived import Combination, Definition
from sarl_core.mining.rules import Condition

_FAR = 4.0  # times the largest number in sight: how far a state may lie
_FAREST = 1e12  # beyond, programs are solved no more
_NEAR_TYPICAL = 1e-3  # how much it counts that a state is like a typical one
_PLACES = 8  # on a border
_RAYS, _ROUNDS = 512, 4
_SHORTEST = 1e-6  # part of the way to the border

Fulfilled = Callable[[NDArray[np.float32]], NDArray[np.int64]]


class PathInterior:
    """The half-spaces of one rule set."""

    def __init__(self, definitions: Sequence[Definition], typical: NDArray[np.float32]) -> None:
        """Take in what is asked about.

        Args:
            definitions: Of the derived features, which stand behind the d observed ones.
            typical: A state that others are to be like, (d,).
        """
        self._definitions = definitions
        self._typical = typical.astype(np.float64)

    def states(
        self,
        path: Sequence[Condition],
        query: Condition,
        fulfilled: Fulfilled,
        rng: np.random.Generator,
    ) -> NDArray[np.float32]:
        """States that fulfil the conditions of a path, on either side of a query behind it.

        Args:
            path: The conditions.
            query: Asked where they hold.
            fulfilled: How many of the conditions states fulfil, (B,); the more, the better.
            rng: Where chance comes from.

        Returns:
            Shape (B, d); none where no state fulfils what is no formula.
        """
        largest = max([*np.abs(self._typical).tolist(), *(abs(one[2]) for one in [*path, query])])
        nothing = np.empty((0, len(self._typical)), dtype=np.float32)
        if not largest < _FAREST:
            return nothing
        far = _FAR * (1.0 + largest)
        rows, limits = self._half_spaces(path)
        normal = self._normal(query.feature)
        middle = self._centre(rows, limits, normal, query.threshold, far)
        if middle is None:
            return nothing
        centre, radius = middle
        if normal is not None:
            unit = normal / np.linalg.norm(normal)
            along = rng.normal(size=(_PLACES, len(unit)))
            along -= np.outer(along @ unit, unit)
            along *= 0.5 * radius / (np.linalg.norm(along, axis=1)[:, None] + 1e-300)
            places = np.concatenate([centre[None], centre + along])
            step = 0.5 * radius * unit
            both = np.concatenate([places - step, places + step]).astype(np.float32)
            whole = fulfilled(both) == len(path)
            if whole.any():
                return np.asarray(both[whole])
        return self._along_rays(centre, rows, limits, far, fulfilled, rng)

    def _normal(self, feature: int) -> NDArray[np.float64] | None:
        """What a feature is a sum of, by its coefficients, (d,); None for a formula."""
        d = len(self._typical)
        normal = np.zeros(d)
        if feature < d:
            normal[feature] = 1.0
            return normal
        definition = self._definitions[feature - d]
        if not isinstance(definition, Combination):
            return None
        for place, coefficient in definition.terms:
            normal[place] = coefficient
        return normal

    def _half_spaces(
        self, path: Sequence[Condition]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The conditions that are no formulas: at most so much, (n, d) and (n,)."""
        rows, limits = [], []
        for feature, op, threshold in path:
            normal = self._normal(feature)
            if normal is not None:
                sign = 1.0 if op == "<=" else -1.0
                rows.append(sign * normal)
                limits.append(sign * threshold)
        return np.array(rows).reshape(len(rows), len(self._typical)), np.array(limits)

    def _centre(
        self,
        rows: NDArray[np.float64],
        limits: NDArray[np.float64],
        normal: NDArray[np.float64] | None,
        threshold: float,
        far: float,
    ) -> tuple[NDArray[np.float64], float] | None:
        """A state on the border, and how far it lies from all others; None where there is none."""
        from scipy.optimize import linprog

        # What is looked for: how far it is from the borders, and what it has more and less in each
        # feature than the typical state.
        d, typical = len(self._typical), self._typical
        norms = np.linalg.norm(rows, axis=1)[:, None]
        solved = linprog(
            np.concatenate([[-1.0], np.full(2 * d, _NEAR_TYPICAL / d)]),
            A_ub=np.hstack([norms, rows, -rows]) if len(rows) else None,
            b_ub=limits - rows @ typical if len(rows) else None,
            A_eq=None if normal is None else np.concatenate([[0.0], normal, -normal])[None],
            b_eq=None if normal is None else [threshold - normal @ typical],
            bounds=[(0.0, 1.0), *[(0.0, far)] * (2 * d)],
            method="highs",
        )
        if not solved.success or not solved.x[0] > 0.0:
            return None
        more, less = solved.x[1:].reshape(2, d)
        return typical + more - less, float(solved.x[0])

    def _along_rays(
        self,
        centre: NDArray[np.float64],
        rows: NDArray[np.float64],
        limits: NDArray[np.float64],
        far: float,
        fulfilled: Fulfilled,
        rng: np.random.Generator,
    ) -> NDArray[np.float32]:
        """States around one, within the half-spaces, and around the best of those, and so on."""
        result = []
        for _ in range(_ROUNDS):
            ways = rng.normal(size=(_RAYS, len(centre)))
            ways /= np.linalg.norm(ways, axis=1)[:, None]
            reach = np.full(_RAYS, far)
            towards = ways @ rows.T
            with np.errstate(divide="ignore", invalid="ignore"):
                room = np.maximum(limits - rows @ centre, 0.0) / towards
            room[towards <= 0.0] = far
            reach = np.minimum(reach, room.min(axis=1, initial=far))
            lengths = reach * _SHORTEST ** rng.random(_RAYS)
            states = (centre + lengths[:, None] * ways).astype(np.float32)
            result.append(states)
            centre = states[int(np.argmax(fulfilled(states)))].astype(np.float64)
        return np.concatenate(result)
