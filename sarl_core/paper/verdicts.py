"""Verdicts on the paper's claims, and the intervals over recordings of experts behind them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from msgspec import Struct, field
from numpy.typing import ArrayLike, NDArray

from sarl_core.documents import Number, Share
from sarl_core.rollouts.statistics import MeanInterval, mean_interval, rate_of

Verdict = Literal["agrees", "partly", "does not agree", "cannot be judged"]
VERDICTS: tuple[Verdict, ...] = ("agrees", "partly", "does not agree", "cannot be judged")

LEAST_RECORDINGS, LEAST_EXPERTS = 5, 3
"""Fewer decide nothing."""

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]


class Claim(Struct, frozen=True, forbid_unknown_fields=True):
    """A sentence of the paper beside our number.

    Attributes:
        paper: What the paper says, in one sentence.
        where: Where it says so.
        ours: What we found, and in how many recordings, in a sentence or two.
        verdict: Whether the two agree, decided by `decided_by` and nothing else.
        decided_by: By which rule.
        numbers: What went into `ours` and the verdict.
        by_chance: How often it would agree if it made no difference what is called what, 0 to 1;
            None as long as that is not worked out.
        constructed: Why it holds whatever was demonstrated; empty if it may fail.
    """

    paper: str
    where: str
    ours: str
    verdict: Verdict
    decided_by: str
    numbers: Mapping[str, Number | None] = field(default_factory=dict)
    by_chance: Share | None = None
    constructed: str = ""


def enough(experts: Sequence[str]) -> bool:
    """Whether recordings are enough to decide anything.

    Args:
        experts: The expert of each.

    Returns:
        True if there are 5 of 3 experts at least.
    """
    return len(experts) >= LEAST_RECORDINGS and len(set(experts)) >= LEAST_EXPERTS


def over_recordings(values: ArrayLike, experts: Sequence[str]) -> MeanInterval:
    """The mean over recordings, with a 95 % interval that takes experts for groups.

    Two recordings of one expert are alike. So the interval is Student's over all recordings or
    that over the experts' means, whichever is wider: it covers 95 % or more however much of the
    spread is between experts.

    Args:
        values: One number a recording, (R,).
        experts: The expert of each.

    Returns:
        The mean of the experts' means and its interval; of one expert alone nobody can tell how
        experts differ, and the ends are NaN.
    """
    array = np.asarray(values, dtype=np.float64)
    names = np.asarray(experts)
    groups = mean_interval([array[names == name].mean() for name in dict.fromkeys(experts)])
    every = mean_interval(array)
    half = max(every.high - every.mean, groups.high - groups.mean)
    if len(set(experts)) == 1:
        half = math.nan
    return MeanInterval(groups.mean, groups.mean - half, groups.mean + half)


def share_over_recordings(holds: Truths, experts: Sequence[str]) -> MeanInterval:
    """The share of episodes in which something is so, likewise.

    Where it is so in all or in none, recordings do not differ, and yet there were only so many
    episodes: the interval is never narrower than that of Clopper and Pearson over all of them.

    Args:
        holds: For each recording its episodes, (R, E).
        experts: The expert of each recording.

    Returns:
        The mean share and its interval, within 0 and 1; the ends are NaN as there.
    """
    spread, whole = over_recordings(holds.mean(axis=1), experts), rate_of(holds)
    if math.isnan(spread.low):
        return spread
    return MeanInterval(
        spread.mean,
        max(min(spread.low, whole.low), 0.0),
        min(max(spread.high, whole.high), 1.0),
    )
