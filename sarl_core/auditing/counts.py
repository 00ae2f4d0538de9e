"""What is counted of a log, episode by episode: little, and that of two parts is put together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.auditing.drift import by_episode
from sarl_core.auditing.feature_counts import beyond_counts, quarter_counts
from sarl_core.auditing.overlap import demanded, never_applications
from sarl_core.auditing.steps import HeldSteps
from sarl_core.mining.rule_order import without_idle
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.boxes import Boxes

Counts = NDArray[np.int64]
Floats = NDArray[np.float64]

_WORST = 10  # stretches that are told


class Stretch(NamedTuple):
    """Breaks one after the other, in one episode.

    Attributes:
        episode: What the episode is called.
        step: Of the first of them.
        row: Its row in the log, from 0.
        length: How many steps.
        seconds: How long they last; None where no time is known.
        rules: Places in the rule set of the rules that were broken, ascending.
    """

    episode: int
    step: int
    row: int
    length: int
    seconds: float | None
    rules: tuple[int, ...]


class Minute(NamedTuple):
    """The minute with the most breaks, in one episode.

    Attributes:
        episode: What the episode is called.
        step: Of the first of them.
        row: Its row in the log, from 0.
        breaks: How many.
    """

    episode: int
    step: int
    row: int
    breaks: int


class RuleEntries(NamedTuple):
    """Rules in episodes; K entries, where one is in force at all.

    A never-rule is in force wherever it applies and no rule demands an action of its dimension:
    beside others, and also where one of those is the one that is recorded.

    Attributes:
        episode: Place of the episode, from 0, ascending, (K,).
        rule: Place of the rule in the set, ascending within an episode, (K,).
        applied: Steps in which it is in force, at least 1, (K,).
        broken: Those of them that break it, (K,).
        outside: Those of these in states that its data do not reach, (K,).
    """

    episode: Counts
    rule: Counts
    applied: Counts
    broken: Counts
    outside: Counts


@dataclass(frozen=True, eq=False)
class LogCounts:
    """What is counted of E episodes, in the order of the log; arrays are read-only.

    Attributes:
        episodes: What they are called, (E,).
        steps: Their steps, (E,).
        covered: Steps in which some rule applies, (E,).
        broken: Steps in which some rule was broken, (E,).
        outside: Of these, those in states that the data of a broken rule do not reach, (E,).
        near: Near misses, (E,).
        free: Freedom that a shield leaves, added up over steps and action dimensions, (E,).
        longest_run: Steps of the longest stretch of breaks, (E,).
        jumps: Where the numbers of the steps do not count up, (E,).
        missing: Steps that the numbers leave out, (E,).
        seconds: How long it lasts without the gaps, (E,); NaN where no time is known.
        worst_minute: Breaks of the minute with the most, (E,); 0 where no time is known.
        time_gaps: Where the time jumps, (E,); likewise.
        longest_gap: Seconds of the longest jump ahead, (E,); likewise.
        unruled: Steps without a rule for each action dimension, (E, m).
        features: Steps that count for drift, of each feature, (E, F).
        boxed: Steps of rules that keep a data box, (E,); 0 where `features` counts others.
        rules: Of each rule.
        stretches: The longest stretches of breaks, at most ten, and of equal ones the first.
        minutes: The first minute with the most breaks; () without any, or where no time is known.
    """

    episodes: Counts
    steps: Counts
    covered: Counts
    broken: Counts
    outside: Counts
    near: Counts
    free: Floats
    longest_run: Counts
    jumps: Counts
    missing: Counts
    seconds: Floats
    worst_minute: Counts
    time_gaps: Counts
    longest_gap: Floats
    unruled: Counts
    features: Counts
    boxed: Counts
    rules: RuleEntries
    stretches: tuple[Stretch, ...]
    minutes: tuple[Minute, ...]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        make_read_only(self)

    def by_rule(self, values: Counts, size: int) -> Counts:
        """A column of the entries as a table.

        Args:
            values: Of `rules`, (K,).
            size: Number R of rules.

        Returns:
            Shape (E, R), 0 where there is no entry.
        """
        table = np.zeros((len(self.steps), size), dtype=np.int64)
        table[self.rules.episode, self.rules.rule] = values
        return table

    def in_force(self, size: int) -> Counts:
        """Steps in which each rule is in force, and those without one.

        Args:
            size: Number R of rules.

        Returns:
            Shape (E, R + m), as of `drift.rule_counts`.
        """
        return np.hstack([self.by_rule(self.rules.applied, size), self.unruled])


def counts_of(held: HeldSteps, quarters: Floats | None, *, before: int = 0) -> LogCounts:
    """Count steps by their episodes.

    Args:
        held: N steps in E episodes.
        quarters: Of `Yardsticks`.
        before: Steps of the log that stand before these.

    Returns:
        What is counted.
    """
    log, clock = held.log, held.clock
    starts = log.episode_starts

    def summed(values: NDArray[Any]) -> Counts:
        return by_episode(values, starts).astype(np.int64)

    def most(values: NDArray[Any], rows: Counts) -> Counts:
        table = np.zeros(len(starts), dtype=np.int64)
        np.maximum.at(table, _places(rows, starts), values)
        return table

    if quarters is None:
        features, boxed = beyond_counts(held.rule_set, held.observations, held.rules, starts)
    else:
        features = quarter_counts(held.rule_set, held.observations, starts, quarters)
        boxed = np.zeros(len(starts), dtype=np.int64)
    rows, lengths = held.runs
    broken = np.flatnonzero(held.is_broken)
    seconds, longest_gap = np.full(len(starts), np.nan), np.zeros(len(starts))
    gaps = in_a_minute = np.zeros(0, dtype=np.int64)
    if clock is not None:
        seconds = np.add.reduceat(clock.seconds, starts)
        longest_gap = np.maximum.reduceat(clock.ahead, starts)
        gaps, in_a_minute = clock.gaps, clock.most_in_a_minute(broken, starts)
    return LogCounts(
        episodes=log.episodes[starts],
        steps=log.episode_lengths,
        covered=summed(held.is_covered),
        broken=summed(held.is_broken),
        outside=summed(held.outside),
        near=summed(held.near >= 0),
        free=by_episode(held.free, starts),
        longest_run=most(lengths, rows),
        jumps=summed(held.jumps != 0),
        missing=summed(np.maximum(held.jumps, 0)),
        seconds=seconds,
        worst_minute=most(in_a_minute, broken[: len(in_a_minute)]),
        time_gaps=np.bincount(_places(gaps, starts), minlength=len(starts)).astype(np.int64),
        longest_gap=longest_gap,
        unruled=summed(held.rules < 0),
        features=features,
        boxed=boxed,
        rules=_entries(held),
        stretches=_stretches(held, before),
        minutes=_minutes(held, broken, in_a_minute, before),
    )


def together(parts: Sequence[LogCounts]) -> LogCounts:
    """The counts of parts of a log as those of the whole.

    Args:
        parts: Whole episodes each, in the order of the log, one or more.

    Returns:
        The same as if all had been counted at once.
    """
    places = np.cumsum([0, *(len(part.steps) for part in parts)])
    entries = [
        part.rules._replace(episode=part.rules.episode + place)
        for part, place in zip(parts, places, strict=False)
    ]
    joined: dict[str, Any] = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(LogCounts)
        if isinstance(getattr(parts[0], field.name), np.ndarray)
    }
    minutes = chain.from_iterable(part.minutes for part in parts)
    return LogCounts(
        **joined,
        rules=RuleEntries(*map(np.concatenate, zip(*entries, strict=True))),
        stretches=_longest(chain.from_iterable(part.stretches for part in parts)),
        minutes=_fullest(minutes),
    )


def _places(rows: Counts, starts: Counts) -> Counts:
    """The episodes, from 0, that rows are in."""
    return np.asarray(np.searchsorted(starts, rows, side="right") - 1)


def _entries(held: HeldSteps) -> RuleEntries:
    rule_set, size = held.rule_set, len(held.rule_set)
    places = np.repeat(np.arange(len(held.log.episode_starts)), held.log.episode_lengths)
    row, dimension = np.nonzero(demanded(rule_set, held.rules))
    rule, broken = held.rules[row, dimension], held.breaks[row, dimension]
    parts = [_added_up(places[row] * size + rule, broken, broken & held.outside[row])]
    if rule_set.forbids:
        boxes, features = _data_boxes(rule_set)
        for place, rows in never_applications(rule_set, held.observations, held.rules):
            one = rule_set[place]
            broken = ~one.obeyed_by(held.labels[rows, one.dimension])
            outside = broken.copy()
            states = held.observations[rows[broken]][:, features]
            outside[broken] = boxes.leave_out(np.full(len(states), place), states)
            parts.append(_added_up(places[rows] * size + place, broken, outside))
    keys, *columns = map(np.concatenate, zip(*parts, strict=True))
    order = np.argsort(keys)
    episode, in_set = np.divmod(keys[order], max(size, 1))
    return RuleEntries(episode, in_set, *(column[order] for column in columns))


def _data_boxes(rule_set: RuleSet) -> tuple[Boxes, list[int]]:
    """Where the data of rules lie for a shield, and in which features: derived ones if asked."""
    used = without_idle(rule_set)
    features = used.source.features
    places = [at for at, one in enumerate(rule_set.source.features) if one in features]
    return Boxes(used.rules, len(features)), places


def _added_up(
    keys: Counts, broken: NDArray[np.bool_], outside: NDArray[np.bool_]
) -> tuple[Counts, Counts, Counts, Counts]:
    """Different keys, ascending, and how many steps, breaks and breaks outside each has."""
    each, entry = np.unique(keys, return_inverse=True)
    applied, breaks, beyond = (
        np.bincount(entry[chosen], minlength=len(each)).astype(np.int64)
        for chosen in (slice(None), broken, outside)
    )
    return each, applied, breaks, beyond


def _stretches(held: HeldSteps, before: int) -> tuple[Stretch, ...]:
    assert held.log.steps is not None
    rows, lengths = held.runs
    stretches = []
    for place in np.argsort(-lengths, kind="stable")[:_WORST].tolist():
        row, length = int(rows[place]), int(lengths[place])
        part = slice(row, row + length)
        stretches.append(
            Stretch(
                int(held.log.episodes[row]),
                int(held.log.steps[row]),
                before + row,
                length,
                None if held.clock is None else float(held.clock.seconds[part].sum()),
                _broken_rules(held, part),
            )
        )
    return tuple(stretches)


def _broken_rules(held: HeldSteps, part: slice) -> tuple[int, ...]:
    """Places of the rules that are broken in some steps, ascending."""
    observations, rules = held.observations[part], held.rules[part]
    broken = {*rules[held.breaks[part]].tolist()}
    for place, rows in never_applications(held.rule_set, observations, rules):
        rule = held.rule_set[place]
        if not rule.obeyed_by(held.labels[part][rows, rule.dimension]).all():
            broken.add(place)
    return tuple(sorted(broken))


def _minutes(
    held: HeldSteps, broken: Counts, in_a_minute: Counts, before: int
) -> tuple[Minute, ...]:
    if not len(in_a_minute):
        return ()
    assert held.log.steps is not None
    place = int(np.argmax(in_a_minute))
    row = int(broken[place])
    return (
        Minute(
            int(held.log.episodes[row]),
            int(held.log.steps[row]),
            before + row,
            int(in_a_minute[place]),
        ),
    )


def _longest(stretches: Iterable[Stretch]) -> tuple[Stretch, ...]:
    return tuple(sorted(stretches, key=lambda one: -one.length)[:_WORST])


def _fullest(minutes: Iterable[Minute]) -> tuple[Minute, ...]:
    return tuple(sorted(minutes, key=lambda one: -one.breaks)[:1])
