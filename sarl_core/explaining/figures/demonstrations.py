"""Figures of what demonstrations contain: features, actions, episodes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.decimals import decimal_text, float32_decimal
from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import MUTED_COLOUR, faded, label_colour
from sarl_core.explaining.figures.distributions import EpisodeSeries, Histogram
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.mining.action_words import label_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import number_text

FEATURE_HEIGHT = 170
ACTION_HEIGHT = 210
EPISODE_HEIGHT = 230


def feature_figure(
    feature: Feature, histogram: Histogram, dimension: LabelledDimension
) -> go.Figure:
    """How often a feature takes which value, coloured by the action taken there.

    Args:
        feature: Its name and unit.
        histogram: Counts by label.
        dimension: Whose labels these are.

    Returns:
        Stacked bars.
    """
    figure = go.Figure()
    total = max(histogram.total, 1)
    texts = _bin_texts(histogram, feature)
    positions: Any = histogram.centres
    widths: Any = np.diff(histogram.edges)
    if histogram.values is not None:
        positions, widths = _value_texts(histogram.values, feature), 0.72
    for label in range(dimension.n_labels):
        name = plain(label_text(label, dimension))
        figure.add_bar(
            x=positions,
            y=100 * histogram.counts[label] / total,
            width=widths,
            marker={"color": label_colour(label), "line": {"width": 0}},
            name=name,
            customdata=texts,
            hovertemplate=f"%{{customdata}}<br>{name}: %{{y:.2f}} % of the steps<extra></extra>",
        )
    figure.update_layout(
        **figure_layout(FEATURE_HEIGHT, showlegend=False), barmode="stack", bargap=0
    )
    figure.update_xaxes(
        nticks=5,
        fixedrange=True,
        type="category" if histogram.values is not None else "linear",
    )
    figure.update_yaxes(nticks=4, rangemode="tozero", ticksuffix=" %", fixedrange=True)
    return figure


def action_figure(histogram: Histogram, dimension: LabelledDimension) -> go.Figure:
    """How often each action was taken.

    Args:
        histogram: Counts by label; of a discrete dimension one bin a label.
        dimension: The action dimension.

    Returns:
        Discrete: a bar a label. Continuous: bars in the colours of the intervals.
    """
    total = max(int(histogram.counts.sum()), 1)
    figure = go.Figure()
    if not dimension.is_interval:
        shares = 100 * histogram.counts.sum(axis=1) / total
        figure.add_bar(
            y=[plain(name) for name in dimension.label_names],
            x=shares,
            orientation="h",
            marker={"color": [label_colour(label) for label in range(dimension.n_labels)]},
            text=[f"{share:.1f} %" for share in shares],
            textposition="outside",
            cliponaxis=False,
            customdata=histogram.counts.sum(axis=1),
            hovertemplate="%{y}: %{customdata:,} steps<extra></extra>",
        )
        height = 40 + 34 * dimension.n_labels
        figure.update_layout(**figure_layout(min(height, 900), showlegend=False))
        figure.update_xaxes(
            visible=False, range=[0, max(float(shares.max()), 1.0) * 1.25], fixedrange=True
        )
        # A category, said so: Plotly takes names such as "0" and "1" for numbers.
        figure.update_yaxes(
            type="category", autorange="reversed", fixedrange=True, ticklabelstandoff=6
        )
        return figure
    texts = _bin_texts(histogram, Feature(""))
    for label in range(dimension.n_labels):
        name = plain(label_text(label, dimension))
        figure.add_bar(
            x=histogram.centres,
            y=100 * histogram.counts[label] / total,
            width=np.diff(histogram.edges),
            marker={"color": label_colour(label), "line": {"width": 0}},
            name=name,
            customdata=texts,
            hovertemplate="%{customdata}<br>%{y:.2f} % of the steps<extra></extra>",
        )
    for edge in dimension.inner_edges:
        figure.add_vline(x=edge, line={"color": MUTED_COLOUR, "width": 1, "dash": "dot"})
    figure.update_layout(
        **figure_layout(ACTION_HEIGHT, showlegend=False), barmode="stack", bargap=0
    )
    figure.update_xaxes(fixedrange=True, range=[histogram.edges[0], histogram.edges[-1]])
    figure.update_yaxes(nticks=4, rangemode="tozero", ticksuffix=" %", fixedrange=True)
    return figure


def episode_figure(series: EpisodeSeries, name: str, colour: str) -> go.Figure:
    """One number an episode, in the order of the episodes.

    Args:
        series: The numbers; neighbours stand together where there are many.
        name: What the number is, as "return".
        colour: Of the points.

    Returns:
        Points; a group shows its mean and its range. Unfinished episodes are hollow.
    """
    figure = go.Figure()
    texts = [
        f"episodes {first} to {last}: {name} {mean:,.1f} on average, {low:,.1f} to {high:,.1f}"
        if last > first
        else f"episode {first}: {name} {mean:,.1f}"
        + (" (recording stopped here)" if open_ended else "")
        for first, last, mean, low, high, open_ended in zip(
            series.first.tolist(),
            series.last.tolist(),
            series.mean.tolist(),
            series.low.tolist(),
            series.high.tolist(),
            series.unfinished.tolist(),
            strict=True,
        )
    ]
    if series.is_grouped:
        figure.add_scatter(
            x=np.concatenate([series.first, series.first[::-1]]),
            y=np.concatenate([series.high, series.low[::-1]]),
            fill="toself",
            mode="none",
            fillcolor=faded(colour, 0.2),
            hoverinfo="skip",
        )
    symbols = np.where(series.unfinished & (series.first == series.last), "circle-open", "circle")
    figure.add_scatter(
        x=series.first,
        y=series.mean,
        mode="markers",
        marker={"color": colour, "size": 6, "symbol": symbols, "opacity": 0.85},
        text=texts,
        hovertemplate="%{text}<extra></extra>",
    )
    figure.update_layout(**figure_layout(EPISODE_HEIGHT, showlegend=False))
    figure.update_xaxes(title={"text": "episode", "standoff": 4}, nticks=6, fixedrange=True)
    figure.update_yaxes(nticks=5, fixedrange=True)
    if float(series.low.min()) == float(series.high.max()):
        # All the same: a bare line at mid-height says less than one with room down to zero.
        value = float(series.high.max())
        figure.update_yaxes(range=sorted([0.0, value * 1.15 if value else 1.0]))
    return figure


def _value_texts(values: NDArray[np.float64], feature: Feature) -> list[str]:
    if feature.indicator is not None:
        return ["yes" if value else "no" for value in values.tolist()]
    return [decimal_text(float32_decimal(value)) for value in values.tolist()]


def _bin_texts(histogram: Histogram, feature: Feature) -> list[str]:
    suffix = f" {plain(feature.unit)}" if feature.unit else ""
    if histogram.values is not None:
        return [f"{text}{suffix}" for text in _value_texts(histogram.values, feature)]
    return [
        f"{number_text(low, apart_from=high)} to {number_text(high, apart_from=low)}{suffix}"
        for low, high in pairwise(histogram.edges.tolist())
    ]
