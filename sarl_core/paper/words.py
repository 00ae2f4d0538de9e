"""Numbers in the sentences of claims."""

from __future__ import annotations

import math

from sarl_core.mining.language import share_text
from sarl_core.rollouts.statistics import MeanInterval


def number(value: float) -> str:
    """A return for people, without decimals."""
    return f"{float(value):,.0f}".replace("-", "−") if abs(value) >= 0.5 else "0"


def interval(found: MeanInterval) -> str:
    """A return with its 95 % interval, where there is one, for people."""
    if math.isnan(found.low):
        return number(found.mean)
    return f"{number(found.mean)} ({number(found.low)} to {number(found.high)})"


def shares(found: MeanInterval) -> str:
    """A share with its 95 % interval, where there is one, for people."""
    if math.isnan(found.low):
        return share_text(found.mean)
    low, high = (share_text(min(max(end, 0.0), 1.0)) for end in (found.low, found.high))
    return f"{share_text(found.mean)} ({low} to {high})"


def percent(share: float) -> str:
    """A share for a sentence, which may be below 0 or above 1.

    Args:
        share: As 0.12.

    Returns:
        As "12 %".
    """
    return f"{100 * share:.0f} %".replace("-", "−")
