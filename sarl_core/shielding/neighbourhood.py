"""What lies near a state: rules that almost apply, and where the shield would decide otherwise.

Everything here is exact to the float32 number, but that two features that are moved for a
combination may go a few numbers too far. Along one feature the shield's decision can change only at
a threshold or at the edge of a data box of a rule whose other conditions hold; so it is asked once
between each two of them, and nothing is sampled.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.demonstrations.derived import Combination, Extension
from sarl_core.demonstrations.words import columns_of_words
from sarl_core.errors import InputError
from sarl_core.mining.rule_order import without_idle
from sarl_core.shielding.crossings import crossings, numbers_at, places_of
from sarl_core.shielding.pair_moves import pair_moves
from sarl_core.shielding.shield import BatchDecision, Shield

Floats = NDArray[np.float64]
States = NDArray[np.float32]

_LARGEST = np.finfo(np.float32).max
_DOWN, _UP = np.float32(-np.inf), np.float32(np.inf)
_STEPS = np.arange(-3, 4)  # of float32
_SPARE = 1e-6  # part of what is compared that is kept clear of rounding


class FeatureChange(NamedTuple):
    """One feature moved as little as possible.

    Attributes:
        feature: Its index.
        before: The present value, a float32 number.
        after: The nearest float32 number that does.
    """

    feature: int
    before: float
    after: float

    @property
    def by(self) -> float:
        """How far, with its sign."""
        return self.after - self.before


class NearMiss(NamedTuple):
    """A rule that does not apply, and what is missing.

    Attributes:
        rule: Its index in the rule set.
        changes: Of one feature or two, the least of each that lets its conditions hold.
        distance: Sum of the changes, each in units of its feature's spread.
        in_force: Whether it would then be the rule in force; else one placed before it is.
    """

    rule: int
    changes: tuple[FeatureChange, ...]
    distance: float
    in_force: bool


@dataclass(frozen=True, eq=False)
class FeatureLine:
    """What the shield does along one feature, all others as they are.

    Attributes:
        feature: Its index.
        starts: First value of each of k stretches, ascending float32 numbers, (k,); the first
            is -inf. Within a stretch nothing changes.
        decisions: What the shield does in each, k of them.
        here: The stretch that the present value lies in.
    """

    feature: int
    starts: States
    decisions: BatchDecision
    here: int


class DecisionChange(NamedTuple):
    """The least change of one feature that makes the shield execute another action.

    Attributes:
        change: The feature, and how far.
        executed: The action then, (m,).
        rules: The rules then in force, -1 for none, (m,).
        distance: The change in units of the feature's spread.
    """

    change: FeatureChange
    executed: NDArray[Any]
    rules: NDArray[np.int64]
    distance: float


class Neighbourhood:
    """The rules that a shield uses, laid out for questions about single states."""

    def __init__(self, shield: Shield) -> None:
        """Lay out the bounds of R enabled rules over d features.

        Args:
            shield: In force.
        """
        self.shield = shield
        used = without_idle(shield.rule_set)
        rules, features = used.rules, used.source.features
        self._extension = Extension.of(features)
        self._wide = (self._extension.width, len(shield.rule_set.source.features))
        d = len(features)
        self._index = np.array(
            [index for index, rule in enumerate(rules) if rule.enabled], dtype=np.int64
        )
        low: Floats = np.full((len(self._index), d), -np.inf)
        high: Floats = np.full((len(self._index), d), np.inf)
        least, most = low.copy(), high.copy()
        for row, index in enumerate(self._index.tolist()):
            rule = rules[index]
            for feature, below, above in rule.bounds:
                low[row, feature], high[row, feature] = below, above
            if rule.box is not None:
                least[row], most[row] = rule.box.least, rule.box.most
        # In float32 numbers a rule asks for first <= x <= last.
        self._first, self._last = after(low), at_most(high)
        # Where its data begins, and what comes after the last of it.
        self._begin, self._beyond = at_least(least), after(most)
        columns = columns_of_words([one.indicator for one in features])
        self._words = [np.array(places) for places in columns.values() if len(places) > 1]
        self._lay_out_pairs()

    def _lay_out_pairs(self) -> None:
        """What pairs of features move, and how far what is derived moves with each."""
        width, definitions = self._extension.width, self._extension.definitions
        of_words = {place for places in self._words for place in places.tolist()}
        free = [feature for feature in range(width) if feature not in of_words]
        pairs = list(combinations(free, 2)) if definitions else []
        self._pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)
        self._normals = np.concatenate([np.eye(width), np.zeros((len(definitions), width))])
        self._linear = np.ones(len(self._normals), dtype=np.bool_)
        for place, definition in enumerate(definitions, start=width):
            self._linear[place] = isinstance(definition, Combination)
            if isinstance(definition, Combination):
                for feature, coefficient in definition.terms:
                    self._normals[place, feature] = coefficient
        # Columns that a feature, or a pair, leaves as they are; a pair is not looked for that would
        # have to bring about what a formula asks.
        moving = self._normals != 0.0
        self._unmoved_by_pairs = ~(moving[:, self._pairs[:, 0]] | moving[:, self._pairs[:, 1]])
        self._unmoved = np.ones((len(moving), width), dtype=np.bool_)
        for feature in free:
            self._unmoved[self._moving(feature), feature] = False

    def near_misses(
        self, state: ArrayLike, spreads: Floats, *, features: int = 1, most: int = 8
    ) -> tuple[NearMiss, ...]:
        """Rules that would apply if few features were a little different.

        What is derived changes with the features that are observed; those are moved. A rule that
        lacks something derived is said once for each feature that could bring it about alone, and
        with the nearest two where none could. Two are not looked for that would have to bring
        about what a formula asks.

        Args:
            state: Shape (d,); finite, taken as float32.
            spreads: What a change of each observed feature is measured in, (d,), above 0.
            features: How many features have to change, 1 or 2.
            most: How many at most.

        Returns:
            The nearest first.

        Raises:
            InputError: If the state has another length, or a value is not finite.
        """
        here = self._state(state)
        if self._extension.definitions:
            return self._derived_misses(here, spreads[: len(here)], features, most)
        return self._observed_misses(here, spreads, features, most)

    def _observed_misses(
        self, here: States, spreads: Floats, features: int, most: int
    ) -> tuple[NearMiss, ...]:
        """The same where nothing is derived: each feature moves alone."""
        wanted = np.clip(here, self._first, self._last)
        # A bound that no finite number reaches makes a rule that never applies.
        possible = (self._first <= self._last).all(axis=1) & np.isfinite(wanted).all(axis=1)
        differs = wanted != here
        for places in self._words:
            possible &= self._other_word(here, places, wanted, differs)
        rows = np.flatnonzero(possible & (differs.sum(axis=1) == features))
        moved = np.abs(wanted[rows].astype(np.float64) - here.astype(np.float64)) / spreads
        moved[~differs[rows]] = 0.0  # of words one feature tells of all
        distances = moved.sum(axis=1)
        nearest = np.argsort(distances, kind="stable")[:most]
        rows, distances = rows[nearest], distances[nearest]
        # The same states that the rules ask for, and not the rules' word for it.
        in_force = self.shield.rules_in_force(wanted[rows])
        return tuple(
            NearMiss(
                rule=int(self._index[row]),
                changes=tuple(
                    FeatureChange(feature, float(here[feature]), float(wanted[row, feature]))
                    for feature in np.flatnonzero(differs[row]).tolist()
                ),
                distance=float(distance),
                in_force=bool((at == self._index[row]).any()),
            )
            for row, distance, at in zip(rows.tolist(), distances.tolist(), in_force, strict=True)
        )

    def _derived_misses(
        self, here: States, spreads: Floats, features: int, most: int
    ) -> tuple[NearMiss, ...]:
        """The same where features move what is derived from them."""
        whole = self._extension.many(here[None])[0]
        broken = ~((self._first <= whole) & (whole <= self._last))
        misses: list[NearMiss] = []
        # Whoever moves has to move all that a rule lacks.
        ways = ~(broken @ (self._unmoved if features == 1 else self._unmoved_by_pairs))
        for row in np.flatnonzero(broken.any(axis=1) & ways.any(axis=1)).tolist():
            movers = np.flatnonzero(ways[row])
            wanted = (
                self._one_moved(here, row, movers)
                if features == 1
                else self._two_moved(here, row, self._pairs[movers], spreads)
            )
            for state in wanted:
                moved = np.flatnonzero(state != here)
                way = np.abs(state[moved].astype(np.float64) - here[moved].astype(np.float64))
                in_force = self.shield.rules_in_force(state[None])[0] == self._index[row]
                misses.append(
                    NearMiss(
                        int(self._index[row]),
                        tuple(
                            FeatureChange(at, float(here[at]), float(state[at]))
                            for at in moved.tolist()
                        ),
                        float((way / spreads[moved]).sum()),
                        bool(in_force.any()),
                    )
                )
        return tuple(sorted(misses, key=lambda miss: miss.distance)[:most])

    def _one_moved(self, here: States, row: int, movers: NDArray[np.int64]) -> Iterator[States]:
        """For each feature that alone can let a rule apply, the nearest state in which it does."""
        for feature in movers.tolist():
            edges = self._edges(here, feature, np.array([row]), boxes=False)
            values = np.concatenate([edges, np.nextafter(edges, _DOWN)])
            states = np.repeat(here[None], len(values), axis=0)
            states[:, feature] = values
            states = states[np.isfinite(values) & self._applies(states, row)]
            if len(states):
                way = np.abs(states[:, feature].astype(np.float64) - float(here[feature]))
                yield states[int(np.argmin(way))]

    def _two_moved(
        self, here: States, row: int, pairs: NDArray[np.int64], spreads: Floats
    ) -> Iterator[States]:
        """The nearest state in which a rule applies that no feature alone brings about."""
        first, last = (side[row].astype(np.float64) for side in (self._first, self._last))
        values = self._normals @ here.astype(np.float64)
        upper, lower = (np.isfinite(side) & self._linear for side in (last, first))
        normals = np.concatenate([self._normals[upper], -self._normals[lower]])
        room = np.concatenate([(last - values)[upper], (values - first)[lower]])
        moves = pair_moves(normals, room, pairs, spreads)
        if moves.alone.any():
            return
        pair = pairs[[int(moves.distance.argmin())]]
        # What is derived is rounded, so the state may lie a few float32 numbers further.
        for spare in (0.0, _SPARE):
            clear = spare * (np.abs(normals) @ np.abs(here) + np.abs(room))
            move = pair_moves(normals, room - clear, pair, spreads)
            if not np.isfinite(move.distance[0]):
                return
            states = self._around(here, pair[0], move.by[0])
            states = states[self._applies(states, row)]
            if len(states):
                way = np.abs(states.astype(np.float64) - here.astype(np.float64)) / spreads
                yield states[int(way.sum(axis=1).argmin())]
                return

    def _around(self, here: States, pair: NDArray[np.int64], by: Floats) -> States:
        """States with two features moved so far, or a few float32 numbers further or less."""
        moved = (here[pair].astype(np.float64) + by).astype(np.float32)
        steps = np.stack(np.meshgrid(_STEPS, _STEPS), axis=-1).reshape(-1, 2)
        states = np.repeat(here[None], len(steps), axis=0)
        states[:, pair] = numbers_at(places_of(moved) + steps)
        return np.asarray(states[np.isfinite(states).all(axis=1)])

    def _applies(self, states: States, row: int) -> NDArray[np.bool_]:
        """Whether a rule's conditions hold, (B,)."""
        values = self._extension.many(states)
        return np.asarray(((self._first[row] <= values) & (values <= self._last[row])).all(axis=1))

    def _moving(self, feature: int) -> list[int]:
        """A feature and what is derived from it, as columns."""
        derived = enumerate(self._extension.definitions, start=self._extension.width)
        return [feature, *(place for place, one in derived if feature in one.features)]

    def _edges(self, here: States, feature: int, rows: NDArray[np.int64], *, boxes: bool) -> States:
        """Where along a feature conditions of rules, or edges of their boxes, are passed."""
        edges = []
        for column in self._moving(feature):
            bounds = [self._first[rows, column], after(self._last[rows, column])]
            if boxes:
                bounds += [self._begin[rows, column], self._beyond[rows, column]]
            if column == feature:
                edges += bounds
            else:
                definition = self._extension.definitions[column - self._extension.width]
                edges.append(crossings(definition, here, feature, np.concatenate(bounds)))
        return _starts(*edges)[1:]

    def _other_word(
        self,
        here: States,
        places: NDArray[np.int64],
        wanted: States,
        differs: NDArray[np.bool_],
    ) -> NDArray[np.bool_]:
        """Let a column hold another word where rules ask for it: all its features move at once.

        Args:
            here: The state, (d,).
            places: The k features that say which word the column holds.
            wanted: What the rules ask for, (R, d); changed in place.
            differs: Which features that is told by, (R, d); of the column one. Likewise.

        Returns:
            Whether a word is as each rule asks, (R,).
        """
        words = np.eye(len(places), dtype=np.float32)
        first, last = self._first[:, None, places], self._last[:, None, places]
        fits: NDArray[np.bool_] = np.all((first <= words) & (words <= last), axis=2)
        lacks: NDArray[np.bool_] = np.any(differs[:, places], axis=1)
        word = fits.argmax(axis=1)
        wanted[:, places] = np.where(lacks[:, None], words[word], here[places])
        # Where any other word will do, it is the present one that is too much.
        changed = np.where(fits.sum(axis=1) == len(places) - 1, np.argmin(fits, axis=1), word)
        differs[:, places] = lacks[:, None] & (np.arange(len(places)) == changed[:, None])
        return np.asarray(fits.any(axis=1))

    def lines(self, state: ArrayLike, action: Any) -> tuple[FeatureLine, ...]:
        """What the shield would do along each feature that is observed.

        What is derived from a feature moves with it. Along a combination nothing is missed; along
        a formula what lies between two of some 2,000 numbers may be.

        A feature that says that a column holds one of three or more words has two stretches: the
        state as it is, and from 1 on the state in which the column holds that word.

        Args:
            state: Shape (d,); finite, taken as float32.
            action: What the agent proposes, in the environment's own form.

        Returns:
            One line a feature.

        Raises:
            InputError: If the state has another length, or a value is not finite.
        """
        here = self._state(state)
        whole = self._extension.many(here[None])[0]
        broken = ~((self._first <= whole) & (whole <= self._last))
        count = broken.sum(axis=1)
        starts, states = [], []
        of_words = {at: places for places in self._words for at in places.tolist()}
        for feature in range(len(here)):
            if feature in of_words:
                at = np.repeat(here[None], 2, axis=0)
                at[1, of_words[feature]] = 0.0
                at[1, feature] = 1.0
                starts.append(np.array([_DOWN, 1.0], dtype=np.float32))
                states.append(at)
                continue
            # Rules whose other conditions hold; no other can apply anywhere along the line.
            rows = np.flatnonzero(count == broken[:, self._moving(feature)].sum(axis=1))
            edges = _starts(self._edges(here, feature, rows, boxes=True))
            at = np.repeat(here[None], len(edges), axis=0)
            at[:, feature] = edges
            # Before the first start: any value below it, so the one just below.
            below = np.nextafter(edges[1], _DOWN) if len(edges) > 1 else here[feature]
            at[0, feature] = max(below, -_LARGEST)  # below that there is no state
            starts.append(edges)
            states.append(at)
        decided = self._decide(np.concatenate(states), action)
        ends = np.cumsum([len(part) for part in starts])
        return tuple(
            FeatureLine(
                feature=feature,
                starts=part,
                decisions=BatchDecision(
                    *(np.asarray(column)[end - len(part) : end] for column in decided)
                ),
                here=int(np.searchsorted(part, here[feature], side="right")) - 1,
            )
            for feature, (part, end) in enumerate(zip(starts, ends.tolist(), strict=True))
        )

    def _state(self, state: ArrayLike) -> States:
        here = np.asarray(state, dtype=np.float32)
        wide, whole = self._wide
        if here.shape == (whole,):
            here = here[:wide]
        if here.shape != (wide,) or not np.isfinite(here).all():
            raise InputError(
                f"the state is no list of {wide} finite numbers; give one for each feature"
            )
        return here

    def _decide(self, states: States, action: Any) -> BatchDecision:
        one = np.asarray(action)
        proposed = np.repeat(one.reshape(1, -1), len(states), axis=0)
        return self.shield.decide_batch(states, proposed)


def decision_changes(
    line: FeatureLine, value: float, spread: float
) -> tuple[DecisionChange | None, DecisionChange | None]:
    """The least change downwards and upwards that makes the shield execute another action.

    Args:
        line: Of the feature.
        value: Its present value.
        spread: What a change is measured in, above 0.

    Returns:
        Down and up; None where no change in that direction does.
    """
    executed = line.decisions.executed
    other = np.flatnonzero((executed != executed[line.here]).any(axis=1))
    below, above = other[other < line.here], other[other > line.here]

    def change(stretch: int, after: float) -> DecisionChange:
        return DecisionChange(
            FeatureChange(line.feature, float(np.float32(value)), after),
            executed[stretch],
            line.decisions.rules[stretch],
            abs(after - float(np.float32(value))) / spread,
        )

    down = up = None
    if len(below):
        stretch = int(below[-1])
        down = change(stretch, float(np.nextafter(line.starts[stretch + 1], _DOWN)))
    if len(above):
        up = change(int(above[0]), float(line.starts[above[0]]))
    return down, up


def feature_spreads(observations: NDArray[np.float32]) -> Floats:
    """What a change of each feature is measured in: its interquartile range.

    Args:
        observations: Shape (N, d); the infinite values of a formula do not count.

    Returns:
        Shape (d,), above 0: the range where half of the values are the same, as those of a
        contact are, and 1 where all are.
    """
    if not np.isfinite(observations).all():
        columns = (column[np.isfinite(column), None] for column in observations.T)
        return np.array([feature_spreads(one)[0] if len(one) else 1.0 for one in columns])
    # One after the other: all of them as float64, sorted, would take four times their memory.
    low, high = np.transpose(
        [np.quantile(column.astype(np.float64), [0.25, 0.75]) for column in observations.T]
    )
    wide = observations.max(axis=0).astype(np.float64) - observations.min(axis=0)
    spread = np.where(high > low, high - low, wide)
    return np.asarray(np.where(spread > 0, spread, 1.0))


def after(values: NDArray[Any]) -> States:
    """The least float32 number above each value.

    Args:
        values: float64 numbers, any shape.

    Returns:
        Likewise; inf where there is none, -inf for -inf.
    """
    near = _float32(values)
    with np.errstate(over="ignore"):  # the largest number stands for infinity in a box
        beyond = np.where(near > values, near, np.nextafter(near, _UP))
    return np.asarray(np.where(np.isneginf(values), _DOWN, beyond), dtype=np.float32)


def at_most(values: NDArray[Any]) -> States:
    """The largest float32 number that is no larger than each value; inf for inf."""
    near = _float32(values)
    with np.errstate(over="ignore"):
        return np.where(near > values, np.nextafter(near, _DOWN), near).astype(np.float32)


def at_least(values: NDArray[Any]) -> States:
    """The least float32 number that is no smaller than each value; -inf for -inf."""
    near = _float32(values)
    with np.errstate(over="ignore"):
        return np.where(near < values, np.nextafter(near, _UP), near).astype(np.float32)


def _float32(values: NDArray[Any]) -> States:
    with np.errstate(over="ignore"):
        return np.asarray(values).astype(np.float32)


def _starts(*edges: States) -> States:
    """Where something may change, ascending, with -inf at the front."""
    starts = np.unique(np.concatenate(edges))
    starts = starts[np.isfinite(starts)]
    return np.concatenate([np.array([_DOWN], dtype=np.float32), starts])
