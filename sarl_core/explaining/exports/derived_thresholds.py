"""States whose derived features lie at a threshold and one float32 step beside it.

What is derived follows from several features at once, so such a state has to be looked for: among
states on the way to the query (`PathInterior`; where there are none, among any), two on either side
of the threshold are drawn together until they differ by one step of one feature. Of a combination
both features are then moved by a few steps, which reaches the threshold itself and its neighbours
wherever there are float32 numbers for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Feature, observed_features
from sarl_core.demonstrations.derived import Extension
from sarl_core.explaining.exports.path_interior import PathInterior
from sarl_core.explaining.exports.program import largest_float32
from sarl_core.mining.rules import Condition
from sarl_core.shielding.crossings import numbers_at, places_of

_DRAWN = 256  # states that are looked at for one query
_PAIRS = 8  # of them, near which there may be states just at the threshold
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
        self._interior = PathInterior(self._extension.definitions, typical)

    def states(
        self,
        path: Sequence[Condition],
        query: Condition,
        rest: Sequence[Condition],
        rng: np.random.Generator,
    ) -> list[NDArray[np.float32]]:
        """States at a query.

        Args:
            path: The conditions on the way to it.
            query: That the feature is at most the threshold.
            rest: The conditions from there to a rule.
            rng: Where chance comes from.

        Returns:
            States on either side of the threshold, as near to it as there are; of those the ones
            first that fulfil the most conditions. Shape (d,) each.
        """
        threshold = float(query.threshold)
        whole = (*path, *rest)
        at = largest_float32(threshold)
        with np.errstate(over="ignore"):
            wanted = [at, *(np.nextafter(at, np.float32(side)) for side in (-np.inf, np.inf))]
        result: list[NDArray[np.float32]] = []
        for drawn in self._candidates(path, query, rest, rng):
            values = self._extension.many(drawn)[:, query.feature]
            order = np.argsort(-self._fulfilled(drawn, whole), kind="stable").tolist()
            below = [drawn[row] for row in order if values[row] <= threshold]
            above = [drawn[row] for row in order if values[row] > threshold]
            for one, other in zip(below[:_PAIRS], above[:_PAIRS], strict=False):
                pair = self._drawn_together(one, other, query)
                near = np.array([*pair, *self._around(pair[0], query)])
                fulfils = self._fulfilled(near, whole)
                near_values = self._extension.many(near)[:, query.feature]
                result += [] if result else pair
                for number in tuple(wanted):
                    same = np.flatnonzero(near_values == number)
                    if len(same):
                        result.append(near[int(same[np.argmax(fulfils[same])])])
                        wanted.remove(number)
                if not wanted:
                    return result
        return result or (below + above)[:1]

    def _candidates(
        self,
        path: Sequence[Condition],
        query: Condition,
        rest: Sequence[Condition],
        rng: np.random.Generator,
    ) -> Iterator[NDArray[np.float32]]:
        """States that fulfil all conditions, those on the way to the query, and any."""
        for conditions in dict.fromkeys(((*path, *rest), tuple(path))):
            fulfilled = partial(self._fulfilled, path=conditions)
            yield self._interior.states(conditions, query, fulfilled, rng)
        yield self._drawn(path, query, rng)

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
