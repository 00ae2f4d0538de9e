"""What a rule carries of the pairs behind it: where they lay, and what others say of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Z_95 = 1.959963984540054
"""The normal distribution's 97.5 % quantile: 95 % lie within so many standard deviations."""


class DataBox(NamedTuple):
    """Where the pairs of a rule lay: its half-spaces reach further than they did.

    Attributes:
        least: Least value of each feature, (d,), exact float32 numbers.
        low: The 1 % quantile of each feature, (d,).
        high: The 99 % quantile of each feature, (d,).
        most: Largest value of each feature, (d,), exact float32 numbers.
    """

    least: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    most: tuple[float, ...]


class HeldOut(NamedTuple):
    """A rule on episodes that it was not mined from.

    Attributes:
        samples: Pairs to which it applies.
        correct: Those of them that carry its label.
    """

    samples: int
    correct: int

    @property
    def confidence(self) -> float:
        """Share of its pairs that carry its label, NaN where there are none."""
        return self.correct / self.samples if self.samples else float("nan")


class Interval(NamedTuple):
    """Where a share probably lies.

    Attributes:
        low: Lower end.
        high: Upper end.
    """

    low: float
    high: float


def wilson_bounds(
    correct: ArrayLike, samples: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The 95 % Wilson score intervals of many shares at once.

    Args:
        correct: Hits, any shape; a fraction of a hit is allowed.
        samples: Trials, likewise.

    Returns:
        Lower and upper ends; 0 and 1 where there is no trial, since nothing is known then.
    """
    hits, trials = (np.asarray(values, dtype=np.float64) for values in (correct, samples))
    n = np.maximum(trials, 1.0)
    share = hits / n
    square = Z_95**2
    centre = (share + square / (2 * n)) / (1 + square / n)
    reach = Z_95 / (1 + square / n) * np.sqrt(share * (1 - share) / n + square / (4 * n**2))
    # All or none of them: that end is the share itself, whatever the rounding says.
    low = np.where(hits <= 0, 0.0, np.maximum(centre - reach, 0.0))
    high = np.where(hits >= trials, 1.0, np.minimum(centre + reach, 1.0))
    return np.where(trials > 0, low, 0.0), np.where(trials > 0, high, 1.0)


def wilson(correct: float, samples: float) -> Interval:
    """The 95 % Wilson score interval of one share, as `wilson_bounds`.

    Args:
        correct: Hits.
        samples: Trials.

    Returns:
        0 to 1 without a trial.
    """
    if not samples > 0:
        return Interval(0.0, 1.0)
    # Written again for single numbers: arrays of one take thirty times as long.
    share, square = correct / samples, Z_95**2
    centre = (share + square / (2 * samples)) / (1 + square / samples)
    spread = share * (1 - share) / samples + square / (4 * samples**2)
    reach = Z_95 / (1 + square / samples) * math.sqrt(spread)
    return Interval(
        0.0 if correct <= 0 else max(centre - reach, 0.0),
        1.0 if correct >= samples else min(centre + reach, 1.0),
    )
