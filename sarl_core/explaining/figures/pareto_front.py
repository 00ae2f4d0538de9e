"""The figure of the rule sets that no other one beats."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.explaining.colours import MARKER_COLOUR, MUTED_COLOUR
from sarl_core.explaining.figures.thresholds import layer_scale
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.ticks import share_ticks
from sarl_core.mining.language import share_text
from sarl_core.mining.thresholds.pareto import ParetoPoint


def thin_front(points: Sequence[ParetoPoint], most: int = 240) -> tuple[ParetoPoint, ...]:
    """Few enough points of a Pareto front to draw, spread over it.

    Args:
        points: The front.
        most: How many to keep, roughly.

    Returns:
        From each patch of similar size and fidelity the one with the most coverage.
    """
    if len(points) <= most:
        return tuple(points)
    side = max(int(most**0.5), 1)
    size = np.log(np.array([point.rules for point in points], dtype=np.float64))
    right = np.array([point.fidelity for point in points])

    def patch(values: NDArray[np.float64]) -> NDArray[np.int64]:
        low, high = float(values.min()), float(values.max())
        scaled = (values - low) / max(high - low, 1e-12) * side
        return np.minimum(scaled.astype(np.int64), side - 1)

    best: dict[tuple[int, int], ParetoPoint] = {}
    for key, point in zip(
        zip(patch(size).tolist(), patch(right).tolist(), strict=True), points, strict=True
    ):
        if key not in best or point.coverage > best[key].coverage:
            best[key] = point
    return tuple(sorted(best.values()))


def front_figure(
    points: Sequence[ParetoPoint],
    *,
    chosen: tuple[int, float, float] | None = None,
    recommended: tuple[int, float] | None = None,
    dark: bool = False,
) -> go.Figure:
    """The rule sets that no other one beats: few rules, much coverage, much fidelity.

    Args:
        points: The front, or some of it.
        chosen: Rules, coverage and fidelity of the rule set in force.
        recommended: Rules and coverage of the rule set that is recommended.
        dark: Whether it stands on dark ground.

    Returns:
        Rules to the right (powers of ten), coverage upwards, fidelity as colour; each point
        carries its thresholds as `customdata`.
    """
    figure = go.Figure()
    fidelities = [point.fidelity for point in points]
    figure.add_scatter(
        x=[point.rules for point in points],
        y=[point.coverage for point in points],
        mode="markers",
        customdata=[
            [
                point.support,
                point.confidence,
                share_text(point.fidelity, decimals=2),
                share_text(point.coverage, decimals=1),
            ]
            for point in points
        ],
        marker={
            "size": 9,
            "color": fidelities,
            "colorscale": layer_scale(dark=dark),
            "showscale": True,
            "line": {"width": 0.5, "color": MUTED_COLOUR},
            "colorbar": {
                "thickness": 10,
                "outlinewidth": 0,
                **share_ticks(min(fidelities, default=0.0), max(fidelities, default=1.0)),
                "x": 1.01,
                "title": {"text": "Fidelity", "side": "right"},
            },
        },
        hovertemplate=(
            "rules %{x:,}, coverage %{customdata[3]}, fidelity %{customdata[2]}<br>"
            "at support %{customdata[0]:.4~g}, confidence %{customdata[1]:.4~g}<extra></extra>"
        ),
        unselected={"marker": {"opacity": 1}},
    )
    if recommended is not None:
        figure.add_scatter(
            x=[recommended[0]],
            y=[recommended[1]],
            mode="markers",
            hoverinfo="skip",
            name="recommended",
            marker={
                "size": 19,
                "symbol": "diamond-open",
                "color": MARKER_COLOUR,
                "line": {"width": 2},
            },
        )
    if chosen is not None and chosen[0]:
        figure.add_scatter(
            x=[chosen[0]],
            y=[chosen[1]],
            mode="markers",
            hoverinfo="skip",
            name="chosen",
            marker={
                "size": 16,
                "symbol": "circle-open",
                "color": MARKER_COLOUR,
                "line": {"width": 3},
            },
        )
    figure.update_layout(
        **figure_layout(
            360,
            margin={"l": 58, "r": 20, "b": 50},
            showlegend=False,
            clickmode="event+select",
        )
    )
    figure.update_xaxes(
        title={"text": "Number of rules"}, type="log", dtick=1, tickformat=",d", fixedrange=True
    )
    figure.update_yaxes(
        title={"text": "Coverage"}, **share_ticks(0, 1), range=[-0.03, 1.05], fixedrange=True
    )
    return figure
