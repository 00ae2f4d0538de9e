"""The features of an episode over its steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import INTERVENTION_COLOUR, MUTED_COLOUR
from sarl_core.explaining.figures.replay import Timeline
from sarl_core.explaining.markup import plain

_ROW_HEIGHT = 84
_TITLE = 18  # pixels, of a row


def feature_lines(
    features: Sequence[Feature],
    values: NDArray[np.float32],
    breaks: NDArray[np.bool_],
    timeline: Timeline,
    *,
    first: int = 0,
) -> go.Figure:
    """A small figure for each feature, one below the other, over the same steps.

    Each point carries its step in ``customdata``, as those of the strip do.

    Args:
        features: k of them, from top to bottom.
        values: Shape (T, k).
        breaks: Where a rule was broken, (T,).
        timeline: Where the steps stand.
        first: Number of the first step.

    Returns:
        Lines, and a mark at each break.
    """
    places = np.arange(len(values))
    numbers = places + first
    figure = go.Figure()
    height = _ROW_HEIGHT * len(features)
    for row, feature in enumerate(features):
        axis = "" if row == 0 else str(row + 1)
        unit = f" ({feature.unit})" if feature.unit else ""
        figure.add_scatter(
            x=places,
            y=values[:, row],
            yaxis=f"y{axis}",
            mode="lines+markers",
            line={"width": 1.6, "color": "#0072B2"},
            marker={
                "size": np.where(breaks, 6, 1),
                "color": np.where(breaks, INTERVENTION_COLOUR, MUTED_COLOUR),
                "opacity": np.where(breaks, 1.0, 0.0),
                "line": {"width": 0},
            },
            # A click selects a step; the line stays as it is.
            unselected={"marker": {"opacity": 0.0}},
            customdata=np.stack([places, numbers], axis=1),
            hovertemplate="step %{customdata[1]}: %{y:.4g}" + plain(unit) + "<extra></extra>",
        )
        top = 1 - row / len(features)
        figure.update_layout(
            {
                f"yaxis{axis}": {
                    "domain": [top - 1 / len(features), top - _TITLE / height],
                    "fixedrange": True,
                    "nticks": 3,
                    "automargin": False,
                    "zeroline": False,
                }
            }
        )
        figure.add_annotation(
            text=plain(f"{feature.name}{unit}"),
            x=0,
            y=top,
            xref="paper",
            yref="paper",
            xanchor="left",
            yanchor="top",
            showarrow=False,
        )
    figure.update_layout(
        height=height + 8 + timeline.bottom,
        margin={
            "l": timeline.left,
            "r": timeline.right,
            "t": 8,
            "b": timeline.bottom,
            "autoexpand": False,
        },
        showlegend=False,
        hovermode="closest",
        hoverdistance=-1,
        dragmode=False,
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
    )
    ticks = np.unique(np.linspace(0, len(values) - 1, min(7, len(values))).round().astype(int))
    figure.update_xaxes(
        title={"text": "step", "standoff": 2},
        anchor="y" if len(features) == 1 else f"y{len(features)}",
        fixedrange=True,
        range=timeline.range,
        tickvals=ticks,
        ticktext=[str(first + tick) for tick in ticks.tolist()],
        zeroline=False,
        automargin=False,
    )
    return figure
