"""Thresholds on a feature, and the demonstrated values on either side of each.

They tell how many digits a threshold needs where it is read: so many that the number which is
written parts the demonstrated states as the threshold does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.decimals import decimal_text, float32_around, short_decimal

FEWEST_DIGITS = 3
"""Of a threshold that is read: a threshold stands between two values, but not just anywhere."""

_NEARER = 0.1  # of the way from a value to a threshold, that what is written of each may be off
_NOTHING = 0.001  # of the gap that a threshold lies in: nearer to zero than so, it is zero

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Splits:
    """k thresholds on one feature of N demonstrated states.

    Attributes:
        thresholds: Ascending, each once, (k,).
        below: The largest demonstrated value that is at most the threshold, -inf where there is
            none, (k,).
        above: The smallest demonstrated value above it, inf where there is none, (k,).
        binary: Whether no value but 0 and 1 was demonstrated.
    """

    thresholds: Floats
    below: Floats
    above: Floats
    binary: bool = False

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        make_read_only(self)

    @classmethod
    def of(cls, values: NDArray[np.float32], thresholds: Floats) -> Splits:
        """Look up what lies on either side of thresholds.

        Args:
            values: The feature in all N states, (N,).
            thresholds: In any order, (k,).

        Returns:
            The thresholds with their neighbours.
        """
        distinct = np.unique(thresholds)
        ordered = np.sort(values)
        # Searched for as numbers of the same kind, so that no state is copied once more.
        with np.errstate(over="ignore"):
            largest = distinct.astype(np.float32)
            before = np.nextafter(largest, np.float32(-np.inf))
        largest = np.where(largest > distinct, before, largest)
        at = np.searchsorted(ordered, largest, side="right")
        below, above = np.full(len(at), -np.inf), np.full(len(at), np.inf)
        some, others = at > 0, at < len(ordered)
        below[some], above[others] = ordered[at[some] - 1], ordered[at[others]]
        zeros = np.searchsorted(ordered, np.float32(0), side="right")
        within = len(ordered) > 0 and ordered[0] >= 0.0 and ordered[-1] <= 1.0
        binary = bool(within and zeros == np.searchsorted(ordered, np.float32(1)))
        return cls(distinct, below, above, binary)

    @classmethod
    def together(cls, several: Sequence[Splits]) -> Splits:
        """The thresholds of several trees over the same demonstrations.

        Args:
            several: One or more.

        Returns:
            All of them, each once.
        """
        if len(several) == 1:
            return several[0]
        distinct, first = np.unique(
            np.concatenate([one.thresholds for one in several]), return_index=True
        )
        below, above = (
            np.concatenate([getattr(one, side) for one in several])[first]
            for side in ("below", "above")
        )
        return cls(distinct, below, above, all(one.binary for one in several))

    def only(self, thresholds: Iterable[float]) -> Splits:
        """Some of the thresholds.

        Args:
            thresholds: Those to keep; those that are not there do not matter.

        Returns:
            With their neighbours.
        """
        wanted = np.isin(self.thresholds, np.fromiter(thresholds, dtype=np.float64))
        return Splits(self.thresholds[wanted], self.below[wanted], self.above[wanted], self.binary)

    @cached_property
    def _written(self) -> dict[float, str]:
        return {}

    def written(self, threshold: float) -> str:
        """A threshold as it is read, which many rules may ask about.

        Args:
            threshold: Any number.

        Returns:
            As "293.42": what `written_threshold` gives, as text.
        """
        text = self._written.get(threshold)
        if text is None:
            text = self._written[threshold] = decimal_text(written_threshold(threshold, self))
        return text

    def around(self, threshold: float) -> tuple[float, float] | None:
        """The demonstrated values on either side of a threshold.

        Args:
            threshold: Any number.

        Returns:
            `below` and `above`; None if it is none of the k.
        """
        at = int(np.searchsorted(self.thresholds, threshold))
        if at == len(self.thresholds) or self.thresholds[at] != threshold:
            return None
        return float(self.below[at]), float(self.above[at])


def written_threshold(
    threshold: float, splits: Splits | None, *, beside: Sequence[float] = ()
) -> float:
    """The number that is written for a threshold.

    Args:
        threshold: At full precision.
        splits: Of its feature, where they are known. Where they are not, or not of this
            threshold, it has to part all 32-bit numbers as the threshold does.
        beside: Values that are shown with it: they have to stay on their side, too, and about as
            far from it as they are.

    Returns:
        A decimal number of three significant digits, or of more where the demonstrated states
        need them.
    """
    below, above = (splits and splits.around(threshold)) or (-math.inf, math.inf)
    if math.isinf(below) or math.isinf(above):
        near, next_above = float32_around(threshold)
        below = near if math.isinf(below) else below
        above = next_above if math.isinf(above) else above
    beside = [value for value in beside if math.isfinite(value)]
    room = _NEARER * min(
        (abs(value - threshold) for value in beside if value != threshold), default=math.inf
    )
    below = max([below, threshold - room, *(value for value in beside if value <= threshold)])
    above = min([above, threshold + room, *(value for value in beside if value > threshold)])
    if below <= 0.0 < above and abs(threshold) < _NOTHING * (above - below):
        return 0.0
    decimal = short_decimal(threshold, below, above, fewest=FEWEST_DIGITS)
    return threshold if decimal is None else decimal


def written_value(
    value: float,
    thresholds: Sequence[float] = (),
    *,
    within: tuple[float, float] = (-math.inf, math.inf),
    fewest: int = FEWEST_DIGITS,
) -> float:
    """The number that is written for a value, beside thresholds that are written too.

    Args:
        value: Any finite number.
        thresholds: As they are written, or other values.
        within: Two numbers between which what is written lies, too, if there is such a number.
        fewest: Number of significant digits to begin with.

    Returns:
        A decimal number of so many digits, or of more where it takes them to stay on its side of
        each threshold, and as far from it as it is.
    """
    ways = [abs(value - one) for one in thresholds if one != value]
    room = _NEARER * min(ways, default=math.inf)
    # What lies on a threshold is at most the threshold, and so is what is written of it.
    most = value if value in thresholds else value + room
    least = value - room
    for low, high in (within, (-math.inf, math.inf)):
        above = float(np.nextafter(min(most, high), math.inf))
        decimal = short_decimal(value, max(least, low), above, fewest=fewest)
        if decimal is not None:
            return decimal
    return value
