"""What the layouts of figures have in common: the page's ground, and nothing that a drag moves."""

from __future__ import annotations

from typing import Any

_ROOM = {"l": 8, "r": 8, "t": 8, "b": 8}

LEGEND_ABOVE = {
    "orientation": "h",
    "x": 0,
    "y": 1.02,
    "xanchor": "left",
    "yanchor": "bottom",
    "itemwidth": 30,
}


def figure_layout(
    height: int, *, margin: dict[str, Any] | None = None, **more: Any
) -> dict[str, Any]:
    """The layout of a figure.

    Args:
        height: In pixels.
        margin: In which it differs from 8 pixels at each side.
        **more: What else a layout of Plotly has.

    Returns:
        As `update_layout` takes it.
    """
    return {
        "height": height,
        "margin": _ROOM | (margin or {}),
        "hovermode": "closest",
        "dragmode": False,
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        **more,
    }
