"""Numbers in the sentences of claims."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sarl_core.rollouts.statistics import Interval, summarise

COMPARED = "The 95 % intervals of the typical returns (IQM) are compared"


def summary(values: NDArray[np.float64]) -> Interval:
    """`summarise`, worked out once for the same values."""
    return _summary(values.tobytes())


@lru_cache(maxsize=64)
def _summary(values: bytes) -> Interval:
    return summarise(np.frombuffer(values))


def part_of_the_way(value: float, start: float, goal: float) -> float:
    """How far a value is on the way from a start (0) to a goal (1); 0 where there is no way."""
    return (value - start) / (goal - start) if goal != start else 0.0


def number(value: float) -> str:
    """A return for people, without decimals."""
    return f"{float(value):,.0f}".replace("-", "−") if abs(value) >= 0.5 else "0"


def interval(found: Interval) -> str:
    """A typical return with its 95 % interval, for people."""
    return f"{number(found.iqm)} ({number(found.low)} to {number(found.high)})"


def percent(share: float) -> str:
    """A share for a sentence, which may be below 0 or above 1.

    Args:
        share: As 0.12.

    Returns:
        As "12 %".
    """
    return f"{100 * share:.0f} %".replace("-", "−")
