"""When the steps of a log were: how long each lasts, and where time jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations

GAP = 10  # usual steps; more between two steps of an episode is a gap
_MINUTE = 60.0


@dataclass(frozen=True, eq=False)
class Clock:
    """The times of N steps in E episodes.

    Attributes:
        step: Seconds from one step to the next, as `usual_step` has it.
        seconds: How long each step lasts, (N,); the usual step before a gap and at an episode's
            end.
        passed: Seconds from each step to the next of its episode, (N,): the usual step where that
            is not known, or the time goes back.
        gaps: Rows after which the time jumps ahead by more than `GAP` steps, or goes back.
        ahead: Seconds of the jump ahead after each step, 0 without one, (N,).
    """

    step: float
    seconds: NDArray[np.float64]
    passed: NDArray[np.float64]
    gaps: NDArray[np.int64]
    ahead: NDArray[np.float64]

    @property
    def minutes(self) -> float:
        """All steps together, without the gaps."""
        return float(self.seconds.sum()) / _MINUTE

    @property
    def longest_gap(self) -> float:
        """Seconds of the longest jump ahead, 0 without any."""
        return float(self.ahead.max())

    def most_in_a_minute(
        self, rows: NDArray[np.int64], starts: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """How many of some steps lie in the minute of their episode that begins with each of them.

        Args:
            rows: Ascending, k of them.
            starts: Row at which each of E episodes starts.

        Returns:
            Shape (k,), at least 1.
        """
        counts = np.empty(len(rows), dtype=np.int64)
        episode = np.searchsorted(starts, rows, side="right") - 1
        ends = np.append(np.flatnonzero(np.diff(episode)) + 1, len(rows))
        begin = 0
        for end in ends.tolist() if len(rows) else []:
            own = rows[begin:end]
            first = int(starts[episode[begin]])
            # From the episode's first step: what other episodes took changes no digit of it.
            passed = np.cumsum(self.passed[first : int(own[-1])])
            at = np.append(0.0, passed)[own - first]
            ahead = np.searchsorted(at, at + _MINUTE, side="left")
            counts[begin:end] = ahead - np.arange(len(own))
            begin = end
        return counts


def steps_in_episodes(log: Demonstrations) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """How long the steps of each episode last.

    Args:
        log: N steps.

    Returns:
        For each episode in which the time passes, the median of its seconds from one step to the
        next (of two in the middle the lesser), and how many such steps it has.
    """
    seconds = _seconds(log)
    episode = np.repeat(np.arange(log.n_episodes), log.episode_lengths)
    rising = seconds > 0
    seconds, episode = seconds[rising], episode[rising]
    seconds = seconds[np.lexsort((seconds, episode))]
    counts = np.bincount(episode)
    begins = np.cumsum(counts) - counts
    has = counts > 0
    return seconds[(begins + (counts - 1) // 2)[has]], counts[has].astype(np.int64)


def usual_step(medians: NDArray[np.float64], counts: NDArray[np.int64]) -> float | None:
    """The step of a log: the median of its episodes, each as often as it has steps.

    It is worked out of one number an episode, so that no memory has to hold all steps.

    Args:
        medians: Seconds, one an episode.
        counts: Steps of each.

    Returns:
        Seconds; None without any.
    """
    if not len(medians):
        return None
    order = np.argsort(medians, kind="stable")
    reached = np.cumsum(counts[order])
    return float(medians[order[np.searchsorted(reached, reached[-1] / 2)]])


def clock_of(log: Demonstrations, step: float | None) -> Clock | None:
    """The clock of a log, or of some of its episodes.

    Args:
        log: N steps.
        step: The usual step of the whole log; None where it has no times, or they stand still.

    Returns:
        None without a step.
    """
    if step is None:
        return None
    seconds = _seconds(log)
    jumps = (seconds > GAP * step) | (seconds < 0)
    return Clock(
        step=step,
        seconds=np.where(jumps | np.isnan(seconds), step, seconds),
        passed=np.where(seconds >= 0, seconds, step),
        gaps=np.flatnonzero(jumps),
        ahead=np.where(jumps & (seconds > 0), seconds, 0.0),
    )


def _seconds(log: Demonstrations) -> NDArray[np.float64]:
    """From each step to the next of its episode; NaN where that is not known, (N,)."""
    if log.times is None:
        return np.full(len(log), np.nan)
    seconds = np.append(np.diff(log.times), np.nan)
    seconds[log.episode_starts + log.episode_lengths - 1] = np.nan
    return seconds
