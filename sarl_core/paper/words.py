"""Numbers in the sentences of claims."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from sarl_core.decimals import rounded_text
from sarl_core.mining.language import share_text
from sarl_core.rollouts.statistics import MeanInterval


def number_range(values: ArrayLike, decimals: int = 0) -> str:
    """The least and the most of some numbers, or the one that they all are, for people."""
    ends = dict.fromkeys(f"{end:,.{decimals}f}" for end in (np.min(values), np.max(values)))
    return " to ".join(ends)


def interval(mean: MeanInterval) -> str:
    """A return with its 95 % interval, where there is one, for people."""
    if math.isnan(mean.low):
        return rounded_text(mean.mean)
    return f"{rounded_text(mean.mean)} ({rounded_text(mean.low)} to {rounded_text(mean.high)})"


def shares(mean: MeanInterval) -> str:
    """A share with its 95 % interval, where there is one, for people."""
    if math.isnan(mean.low):
        return share_text(mean.mean)
    low, high = (share_text(min(max(end, 0.0), 1.0)) for end in (mean.low, mean.high))
    return f"{share_text(mean.mean)} ({low} to {high})"


def percent(share: float) -> str:
    """A share for a sentence, which may be below 0 or above 1.

    Args:
        share: As 0.12.

    Returns:
        As "12 %".
    """
    return f"{rounded_text(100 * share)} %"
