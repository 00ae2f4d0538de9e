"""Axes of shares: their ticks are written as shares are everywhere else."""

from __future__ import annotations

from typing import Any

from sarl_core.explaining.ticks import round_ticks, tick_text

_LEAST = 1e-3  # an axis over less than this would have no round number


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
