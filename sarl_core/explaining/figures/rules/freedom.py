"""What rules prevent, against what they leave to choose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import plotly.graph_objects as go

from sarl_core.explaining.colours import MARKER_COLOUR
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.explaining.ticks import share_ticks
from sarl_core.mining.language import share_text

HERE = "measured here"
KINDS = {
    "none": ("no rules", "#8796A3", "x"),
    "demand": ("demand", "#0072B2", "circle"),
    "mixed": ("demand and forbid", "#009E73", "square"),
    "never": ("forbid", "#CC79A7", "triangle-up"),
    "shipped": ("compact sets", "#E69F00", "diamond"),
    "probed": ("forbid, from probes", "#D55E00", "star"),
    HERE: (HERE, MARKER_COLOUR, "circle-open"),
}
"""What each kind of rules is called, its colour and its symbol."""
FEATURES = {None: "", 1: ", one feature", 2: ", two features"}
"""How many features conditions ask about, None where that is not said."""


@dataclass(frozen=True)
class FreedomPoint:
    """What was measured of one set of rules.

    Attributes:
        kind: One of `KINDS`.
        features: One of `FEATURES`.
        name: What the set is called.
        freedom: 0 to 1.
        failures: Episodes that failed.
        episodes: Of so many.
        low: Lower end of the 95 % interval of their share.
        high: Upper end.
    """

    kind: str
    features: int | None
    name: str
    freedom: float
    failures: int
    episodes: int
    low: float
    high: float

    @classmethod
    def of(cls, measured: Mapping[str, Any]) -> FreedomPoint:
        """A point of the shipped measurement.

        Args:
            measured: An entry of `data/rules/freedom.json`.
        """
        at = ", ".join(
            f"{name} {measured[name]:g}"
            for name in ("support", "confidence", "epsilon")
            if name in measured
        )
        return cls(
            measured["kind"],
            measured.get("features"),
            measured.get("name") or at or "no rules",
            measured["freedom"],
            measured["failures"],
            measured["episodes"],
            measured["failure_low"],
            measured["failure_high"],
        )

    @property
    def rate(self) -> float:
        """Share of the episodes that failed."""
        return self.failures / self.episodes


def point_front(points: Sequence[FreedomPoint]) -> list[FreedomPoint]:
    """Those that no other beats: with fewer failures and no less freedom, or the reverse.

    Args:
        points: Any.

    Returns:
        The least freedom first.
    """

    def beats(one: FreedomPoint, other: FreedomPoint) -> bool:
        return (
            one.rate <= other.rate
            and one.freedom >= other.freedom
            and (one.rate < other.rate or one.freedom > other.freedom)
        )

    best = [one for one in points if not any(beats(other, one) for other in points)]
    return sorted(best, key=lambda one: one.freedom)


def freedom_figure(points: Sequence[FreedomPoint], *, front: bool, dark: bool) -> go.Figure:
    """Freedom to the right, failures upwards with their 95 % intervals.

    Args:
        points: What was measured.
        front: Whether to join those that no other beats, of what was not measured here.
        dark: Whether it stands on dark ground.

    Returns:
        The best corner is at the bottom on the right.
    """
    figure = go.Figure()
    if front:
        best = point_front([one for one in points if one.kind != HERE])
        figure.add_scatter(
            x=[one.freedom for one in best],
            y=[one.rate for one in best],
            mode="lines",
            name="no other is better",
            hoverinfo="skip",
            # A staircase: between two points there is none.
            line={
                "color": "#d5dce2" if dark else "#1d2730",
                "width": 1.4,
                "dash": "dot",
                "shape": "vh",
            },
        )
    for kind, (name, colour, symbol) in KINDS.items():
        for features, asking in FEATURES.items():
            chosen = [one for one in points if (one.kind, one.features) == (kind, features)]
            if not chosen:
                continue
            figure.add_scatter(
                x=[one.freedom for one in chosen],
                y=[one.rate for one in chosen],
                mode="markers",
                name=f"{name}{asking}",
                hovertext=[_text(one) for one in chosen],
                hovertemplate="%{hovertext}<extra></extra>",
                marker={
                    "color": colour,
                    "size": {"shipped": 11, "probed": 11, HERE: 15}.get(kind, 9),
                    "symbol": symbol if features != 2 else f"{symbol}-open",
                    "line": {"width": 3 if kind == HERE else 1.8 if features == 2 else 0},
                },
                error_y={
                    "type": "data",
                    "symmetric": False,
                    "array": [one.high - one.rate for one in chosen],
                    "arrayminus": [one.rate - one.low for one in chosen],
                    "thickness": 2 if kind == HERE else 1,
                    "width": 0,
                },
                cliponaxis=False,
            )
    figure.update_layout(
        **figure_layout(
            560,
            margin={"l": 66, "r": 20, "t": 16, "b": 56},
            legend={"orientation": "h", "x": 0, "y": -0.16, "yanchor": "top"},
        )
    )
    grid = {"gridcolor": "rgba(128,128,128,0.25)", "zeroline": False, **share_ticks(0, 1)}
    figure.update_xaxes(
        title={"text": "freedom: what is left to choose"}, range=[-0.02, 1.02], **grid
    )
    figure.update_yaxes(title={"text": "episodes that fail"}, range=[-0.02, 1.03], **grid)
    return figure


def _text(one: FreedomPoint) -> str:
    low, high = (share_text(end) for end in (one.low, one.high))
    return (
        f"{plain(one.name)}<br><b>{one.failures:,} of {one.episodes:,} fail</b>, 95 % interval "
        f"{low} to {high}<br>freedom {share_text(one.freedom)}"
    )
