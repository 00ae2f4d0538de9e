"""Figures of the threshold plane: heatmaps, and the paper's surface.

Cells of a grid are drawn equally large, whatever the gaps between the thresholds: a position
counts cells, and the axis says which threshold stands there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike, NDArray

from sarl_core.explaining.colours import LAYER_SCALE, MARKER_COLOUR
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.explaining.ticks import share_ticks
from sarl_core.mining.language import number_text, share_text
from sarl_core.mining.never.landscape import NeverLandscape
from sarl_core.mining.thresholds.landscape import Landscape

Layer = Literal["rule_count", "mean_length", "coverage", "fidelity", "held_out_fidelity", "freedom"]
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LayerStyle:
    """How a layer of a landscape is shown.

    Attributes:
        title: On screen.
        unit: After the number, in words.
        share: Whether it is a share of something, from 0 to 1.
    """

    title: str
    unit: str = ""
    share: bool = False


LAYERS: dict[Layer, LayerStyle] = {
    "rule_count": LayerStyle("Number of rules", "rules"),
    "mean_length": LayerStyle("Mean length of a rule", "conditions"),
    "coverage": LayerStyle("Coverage: share of states with a rule", share=True),
    "fidelity": LayerStyle("Fidelity: share of those where the rule is right", share=True),
}
"""The layers that every landscape has."""
STYLES: dict[Layer, LayerStyle] = LAYERS | {
    "held_out_fidelity": LayerStyle("Held-out fidelity: the same on episodes held out", share=True)
}
"""Those and what there is only where episodes are held out."""
NEVER_LAYERS: dict[Layer, LayerStyle] = {
    "rule_count": LayerStyle("Number of rules", "rules"),
    "coverage": LayerStyle("Coverage: share of states with a rule", share=True),
    "fidelity": LayerStyle("Fidelity: share of those with no forbidden action", share=True),
    "freedom": LayerStyle("Freedom: what is left to choose", share=True),
}
"""The layers of rules that forbid."""

HEIGHT = 330
# Fixed, so that a mark laid over the figure stands where it should.
MARGIN = {"l": 58, "r": 66, "t": 8, "b": 50, "autoexpand": False}
_TICKS = 7


def heatmap(
    landscape: Landscape | NeverLandscape, layer: Layer, *, dark: bool = False
) -> go.Figure:
    """One layer of a landscape, a cell a pair of thresholds.

    A click on a heatmap is not reported by every host, and one on a point is: so an invisible
    point stands in every cell and carries its thresholds as `customdata`.

    Args:
        landscape: Over a grid of S supports and C confidences.
        layer: Which of its layers.
        dark: Whether it stands on dark ground.

    Returns:
        Support to the right, confidence upwards; of never-rules epsilon.
    """
    style = styles_of(landscape)[layer]
    across, word, title = _upwards(landscape)
    values = np.asarray(getattr(landscape, layer), dtype=np.float64)
    figure = go.Figure()
    bar = {
        "thickness": 10,
        "outlinewidth": 0,
        "len": 1.0,
        "y": 0.5,
        "x": 1.01,
        "tickfont": {"size": 11},
        "nticks": 6,
    }
    least = _least(landscape) if layer in ("fidelity", "held_out_fidelity") else 0.0
    if style.share:
        bar |= share_ticks(least, 1)
    shades = values
    if layer == "rule_count":
        # From one rule to thousands: by powers of ten.
        shades = np.log10(1.0 + values)
        ticks = _power_ticks(float(values.max()))
        bar |= {
            "tickmode": "array",
            "tickvals": np.log10(1.0 + np.array(ticks)).tolist(),
            "ticktext": [f"{tick:,}" for tick in ticks],
        }
    figure.add_heatmap(
        z=np.round(shades.T, 4),
        colorscale=layer_scale(dark=dark),
        hoverinfo="skip",
        colorbar=bar,
        xgap=1,
        ygap=1,
        hoverongaps=False,
        zmin=least,
        zmax=1 if style.share else None,
    )
    columns, rows = np.meshgrid(
        np.arange(len(landscape.supports)), np.arange(len(across)), indexing="ij"
    )
    figure.add_scatter(
        x=columns.ravel(),
        y=rows.ravel(),
        mode="markers",
        marker={"size": 1, "color": "rgba(0,0,0,0)"},
        customdata=_cell_data(landscape),
        hovertemplate=(
            f"support %{{customdata[0]}}, {word} %{{customdata[1]}}<br>"
            "<b>rules %{customdata[2]:,}</b>, mean length %{customdata[3]}<br>"
            "coverage %{customdata[4]}, fidelity %{customdata[5]}%{customdata[6]}<extra></extra>"
        ),
        showlegend=False,
    )
    figure.update_layout(
        **figure_layout(
            HEIGHT,
            margin=MARGIN,
            hoverdistance=-1,
            clickmode="event+select",
            font={"size": 12},
            showlegend=False,
        )
    )
    figure.update_xaxes(**_axis("Minimum support", landscape.supports))
    figure.update_yaxes(**_axis(title, across))
    return figure


def _upwards(landscape: Landscape | NeverLandscape) -> tuple[Floats, str, str]:
    """The thresholds beside the supports, what one is called, and the title of their axis."""
    if isinstance(landscape, NeverLandscape):
        return landscape.epsilons, "epsilon", "Epsilon"
    return landscape.confidences, "confidence", "Minimum confidence"


def position(value: float, grid: ArrayLike) -> float:
    """Where a threshold stands among the cells of a grid.

    Args:
        value: A threshold.
        grid: The thresholds of the cells, ascending, at least one.

    Returns:
        Cell number, with a fraction between two cells; at most at the outermost cells.
    """
    grid = np.asarray(grid, dtype=np.float64)
    return float(np.interp(value, grid, np.arange(len(grid))))


def styles_of(landscape: Landscape | NeverLandscape) -> dict[Layer, LayerStyle]:
    """How the layers of a landscape are shown."""
    return NEVER_LAYERS if isinstance(landscape, NeverLandscape) else STYLES


def mark_place(
    landscape: Landscape | NeverLandscape, support: float, confidence: float
) -> tuple[float, float]:
    """Where thresholds stand in a heatmap, as shares of its width and height.

    For a mark that is laid over the figure: moving it costs nothing, while a figure that changes
    is drawn anew.

    Args:
        landscape: What the heatmap shows.
        support: Minimum support.
        confidence: Minimum confidence; of never-rules epsilon.

    Returns:
        From the left and from the top of the area within `MARGIN`, each 0 to 1.
    """
    across = (position(support, landscape.supports) + 0.5) / len(landscape.supports)
    rows, _, _ = _upwards(landscape)
    upwards = (position(confidence, rows) + 0.5) / len(rows)
    return across, 1.0 - upwards


def surface(
    landscape: Landscape | NeverLandscape,
    layer: Layer,
    *,
    dark: bool = False,
    chosen: tuple[float, float, float] | None = None,
) -> go.Figure:
    """One layer as the paper's three-dimensional surface (its Figures 2 and 3).

    Args:
        landscape: Over a grid.
        layer: Which of its layers.
        dark: Whether it stands on dark ground.
        chosen: Support, confidence (of never-rules epsilon) and height of a point to mark.

    Returns:
        To be turned with the mouse.
    """
    style = styles_of(landscape)[layer]
    upwards, word, title = _upwards(landscape)
    values = np.asarray(getattr(landscape, layer), dtype=np.float64)
    ink = "#c5d0d8" if dark else "#3b4954"
    columns = np.arange(len(landscape.supports))
    rows = np.arange(len(upwards))
    figure = go.Figure()
    figure.add_surface(
        x=columns,
        y=rows,
        z=values.T,
        colorscale=layer_scale(dark=dark),
        showscale=False,
        customdata=np.moveaxis(_cell_data(landscape).reshape(len(columns), len(rows), -1), 0, 1),
        hovertemplate=(
            f"support %{{customdata[0]}}, {word} %{{customdata[1]}}<br>"
            "<b>rules %{customdata[2]:,}</b>, mean length %{customdata[3]}<br>"
            "coverage %{customdata[4]}, fidelity %{customdata[5]}%{customdata[6]}<extra></extra>"
        ),
    )
    if chosen is not None and np.isfinite(chosen[2]):
        figure.add_scatter3d(
            x=[position(chosen[0], landscape.supports)],
            y=[position(chosen[1], upwards)],
            z=[chosen[2]],
            mode="markers",
            marker={"size": 6, "color": MARKER_COLOUR},
            hoverinfo="skip",
            showlegend=False,
        )
    plain = {
        "gridcolor": "rgba(128,128,128,0.35)",
        "showbackground": False,
        "color": ink,
        "zeroline": False,
    }
    across = _axis("Minimum support", landscape.supports, most=5)
    along = _axis(title, upwards, most=5)
    keep = ("tickmode", "tickvals", "ticktext", "range")
    figure.update_layout(
        height=420,
        margin={"l": 0, "r": 0, "t": 8, "b": 0},
        paper_bgcolor="rgba(0,0,0,0)",
        scene={
            "xaxis": {key: across[key] for key in keep} | plain | {"title": {"text": "support"}},
            "yaxis": {key: along[key] for key in keep} | plain | {"title": {"text": word}},
            "zaxis": {
                "title": {"text": style.unit or layer},
                "rangemode": "tozero",
                **plain,
                **(share_ticks(0, 1) if style.share else {}),
            },
            "camera": {"eye": {"x": 1.75, "y": -1.85, "z": 1.1}, "center": {"z": -0.12}},
            "aspectmode": "manual",
            "aspectratio": {"x": 1.1, "y": 1.1, "z": 0.75},
        },
    )
    return figure


def landscape_figure(landscape: Landscape | NeverLandscape, *, title: str = "") -> go.Figure:
    """The four layers of a landscape on one sheet, for a file.

    Args:
        landscape: Over a grid.
        title: Above them.

    Returns:
        Two rows of two heatmaps, with an opaque ground.
    """
    from plotly.subplots import make_subplots

    layers = NEVER_LAYERS if isinstance(landscape, NeverLandscape) else LAYERS
    figure = make_subplots(
        rows=2,
        cols=2,
        horizontal_spacing=0.14,
        vertical_spacing=0.15,
        subplot_titles=[style.title for style in layers.values()],
    )
    for number, layer in enumerate(layers):
        row, column = divmod(number, 2)
        part = heatmap(landscape, layer)
        cells, points = part.data
        cells.colorbar.update(
            x=0.435 + 0.57 * column, y=0.79 - 0.575 * row, len=0.425, xanchor="left"
        )
        figure.add_trace(cells, row=row + 1, col=column + 1)
        figure.add_trace(points, row=row + 1, col=column + 1)
        figure.update_xaxes(part.layout.xaxis, row=row + 1, col=column + 1)
        figure.update_yaxes(part.layout.yaxis, row=row + 1, col=column + 1)
    ground, ink = "#ffffff", "#1d2730"
    figure.update_layout(
        title={"text": plain(title), "x": 0.02, "font": {"size": 17}} if title else None,
        width=1080,
        height=860,
        margin={"l": 70, "r": 70, "t": 90 if title else 50, "b": 60},
        paper_bgcolor=ground,
        plot_bgcolor=ground,
        font={"color": ink, "size": 12},
        hoverdistance=-1,
        hovermode="closest",
        showlegend=False,
    )
    figure.update_annotations(font={"size": 14})
    return figure


def _least(landscape: Landscape | NeverLandscape) -> float:
    """Where the colours of a fidelity begin, and of both where there are two, to compare them."""
    both = [landscape.fidelity]
    if isinstance(landscape, Landscape) and landscape.held_out_fidelity is not None:
        both.append(landscape.held_out_fidelity)
    values = np.stack(both)
    return float(np.nanmin(values)) if np.isfinite(values).any() else 0.0


def _cell_data(landscape: Landscape | NeverLandscape) -> NDArray[np.object_]:
    """What is said of each cell, from its thresholds to what follows the fidelity; (S * C, 7)."""
    supports = [float(value) for value in landscape.supports]
    confidences = [float(value) for value in _upwards(landscape)[0]]
    rows: list[list[Any]] = []
    layers = zip(
        landscape.rule_count.tolist(),
        landscape.mean_length.tolist(),
        landscape.coverage.tolist(),
        landscape.fidelity.tolist(),
        _further_words(landscape),
        strict=True,
    )
    for support, (counts, lengths, covered, right, tried) in zip(supports, layers, strict=True):
        rows += [
            [
                support,
                confidence,
                count,
                f"{length:.1f}",
                share_text(share, decimals=1),
                share_text(truth, decimals=1),
                other,
            ]
            for confidence, count, length, share, truth, other in zip(
                confidences, counts, lengths, covered, right, tried, strict=True
            )
        ]
    return np.array(rows, dtype=object)


def _further_words(landscape: Landscape | NeverLandscape) -> list[list[str]]:
    """What follows the fidelity of each cell, (S, C)."""
    if isinstance(landscape, NeverLandscape):
        return [
            [f", freedom {share_text(value, decimals=1)}" for value in row]
            for row in landscape.freedom.tolist()
        ]
    if landscape.held_out_fidelity is None:
        return [[""] * len(landscape.confidences)] * len(landscape.supports)
    return [
        [f", held out {share_text(value, decimals=1)}" for value in row]
        for row in landscape.held_out_fidelity.tolist()
    ]


def _axis(title: str, grid: Floats, most: int = _TICKS) -> dict[str, Any]:
    every = max(1, -(-(len(grid) - 1) // (most - 1)))
    ticks = list(range(0, len(grid), every))
    if len(grid) - 1 not in ticks:
        # The last threshold is worth a label; one too close to it is not.
        if len(grid) - 1 - ticks[-1] < every:
            ticks.pop()
        ticks.append(len(grid) - 1)
    return {
        "title": {"text": title, "standoff": 8},
        "range": [-0.5, len(grid) - 0.5],
        "tickmode": "array",
        "tickvals": ticks,
        "ticktext": [number_text(float(grid[tick])) for tick in ticks],
        "fixedrange": True,
        "showgrid": False,
        "zeroline": False,
        "automargin": False,
    }


def _power_ticks(top: float) -> list[int]:
    return [0, *(10**power for power in range(7) if 10**power <= max(top, 1.0))]


def layer_scale(*, dark: bool) -> list[list[Any]]:
    """The colour scale of a layer.

    Args:
        dark: Whether it stands on dark ground.

    Returns:
        Pairs of place and colour.
    """
    if dark:  # nothing is as dark as the ground, much is light
        shades = [shade for _, shade in LAYER_SCALE][::-1]
        return [[at, shade] for (at, _), shade in zip(LAYER_SCALE, shades, strict=True)]
    return [[at, shade] for at, shade in LAYER_SCALE]
