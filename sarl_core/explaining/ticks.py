"""Round numbers for an axis."""

from __future__ import annotations

import math

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)


def round_ticks(low: float, high: float, most: int, *, whole: bool = False) -> list[float]:
    """Round numbers for an axis.

    Args:
        low: Where it begins.
        high: Where it ends, above `low`.
        most: So many, and one more where it begins with a round number.
        whole: Whether only whole numbers will do.

    Returns:
        Ascending, evenly apart, at least one where there is a round number in between.
    """
    rough = max((high - low) / most, 1.0 if whole else 0.0)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(
        power * one
        for one in _STEPS
        if power * one >= rough * (1 - 1e-9) and not (whole and power * one % 1)
    )
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    digits = max(1 - math.floor(math.log10(step)), 0)  # 0.30000000000000004 is 0.3
    return [round(index * step, digits) for index in range(first, last + 1)]


def tick_text(tick: float) -> str:
    """A round number in full, since a rounded one would stand at a wrong place.

    Args:
        tick: See `round_ticks`.

    Returns:
        As "102.5".
    """
    return f"{tick:,.10g}"
