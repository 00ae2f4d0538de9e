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
        step: Seconds from one step to the next, the median.
        seconds: How long each step lasts, (N,); the median before a gap and at an episode's end.
        at: Seconds since the first step, (N,), in which episodes lie far from one another.
        gaps: Rows after which the time jumps ahead by more than `GAP` steps, or goes back.
        longest_gap: Seconds of the longest jump ahead, 0 without any.
    """

    step: float
    seconds: NDArray[np.float64]
    at: NDArray[np.float64]
    gaps: NDArray[np.int64]
    longest_gap: float

    @property
    def minutes(self) -> float:
        """All steps together, without the gaps."""
        return float(self.seconds.sum()) / _MINUTE

    def most_in_a_minute(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """How many of some steps lie in the minute that begins with each of them.

        Args:
            rows: Ascending, k of them.

        Returns:
            Shape (k,), at least 1.
        """
        at = self.at[rows]
        return np.asarray(np.searchsorted(at, at + _MINUTE, side="left") - np.arange(len(rows)))


def clock_of(log: Demonstrations) -> Clock | None:
    """The clock of a log.

    Args:
        log: N steps.

    Returns:
        None where the log has no times, or they stand still.
    """
    if log.times is None:
        return None
    seconds = np.append(np.diff(log.times), np.nan)
    ends = log.episode_starts + log.episode_lengths - 1
    seconds[ends] = np.nan
    rising = seconds > 0
    if not rising.any():
        return None
    step = float(np.median(seconds[rising]))
    jumps = (seconds > GAP * step) | (seconds < 0)
    longest = float(np.max(seconds, where=jumps, initial=0.0))
    passed = np.where(seconds >= 0, seconds, step)
    passed[ends] = _MINUTE + step
    at = np.append(0.0, np.cumsum(passed)[:-1])
    lasting = np.where(jumps | np.isnan(seconds), step, seconds)
    return Clock(step, lasting, at, np.flatnonzero(jumps), longest)
