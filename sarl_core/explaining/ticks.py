"""Round numbers for an axis; shares are written on it as they are everywhere else."""

from __future__ import annotations

import math
from typing import Any

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_LEAST = 1e-3  # an axis of shares over less than this would have no round number


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


def share_ticks(low: float, high: float, most: int = 5) -> dict[str, Any]:
    """Ticks for an axis or a colour bar of Plotly, which itself leaves no space before the sign.

    Args:
        low: The least share that is seen.
        high: The largest.
        most: About so many ticks.

    Returns:
        Arguments of the axis: round percentages within, as "12.5 %".
    """
    ticks = round_ticks(100 * low, 100 * max(high, low + _LEAST), most)
    return {
        "tickmode": "array",
        "tickvals": [tick / 100 for tick in ticks],
        "ticktext": [f"{tick_text(tick)} %" for tick in ticks],
    }
