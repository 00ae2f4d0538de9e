"""Figures of dividing continuous actions: where the values lie, what is lost, what it costs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go

from sarl_core.explaining.colours import MUTED_COLOUR
from sarl_core.explaining.figures.thresholds import layer_scale
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.mining.language import number_text, share_text
from sarl_core.mining.quantisation import SNAPPINGS, Quantisation, Snapping
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.statistics import MeanInterval

_ROW_HEIGHT = 38
_DARK_INK, _LIGHT_INK = "#0e161b", "#ffffff"
_DARKENING = 0.7  # place on the scale from which on its shades are too dark for dark ink
_LEAST_LABELLED = 0.1  # share of the range below which a percentage finds no room


def occupancy_figure(divided: Sequence[Quantisation], *, dark: bool = False) -> go.Figure:
    """Where the demonstrated values of one action dimension lie, a row a divider.

    Args:
        divided: One dimension, divided in several ways.
        dark: Whether it stands on dark ground.

    Returns:
        The action's values to the right; a box is an interval, the darker the more was shown
        there. What was never shown is hatched.
    """
    highest = max(float(each.occupancy.max()) for each in divided)
    figure = go.Figure()
    for each in divided:
        edges = each.dimension.edges
        widths = np.diff(edges)
        empty = each.counts == 0
        shares = [share_text(float(share)) for share in each.occupancy]
        roomy = widths >= _LEAST_LABELLED * each.width
        figure.add_bar(
            orientation="h",
            base=list(edges[:-1]),
            x=widths,
            y=[_intervals(each.divider)] * each.divider,
            width=0.82,
            text=[text if fits else "" for text, fits in zip(shares, roomy, strict=True)],
            textposition="inside",
            insidetextanchor="middle",
            textangle=0,
            insidetextfont={
                "color": [_ink(share / highest, dark=dark) for share in each.occupancy.tolist()]
            },
            constraintext="none",
            cliponaxis=False,
            marker={
                "color": each.occupancy,
                "cmin": 0.0,
                "cmax": highest,
                "colorscale": layer_scale(dark=dark),
                "line": {"color": MUTED_COLOUR, "width": 1},
                "pattern": {
                    "shape": ["x" if nothing else "" for nothing in empty],
                    "fgcolor": MUTED_COLOUR,
                    "size": 6,
                    "solidity": 0.25,
                },
            },
            customdata=[
                [
                    number_text(low, apart_from=high),
                    number_text(high, apart_from=low),
                    "never shown" if nothing else f"{share} of the steps",
                    number_text(median),
                ]
                for low, high, nothing, share, median in zip(
                    edges[:-1], edges[1:], empty, shares, each.medians.tolist(), strict=True
                )
            ],
            hovertemplate=(
                "from %{customdata[0]} to %{customdata[1]}: <b>%{customdata[2]}</b><br>"
                "the typical value there is %{customdata[3]}<extra></extra>"
            ),
        )
    first = divided[0].dimension
    figure.update_layout(
        **figure_layout(64 + _ROW_HEIGHT * len(divided), showlegend=False), barmode="overlay"
    )
    figure.update_xaxes(
        title={"text": plain(first.name), "standoff": 2},
        range=[first.edges[0], first.edges[-1]],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        nticks=7,
    )
    figure.update_yaxes(
        autorange="reversed",
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=4,
    )
    return figure


def error_figure(
    quantisations: Sequence[Sequence[Quantisation]], *, dark: bool = False
) -> go.Figure:
    """How far snapping moves the demonstrated actions, as a share of their range.

    Args:
        quantisations: For each action dimension one entry a divider.
        dark: Whether it stands on dark ground.

    Returns:
        Dividers to the right, a row for each dimension and way to snap. ``clip`` moves nothing
        and has no row.
    """
    rows, values, texts = [], [], []
    for divided in quantisations:
        for snapping in SNAPPINGS:
            if snapping == "clip":
                continue
            name = (
                snapping if len(quantisations) == 1 else f"{divided[0].dimension.name}, {snapping}"
            )
            rows.append(plain(name))
            shares = [each.share_of_width(snapping) for each in divided]
            values.append(shares)
            texts.append([share_text(share) for share in shares])
    columns = [_intervals(each.divider) for each in quantisations[0]]
    figure = _cells(columns, rows, values, texts, dark=dark, least=0.0)
    figure.data[0].hovertemplate = "%{y}, %{x}: %{text} of the range<extra></extra>"
    return figure


def snapped_figure(
    dividers: Sequence[int],
    by_cell: Mapping[tuple[int, Snapping], Episodes],
    *,
    projections: Sequence[Snapping] = SNAPPINGS,
    dark: bool = False,
) -> go.Figure:
    """The typical return of the expert with snapped actions.

    Args:
        dividers: Columns.
        by_cell: Episodes by divider and way to snap; cells without any stay empty.
        projections: Rows, from top to bottom.
        dark: Whether it stands on dark ground.

    Returns:
        In each cell the interquartile mean, its 95 % interval, and how many of the episodes failed.
    """
    cells = {}
    for key, episodes in by_cell.items():
        known = episodes.failures
        typical = MeanInterval(
            episodes.statistics.iqm, episodes.statistics.low, episodes.statistics.high
        )
        cells[key] = TypicalReturn(typical, math.nan if known is None else known.rate)
    return typical_cells_figure(dividers, cells, projections=projections, dark=dark)


@dataclass(frozen=True)
class TypicalReturn:
    """What stands in a cell.

    Attributes:
        typical: The typical return (IQM) and its 95 % interval.
        failure_rate: Share of the episodes that failed; NaN where it is not known.
    """

    typical: MeanInterval
    failure_rate: float


def typical_cells_figure(
    dividers: Sequence[int],
    by_cell: Mapping[tuple[int, Snapping], TypicalReturn],
    *,
    projections: Sequence[Snapping] = SNAPPINGS,
    dark: bool = False,
) -> go.Figure:
    """Typical returns and shares of failures of the expert with snapped actions.

    Args:
        dividers: Columns.
        by_cell: By divider and way to snap; cells without any stay empty.
        projections: Rows, from top to bottom.
        dark: Whether it stands on dark ground.

    Returns:
        In each cell the typical return, its 95 % interval, and how many of the episodes failed.
    """
    values: list[list[float | None]] = []
    texts: list[list[str]] = []
    for projection in projections:
        each = [by_cell.get((divider, projection)) for divider in dividers]
        values.append([None if one is None else one.typical.mean for one in each])
        texts.append(["" if one is None else _typical_text(one) for one in each])
    columns = [_intervals(divider) for divider in dividers]
    figure = _cells(columns, list(projections), values, texts, dark=dark, row_height=72)
    figure.data[
        0
    ].hovertemplate = "%{y}, %{x}<br>typical return and its 95 % interval: %{text}<extra></extra>"
    return figure


def _typical_text(one: TypicalReturn) -> str:
    typical = one.typical
    text = f"<b>{typical.mean:,.0f}</b>"
    if not math.isnan(typical.low):
        text += f"<br>{typical.low:,.0f} to {typical.high:,.0f}"
    if math.isnan(one.failure_rate):
        return text
    return f"{text}<br>{share_text(one.failure_rate)} fail"


def _cells(
    columns: Sequence[str],
    rows: Sequence[str],
    values: Sequence[Sequence[float | None]],
    texts: Sequence[Sequence[str]],
    *,
    dark: bool,
    least: float | None = None,
    row_height: int = _ROW_HEIGHT,
) -> go.Figure:
    figure = go.Figure()
    known = [value for row in values for value in row if value is not None]
    low = min(known, default=0.0) if least is None else least
    span = (max(known, default=1.0) - low) or 1.0
    figure.add_heatmap(
        x=list(columns),
        y=list(rows),
        z=[list(row) for row in values],
        zmin=low,
        zmax=low + span,
        text=[list(row) for row in texts],
        colorscale=layer_scale(dark=dark),
        showscale=False,
        hoverongaps=False,
        xgap=2,
        ygap=2,
    )
    # Words of a heatmap have one colour for all; on the shades between they need their own.
    places = [(x, y) for y in range(len(rows)) for x in range(len(columns))]
    figure.add_scatter(
        x=[columns[x] for x, _ in places],
        y=[rows[y] for _, y in places],
        mode="text",
        text=[texts[y][x] for x, y in places],
        textfont={
            "color": [_ink(((values[y][x] or 0.0) - low) / span, dark=dark) for x, y in places]
        },
        hoverinfo="skip",
    )
    figure.update_layout(**figure_layout(44 + row_height * len(rows), showlegend=False))
    figure.update_xaxes(side="bottom", fixedrange=True, showgrid=False, zeroline=False)
    figure.update_yaxes(
        autorange="reversed",
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=4,
    )
    return figure


def _ink(place: float, *, dark: bool) -> str:
    """What is legible on a shade, by its place on the scale."""
    shade = 1.0 - place if dark else place
    return _LIGHT_INK if shade > _DARKENING else _DARK_INK


def _intervals(divider: int) -> str:
    return f"{divider} intervals"
