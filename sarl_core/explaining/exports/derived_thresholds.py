"""States whose derived features lie at a threshold and one float32 step beside it.

What is derived follows from several features at once, so such a state has to be looked for: among
states that are led along the way to the query as well as may be, two on either side of the
threshold are drawn together until they differ by one step of one feature. Of a combination both
features are then moved by a few steps, which reaches the threshold itself and its neighbours
wherever there are float32 numbers for it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Feature, observed_features
from sarl_core.demonstrations.derived import Extension
from sarl_core.explaining.exports.program import largest_float32
from sarl_core.mining.rules import Condition
from sarl_core.shielding.crossings import numbers_at, places_of

_DRAWN = 256  # states that are looked at for one query
_STEPS = np.arange(-24, 25)  # of float32, by which each feature of a combination is moved
_HALVINGS = 64  # of the way between two float32 numbers, which lie at most 2^32 steps apart


class DerivedThresholds:
    """Where derived features lie at thresholds."""

    def __init__(self, features: Sequence[Feature], typical: NDArray[np.float32]) -> None:
        """Take in what is derived.

        Args:
            features: d observed ones, and derived ones behind them.
            typical: A state to begin with, (d,).
        """
        self._width = len(observed_features(features))
        self._extension = Extension.of(features)
        self._typical = typical

    def states(
        self, path: Sequence[Condition], query: Condition, rng: np.random.Generator
    ) -> list[NDArray[np.float32]]:
        """States at a query.

        Args:
            path: The conditions on the way to it.
            query: That the feature is at most the threshold.
            rng: Where chance comes from.

        Returns:
            States on either side of the threshold, as near to it as there are; of those the ones
            first that fulfil the most conditions of the path. Shape (d,) each.
        """
        drawn = self._drawn(path, query, rng)
        fulfilled = self._fulfilled(drawn, path)
        values = self._extension.many(drawn)[:, query.feature]
        threshold = float(query.threshold)
        order = np.argsort(-fulfilled, kind="stable")
        below = [row for row in order.tolist() if values[row] <= threshold]
        above = [row for row in order.tolist() if values[row] > threshold]
        if not below or not above:
            return [drawn[int(order[0])]]
        pair = self._drawn_together(drawn[below[0]], drawn[above[0]], query)
        near = np.array([*pair, *self._around(pair[0], query)])
        values = self._extension.many(near)[:, query.feature]
        at = largest_float32(threshold)
        with np.errstate(over="ignore"):
            wanted = [np.nextafter(at, np.float32(side)) for side in (-np.inf, np.inf)]
        fulfilled = self._fulfilled(near, path)
        rows = [0, 1]
        for number in (wanted[0], at, wanted[1]):
            same = np.flatnonzero(values == number)
            if len(same):
                rows.append(int(same[np.argmax(fulfilled[same])]))
        return [near[row] for row in dict.fromkeys(rows)]

    def _drawn(
        self, path: Sequence[Condition], query: Condition, rng: np.random.Generator
    ) -> NDArray[np.float32]:
        """States around the thresholds of the features that were observed, (B, d)."""
        low = np.full(self._width, -np.inf)
        high = np.full(self._width, np.inf)
        for feature, op, threshold in path:
            if feature < self._width:
                if op == "<=":
                    high[feature] = min(high[feature], threshold)
                else:
                    low[feature] = max(low[feature], threshold)
        reach = 2.0 * (1.0 + np.abs(self._typical.astype(np.float64)) + abs(query.threshold))
        centre = self._typical.astype(np.float64)
        least = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, centre) - reach)
        most = np.where(np.isfinite(high), high, np.where(np.isfinite(low), low, centre) + reach)
        share = rng.random((_DRAWN, self._width))
        drawn = least + (most - least) * share
        largest = float(np.finfo(np.float32).max) / 4
        return np.clip(drawn, -largest, largest).astype(np.float32)

    def _fulfilled(
        self, states: NDArray[np.float32], path: Sequence[Condition]
    ) -> NDArray[np.int64]:
        """How many conditions each state fulfils before the first that it does not, (B,)."""
        values = self._extension.many(states)
        still = np.ones(len(states), dtype=np.bool_)
        count = np.zeros(len(states), dtype=np.int64)
        for feature, op, threshold in path:
            column = values[:, feature]
            still &= column <= np.float64(threshold) if op == "<=" else column > threshold
            count += still
        return count

    def _drawn_together(
        self, below: NDArray[np.float32], above: NDArray[np.float32], query: Condition
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Two states on either side of the threshold that differ by one step of one feature."""
        for feature in range(self._width):
            between = below.copy()
            between[feature] = above[feature]
            if not self._is_below(between, query):
                above = between
                break
            below = between
        for _ in range(_HALVINGS):
            first, last = (int(places_of(one[[feature]])[0]) for one in (below, above))
            if abs(last - first) <= 1:
                break
            between = below.copy()
            between[feature] = numbers_at(np.array([(first + last) // 2]))[0]
            if self._is_below(between, query):
                below = between
            else:
                above = between
        return below, above

    def _is_below(self, state: NDArray[np.float32], query: Condition) -> bool:
        value = self._extension.many(state[None])[0, query.feature]
        return bool(value <= np.float64(query.threshold))

    def _around(self, state: NDArray[np.float32], query: Condition) -> list[NDArray[np.float32]]:
        """States a few steps away in the features that the query is derived from."""
        if query.feature < self._width:
            moved = [query.feature]
        else:
            moved = list(self._extension.definitions[query.feature - self._width].features[:2])
        places = np.stack(np.meshgrid(*[_STEPS] * len(moved), indexing="ij"), -1)
        states = np.repeat(state[None], places[..., 0].size, axis=0)
        for column, feature in enumerate(moved):
            steps = places[..., column].reshape(-1) + places_of(state[[feature]])[0]
            states[:, feature] = numbers_at(steps)
        return list(states[np.isfinite(states).all(axis=1)])
