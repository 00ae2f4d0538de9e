"""What a rule carries of the pairs behind it: where they lay, and what others say of it.

Others count by episodes. Steps of one episode are alike, and one long episode can outweigh all the
rest, so no interval over steps can know how the next episode will be. Of each episode there is one
number, the share of its states in which the expert did what the rule says; the mean of these
numbers is what is told, and how far they spread says how sure it is.
"""

from __future__ import annotations

import sys
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

FEWEST_EPISODES = 5
"""Episodes below which nothing is said of where a share lies."""
_PSEUDO = 0.5
"""Share of the one episode that is added to those there are. Ten episodes of one share would else
leave no doubt at all about the eleventh."""

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class DataBox(Sequence[tuple[float, ...]]):
    """Where the pairs of a rule lay: its half-spaces reach further than they did.

    A sequence of its four sides. It holds bare numbers: as objects, those of a hundred thousand
    rules would take four times the memory of all else that the rules are.

    Attributes:
        least: Least value of each feature, (d,), exact float32 numbers.
        low: The 1 % quantile of each feature, (d,).
        high: The 99 % quantile of each feature, (d,).
        most: Largest value of each feature, (d,), exact float32 numbers.
    """

    __slots__ = ("_numbers",)
    _fields = ("least", "low", "high", "most")

    def __init__(
        self,
        least: Sequence[float],
        low: Sequence[float],
        high: Sequence[float],
        most: Sequence[float],
    ) -> None:
        self._numbers = array("d", (*least, *low, *high, *most))

    def __len__(self) -> int:
        """Four."""
        return len(self._fields)

    @overload
    def __getitem__(self, place: int) -> tuple[float, ...]: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[tuple[float, ...], ...]: ...
    def __getitem__(self, place: int | slice) -> tuple[float, ...] | tuple[tuple[float, ...], ...]:
        """The side at a place, from 0; of a slice, those sides."""
        d = len(self._numbers) // len(self._fields)
        starts = range(0, len(self._fields) * d, d) if d else (0,) * len(self._fields)
        if isinstance(place, slice):
            return tuple(tuple(self._numbers[start : start + d]) for start in starts[place])
        start = starts[place]
        return tuple(self._numbers[start : start + d])

    def __eq__(self, other: object) -> bool:
        """Whether all numbers are the same."""
        return isinstance(other, DataBox) and self._numbers == other._numbers

    def __hash__(self) -> int:
        """As of the numbers."""
        return hash(tuple(self._numbers))

    def __repr__(self) -> str:
        """All of it."""
        sides = (f"{name}={side!r}" for name, side in zip(self._fields, self, strict=True))
        return f"DataBox({', '.join(sides)})"

    def __sizeof__(self) -> int:
        """With its numbers."""
        return object.__sizeof__(self) + sys.getsizeof(self._numbers)

    @property
    def least(self) -> tuple[float, ...]:
        """Least value of each feature, (d,)."""
        return self[0]

    @property
    def low(self) -> tuple[float, ...]:
        """The 1 % quantile of each feature, (d,)."""
        return self[1]

    @property
    def high(self) -> tuple[float, ...]:
        """The 99 % quantile of each feature, (d,)."""
        return self[2]

    @property
    def most(self) -> tuple[float, ...]:
        """Largest value of each feature, (d,)."""
        return self[3]

    def by_name(self) -> dict[str, tuple[float, ...]]:
        """The four sides, each under what it is called."""
        return dict(zip(self._fields, self, strict=True))


class Interval(NamedTuple):
    """Where a share probably lies.

    Attributes:
        low: Lower end.
        high: Upper end.
    """

    low: float
    high: float


class HeldOut(NamedTuple):
    """A rule, or a whole rule set, on episodes that it was not mined from.

    Attributes:
        samples: Pairs that count: to which it applies.
        correct: Those of them that it is right about.
        episodes: In how many episodes they lie; 0 beside pairs where an older file did not say.
        share: The mean over these episodes of the share that is right in each; None without any.
        low: Lower end of the 95 % interval of that mean over all episodes there could be; None
            where there are fewer than `FEWEST_EPISODES`.
        high: Upper end.
    """

    samples: int
    correct: int
    episodes: int
    share: float | None
    low: float | None
    high: float | None

    @property
    def interval(self) -> Interval | None:
        """Both ends; None where there are too few episodes."""
        return None if self.low is None or self.high is None else Interval(self.low, self.high)


class EpisodeSums(NamedTuple):
    """What is added up over episodes, of many things at once; arrays of one shape.

    Attributes:
        episodes: Number of episodes that count.
        samples: Pairs that count in them.
        total: Sum of the episodes' shares.
        squares: Sum of the squares of these.
    """

    episodes: NDArray[np.int64]
    samples: NDArray[np.int64]
    total: Floats
    squares: Floats

    @property
    def mean(self) -> Floats:
        """Mean share of an episode; NaN without any."""
        with np.errstate(invalid="ignore"):
            return np.asarray(self.total / self.episodes)

    def bounds(self, *, whole_set: bool = False, widened: float = 1.0) -> tuple[Floats, Floats]:
        """The 95 % t interval of the mean, with one pseudo-episode at 0.5.

        A single rule may be right in ten episodes and wrong in the eleventh, of a kind not met so
        far; the pseudo-episode stands for that one. A whole set meets every kind in nearly every
        episode, and a pseudo-episode would outweigh what they say: there it counts as much as one
        state of them does.

        Args:
            whole_set: Whether it is a rule set and no single rule.
            widened: How many times wider, where the shares depend on one another.

        Returns:
            Lower and upper ends within 0 and 1; NaN with fewer than `FEWEST_EPISODES`.
        """
        weight = np.ones(self.total.shape)
        if whole_set:
            weight = np.maximum(self.episodes, 1) / np.maximum(self.samples, 1)
        n: Floats = self.episodes + weight
        mean: Floats = (self.total + weight * _PSEUDO) / n
        spread: Floats = np.maximum(self.squares + weight * _PSEUDO**2 - n * mean**2, 0.0)
        reach = widened * t_reach(n, spread)
        enough = self.episodes >= FEWEST_EPISODES
        low = np.where(enough, np.clip(mean - reach, 0.0, 1.0), np.nan)
        high = np.where(enough, np.clip(mean + reach, 0.0, 1.0), np.nan)
        return low, high


def t_reach(n: Floats, spread: Floats) -> Floats:
    """How far a 95 % t interval reaches to either side of a mean.

    Args:
        n: How many numbers it is the mean of, any shape.
        spread: Sum of their squared distances from it.

    Returns:
        The same shape; infinity with one number.
    """
    from scipy.special import stdtrit  # takes its time; most programs need none

    freedom = np.maximum(n - 1.0, 1.0)
    reach = stdtrit(freedom, 0.975) * np.sqrt(spread / freedom / np.maximum(n, 1.0))
    return np.where(n > 1.0, reach, np.inf)


def held_out_of(
    samples: ArrayLike, correct: ArrayLike, *, whole_set: bool = False, widened: float = 1.0
) -> HeldOut:
    """Count one thing by episodes.

    Args:
        samples: Pairs that count in each episode, (E,); where there are none, it does not count.
        correct: Those of them that are right, (E,).
        whole_set: Whether it is a rule set and no single rule, for `EpisodeSums.bounds`.
        widened: Likewise.

    Returns:
        The mean over the episodes with its interval.
    """
    pairs, right = np.asarray(samples, dtype=np.int64), np.asarray(correct, dtype=np.int64)
    shares = right[pairs > 0] / pairs[pairs > 0]
    sums = EpisodeSums(
        np.array([len(shares)]),
        np.array([pairs.sum()]),
        np.array([shares.sum()]),
        np.array([np.square(shares).sum()]),
    )
    bounds = sums.bounds(whole_set=whole_set, widened=widened)
    return _held_outs([int(right.sum())], sums, bounds)[0]


def held_outs(correct: list[int], sums: EpisodeSums) -> list[HeldOut]:
    """Count many rules by episodes.

    Args:
        correct: Pairs that each is right about, R numbers.
        sums: Over the episodes of each, (R,).

    Returns:
        One entry each.
    """
    return _held_outs(correct, sums, sums.bounds())


def _held_outs(
    correct: list[int], sums: EpisodeSums, bounds: tuple[Floats, Floats]
) -> list[HeldOut]:
    low, high = bounds
    return [
        HeldOut(
            all_pairs,
            right,
            episodes,
            min(total / episodes, 1.0) if episodes else None,
            *((None, None) if episodes < FEWEST_EPISODES else ends),
        )
        for all_pairs, right, episodes, total, ends in zip(
            sums.samples.tolist(),
            correct,
            sums.episodes.tolist(),
            sums.total.tolist(),
            zip(low.tolist(), high.tolist(), strict=True),
            strict=True,
        )
    ]


@dataclass(frozen=True, eq=False)
class EpisodeCounts:
    """Subjects (rules, or nodes of a tree) in E episodes; K entries, where one applies at all.

    Attributes:
        size: Number of subjects.
        subject: Which one, (K,), ascending.
        episode: In which episode, 0 to E - 1, (K,), ascending within a subject.
        samples: Pairs of the episode to which it applies, at least 1, (K,).
        correct: Those of them that it is right about, (K,).
        numbers: What the episodes are called, (E,).
        lengths: Their steps, (E,).
    """

    size: int
    subject: Integers
    episode: Integers
    samples: Integers
    correct: Integers
    numbers: Integers
    lengths: Integers

    def held_out(self) -> list[HeldOut]:
        """What all episodes say of each subject.

        Returns:
            One entry a subject.
        """
        shares = self.correct / self.samples
        samples, correct = (
            np.bincount(self.subject, weights, minlength=self.size).astype(np.int64)
            for weights in (self.samples, self.correct)
        )
        sums = EpisodeSums(
            np.bincount(self.subject, minlength=self.size),
            samples,
            np.bincount(self.subject, shares, minlength=self.size).astype(np.float64),
            np.bincount(self.subject, np.square(shares), minlength=self.size).astype(np.float64),
        )
        return held_outs(correct.tolist(), sums)

    def together(self, chosen: NDArray[np.bool_]) -> tuple[Integers, Integers]:
        """Some subjects that do not overlap, taken as one.

        Args:
            chosen: Which, (size,).

        Returns:
            Pairs of each episode to which they apply, and those they are right about, (E,) each.
        """
        inside = chosen[self.subject]
        samples, correct = (
            np.bincount(self.episode[inside], weights[inside], minlength=len(self.numbers))
            for weights in (self.samples, self.correct)
        )
        return samples.astype(np.int64), correct.astype(np.int64)

    def of(self, subject: int) -> tuple[Integers, Integers]:
        """One subject alone, as `together`.

        Args:
            subject: Which.

        Returns:
            Pairs of each episode to which it applies, and those it is right about, (E,) each.
        """
        first, last = np.searchsorted(self.subject, [subject, subject + 1]).tolist()
        counts = np.zeros((2, len(self.numbers)), dtype=np.int64)
        counts[:, self.episode[first:last]] = self.samples[first:last], self.correct[first:last]
        return counts[0], counts[1]
