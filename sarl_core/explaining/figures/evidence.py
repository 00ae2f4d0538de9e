"""Figures of the demonstrations behind rules: learning curves, and contradictions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import plotly.graph_objects as go

from sarl_core.explaining.colours import (
    INTERVENTION_COLOUR,
    LABEL_COLOURS,
    faded,
)
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.ticks import share_ticks
from sarl_core.mining.language import counted, share_text
from sarl_core.mining.validation.contradictions import EpisodeContradictions
from sarl_core.mining.validation.learning_curve import MiningCurve

CurveLayer = Literal["rules", "mean_length", "coverage", "fidelity"]
CURVE_TITLES: dict[CurveLayer, str] = {
    "rules": "Number of rules",
    "mean_length": "Mean length of a rule",
    "coverage": "Coverage of what was mined from",
    "fidelity": "Fidelity on other episodes",
}
_LINE = LABEL_COLOURS[0]
EPISODES_DRAWN = 60


def curve_figure(curve: MiningCurve, layer: CurveLayer) -> go.Figure:
    """One number of the rule sets of more and more episodes.

    Args:
        curve: Over several orders of the episodes.
        layer: Which number.

    Returns:
        The mean over the orders, and a band from the least to the most.
    """
    values = getattr(curve, layer)
    there = ~np.isnan(values).all(axis=0)
    episodes, values = curve.episodes[there].tolist(), values[:, there]
    low, mean, high = (
        np.nanmin(values, axis=0).tolist(),
        np.nanmean(values, axis=0).tolist(),
        np.nanmax(values, axis=0).tolist(),
    )
    share = layer in ("coverage", "fidelity")
    figure = go.Figure()
    figure.add_scatter(
        x=[*episodes, *episodes[::-1]],
        y=[*high, *low[::-1]],
        mode="lines",
        fill="toself",
        fillcolor=faded(_LINE, 0.18),
        line={"width": 0},
        hoverinfo="skip",
    )
    figure.add_scatter(
        x=episodes,
        y=mean,
        mode="lines+markers",
        line={"color": _LINE, "width": 2.5},
        customdata=[
            [share_text(value, decimals=1) if share else f"{value:,.1f}" for value in values]
            for values in zip(mean, low, high, strict=True)
        ],
        hovertemplate=(
            "%{x:,} episodes: %{customdata[0]}<br>%{customdata[1]} to %{customdata[2]}"
            "<extra></extra>"
        ),
    )
    _plain(figure, 230)
    figure.update_xaxes(
        title={"text": "Episodes mined from"},
        range=[0, float(curve.episodes[-1]) * 1.03],
        tickformat=",d",
    )
    figure.update_yaxes(rangemode="normal" if layer == "fidelity" else "tozero")
    if share and episodes:
        figure.update_yaxes(**share_ticks(min(low) if layer == "fidelity" else 0.0, max(high)))
    return figure


def contradictions_figure(episodes: Sequence[EpisodeContradictions]) -> go.Figure:
    """The episodes that contradict others most.

    Args:
        episodes: The one with the largest share first; the first sixty are drawn.

    Returns:
        A bar an episode.
    """
    some = episodes[:EPISODES_DRAWN]
    figure = go.Figure()
    figure.add_bar(
        x=[str(one.episode) for one in some],
        y=[one.share for one in some],
        marker={"color": INTERVENTION_COLOUR, "opacity": 0.85},
        customdata=[[one.contradicting, counted(one.steps, "step"), one.identical] for one in some],
        hovertext=[share_text(one.share, decimals=1) for one in some],
        hovertemplate=(
            "episode %{x}: %{hovertext}<br>%{customdata[0]:,} of %{customdata[1]}, "
            "%{customdata[2]:,} with an identical state<extra></extra>"
        ),
    )
    _plain(figure, 260)
    figure.update_layout(bargap=0.25)
    figure.update_xaxes(title={"text": "Episode"}, type="category", nticks=20, showgrid=False)
    figure.update_yaxes(
        title={"text": "Contradicting steps"},
        rangemode="tozero",
        **share_ticks(0.0, max((one.share for one in some), default=1.0)),
    )
    return figure


def _plain(figure: go.Figure, height: int) -> None:
    margin = {"l": 62, "r": 14, "b": 48}
    figure.update_layout(**figure_layout(height, margin=margin, showlegend=False))
    figure.update_xaxes(fixedrange=True, zeroline=False)
    figure.update_yaxes(fixedrange=True, zeroline=False)
