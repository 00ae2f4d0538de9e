"""One number of every recording, for several ways to act."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.explaining.colours import faded
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.explaining.ticks import share_ticks
from sarl_core.mining.language import counted, share_text
from sarl_core.rollouts.statistics import MeanInterval

_SYMBOLS = ("circle", "square", "diamond", "triangle-up", "x")  # one an expert
_APART = 0.22  # of the dots from their mean, in rows


def recordings_figure(
    values: Mapping[str, NDArray[np.float64]],
    means: Mapping[str, MeanInterval],
    *,
    experts: Sequence[str],
    colours: Mapping[str, str],
    title: str,
    share: bool = False,
) -> go.Figure:
    """A row for each way to act: a dot a recording, and above it their mean with its interval.

    Args:
        values: By way to act, one number a recording, (R,).
        means: Of these, with 95 % intervals.
        experts: The expert of each recording, R; each has a symbol of its own.
        colours: By way to act.
        title: Of the axis.
        share: Whether the numbers are shares.

    Returns:
        Rows from top to bottom, numbers to the right.
    """
    figure = go.Figure()
    names = list(dict.fromkeys(experts))
    symbols = [_SYMBOLS[names.index(expert) % len(_SYMBOLS)] for expert in experts]

    def text(value: float) -> str:
        return share_text(min(max(value, 0.0), 1.0)) if share else f"{value:,.1f}"

    def spread(mean: MeanInterval) -> str:
        recordings = f"{counted(len(experts), 'recording')} of {counted(len(names), 'expert')}"
        if math.isnan(mean.low):
            return recordings
        return f"95 % interval over {recordings}: {text(mean.low)} to {text(mean.high)}"

    for row, (name, own) in enumerate(values.items()):
        mean, colour = means[name], colours[name]
        figure.add_scatter(
            x=own,
            y=[row + _APART] * len(own),
            mode="markers",
            marker={"color": faded(colour, 0.6), "size": 8, "symbol": symbols},
            customdata=[
                [number + 1, plain(expert), text(value)]
                for number, (expert, value) in enumerate(zip(experts, own.tolist(), strict=True))
            ],
            hovertemplate=f"{plain(name)}, recording %{{customdata[0]}} of expert "
            "%{customdata[1]}: <b>%{customdata[2]}</b><extra></extra>",
        )
        figure.add_scatter(
            x=[mean.mean],
            y=[row - _APART / 2],
            mode="markers+text",
            text=[text(mean.mean)],
            textposition="top center",
            cliponaxis=False,
            marker={"color": colour, "size": 11},
            error_x={
                "type": "data",
                "symmetric": False,
                "array": [mean.high - mean.mean],
                "arrayminus": [mean.mean - mean.low],
                "thickness": 3,
                "width": 7,
                "color": colour,
            },
            hovertemplate=f"{plain(name)}: <b>{text(mean.mean)}</b><br>{spread(mean)}"
            "<extra></extra>",
        )
    rows = len(values)
    axis = {"range": [-0.04, 1.06], **share_ticks(0, 1)} if share else {"nticks": 6}
    figure.update_layout(
        **figure_layout(
            330,
            margin={"r": 24},
            showlegend=False,
        )
    )
    figure.update_xaxes(
        title={"text": title, "standoff": 2}, fixedrange=True, zeroline=False, **axis
    )
    figure.update_yaxes(
        tickvals=list(range(rows)),
        ticktext=[plain(name) for name in values],
        range=[rows - 0.4, -0.8],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=6,
    )
    return figure
