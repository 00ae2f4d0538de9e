"""Figures of a replay: what the shield did when, and what it was worth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.explaining.colours import (
    INTERVENTION_COLOUR,
    MUTED_COLOUR,
    OUTSIDE_COLOUR,
    label_colour,
)
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.mining.labels import LabelledDimension
from sarl_core.rollouts.steps import StepTable

SHIELDED_COLOUR = "#7A4FBF"  # no action of the usual few has it
UNSHIELDED_COLOUR = MUTED_COLOUR
_ROW_HEIGHT = 30
_LEAST_ROOM = 64  # pixels: what the numbers and the title of the returns take
_LONGEST = 22  # letters of a track's name: half of a phone is left for its steps


@dataclass(frozen=True, eq=False)
class Track:
    """One row of the strip: a label a step.

    Attributes:
        name: What the row shows, as "agent wanted".
        labels: Shape (T,), NaN where there is none.
        dimension: Whose labels these are; None for a row of marks.
        colour: Of the marks.
    """

    name: str
    labels: NDArray[np.float64]
    dimension: LabelledDimension | None
    colour: str = INTERVENTION_COLOUR


@dataclass(frozen=True, eq=False)
class ReturnLine:
    """The return of one run as it grew.

    Attributes:
        name: As "with the rules".
        returns: Sum of rewards after each step, (T,).
        colour: Of the line.
    """

    name: str
    returns: NDArray[np.float64]
    colour: str


@dataclass(frozen=True, eq=False)
class ReturnRow:
    """The returns of several episodes.

    Attributes:
        name: As "with the rules".
        returns: One an episode, (E,).
        mean: Their mean.
        low: Lower end of the 95 % interval of the mean.
        high: Its upper end.
        colour: Of the points.
    """

    name: str
    returns: NDArray[np.float64]
    mean: float
    low: float
    high: float
    colour: str


@dataclass(frozen=True)
class Timeline:
    """The steps from left to right, the same for all figures that stand above each other.

    A mark at the present step is laid over them: moving it costs nothing, while a figure that
    changes is drawn anew.

    Attributes:
        n_steps: Of the longest run.
        left: Room for names, in pixels.
        right: Room at the other side, in pixels.
        bottom: Room below the last figure, in pixels.
    """

    n_steps: int
    left: int
    right: int = 12
    bottom: int = 46

    @classmethod
    def of(cls, tracks: Sequence[Track], n_steps: int) -> Timeline:
        """With room for the names of all tracks.

        Args:
            tracks: Named at the left.
            n_steps: Of the longest run, at least 1.

        Returns:
            Where everything stands.
        """
        longest = max(len(shortened(track.name)) for track in tracks)
        return cls(n_steps, max(_LEAST_ROOM, 14 + 7 * longest))

    @property
    def range(self) -> list[float]:
        """Of the axis of steps; each step is one wide, with itself in the middle."""
        return [-0.5, max(self.n_steps, 2) - 0.5]

    def place(self, step: int) -> float:
        """Where a step stands between the two rooms, 0 to 1."""
        low, high = self.range
        return (step - low) / (high - low)


def tracks(
    steps: StepTable, dimensions: tuple[LabelledDimension, ...], *, shielded: bool
) -> tuple[Track, ...]:
    """The rows of the intervention strip.

    Args:
        steps: Of one episode, T of them.
        dimensions: The m action dimensions.
        shielded: Whether a shield was there; without one there is one row a dimension.

    Returns:
        For each dimension what the agent wanted and what was done, then the interventions, and
        at last, where there are any, those outside the data of their rules.
    """
    rows = []
    for index, dimension in enumerate(dimensions):
        name = f"{dimension.name}: " if len(dimensions) > 1 else ""
        executed = dimension.labels_of(steps.executed[:, index]).astype(np.float64)
        if not shielded:
            rows.append(Track(f"{name}action", executed, dimension))
            continue
        wanted = dimension.labels_of(steps.proposed[:, index]).astype(np.float64)
        rows.append(Track(f"{name}wanted", wanted, dimension))
        rows.append(Track(f"{name}done", executed, dimension))
    if shielded:
        marks = np.where(steps.intervened, 0.0, np.nan)
        rows.append(Track("changed", marks, None))
        if steps.outside.any():
            beyond = np.where(steps.outside, 0.0, np.nan)
            rows.append(Track("outside data", beyond, None, OUTSIDE_COLOUR))
    return tuple(rows)


def shortened(name: str) -> str:
    """The name of a track as there is room for it; what it shows stands at its end.

    Args:
        name: As "left knee torque: wanted".

    Returns:
        At most 22 letters, as "left knee to…: wanted".
    """
    if len(name) <= _LONGEST:
        return name
    about, colon, what = name.rpartition(": ")
    end = f"{colon}{what}" if about else ""
    return f"{(about or name)[: _LONGEST - 1 - len(end)]}…{end}"


def intervention_strip(
    tracks: Sequence[Track], texts: Sequence[str], timeline: Timeline
) -> go.Figure:
    """What the agent wanted, what was executed and where the two differ, step by step.

    Plotly reports no click on a heatmap, so points too small to see lie over it; each carries
    its step in ``customdata``.

    Args:
        tracks: From top to bottom.
        texts: What to say about each step, T entries.
        timeline: Where the steps stand; they are numbered by the figure below.

    Returns:
        A heatmap with T columns.
    """
    n_steps = len(texts)
    steps = np.arange(n_steps)
    figure = go.Figure()
    for row, track in enumerate(tracks):
        n_labels = track.dimension.n_labels if track.dimension is not None else 1
        figure.add_heatmap(
            x=steps,
            y=[row],
            z=track.labels[None, :],
            zmin=-0.5,
            zmax=n_labels - 0.5,
            colorscale=_steps_of_colour(track, n_labels),
            showscale=False,
            hoverinfo="skip",
            ygap=5,
        )
    figure.add_scatter(
        x=np.tile(steps, len(tracks)),
        y=np.repeat(np.arange(len(tracks)), n_steps),
        mode="markers",
        marker={"size": 1, "opacity": 0},
        customdata=np.tile(steps, len(tracks))[:, None],
        text=list(texts) * len(tracks),
        hovertemplate="%{text}<extra></extra>",
    )
    figure.update_layout(
        **figure_layout(_ROW_HEIGHT * len(tracks) + 12, showlegend=False, hoverdistance=-1)
    )
    figure.update_layout(margin=_margin(timeline, top=4, bottom=8))
    figure.update_xaxes(
        range=timeline.range,
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        showticklabels=False,
    )
    figure.update_yaxes(
        tickvals=list(range(len(tracks))),
        ticktext=[plain(shortened(track.name)) for track in tracks],
        range=[len(tracks) - 0.5, -0.5],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=6,
        automargin=False,
    )
    return figure


def return_figure(lines: Sequence[ReturnLine], timeline: Timeline) -> go.Figure:
    """The return of each run as it grew.

    Args:
        lines: One a run.
        timeline: Where the steps stand.

    Returns:
        Lines, named at the top.
    """
    figure = go.Figure()
    for line in lines:
        figure.add_scatter(
            x=np.arange(len(line.returns)),
            y=line.returns,
            mode="lines",
            name=plain(line.name),
            line={"color": line.colour, "width": 2.2},
            hovertemplate=f"{plain(line.name)}, step %{{x}}: %{{y:,.1f}}<extra></extra>",
        )
        figure.add_scatter(
            x=[len(line.returns) - 1],
            y=line.returns[-1:],
            mode="markers",
            showlegend=False,
            marker={"color": line.colour, "size": 8},
            hovertemplate=f"{plain(line.name)} ends at step %{{x}} with %{{y:,.1f}}<extra></extra>",
        )
    figure.update_layout(**figure_layout(176, showlegend=False))
    figure.update_layout(
        showlegend=len(lines) > 1,
        margin=_margin(timeline, top=26 if len(lines) > 1 else 8, bottom=timeline.bottom),
        legend={"orientation": "h", "x": 0, "y": 1.02, "xanchor": "left", "yanchor": "bottom"},
    )
    figure.update_xaxes(
        title={"text": "step", "standoff": 2},
        fixedrange=True,
        nticks=8,
        range=timeline.range,
        automargin=False,
    )
    figure.update_yaxes(
        title={"text": "return so far", "standoff": 4},
        fixedrange=True,
        nticks=5,
        automargin=False,
    )
    return figure


def comparison_figure(rows: Sequence[ReturnRow]) -> go.Figure:
    """Returns over several episodes, run against run.

    Args:
        rows: From top to bottom.

    Returns:
        A point an episode, and the mean with its 95 % interval.
    """
    figure = go.Figure()
    for position, row in enumerate(rows):
        spread = _spread(len(row.returns))
        figure.add_scatter(
            x=row.returns,
            y=position + spread,
            mode="markers",
            marker={"color": row.colour, "size": 7, "opacity": 0.45},
            customdata=np.arange(len(row.returns)) + 1,
            hovertemplate="episode %{customdata}: %{x:,.1f}<extra></extra>",
        )
        figure.add_scatter(
            x=[row.mean],
            y=[position],
            mode="markers",
            marker={"color": row.colour, "size": 13, "symbol": "diamond"},
            error_x={
                "type": "data",
                "symmetric": False,
                "array": [row.high - row.mean],
                "arrayminus": [row.mean - row.low],
                "thickness": 3,
                "width": 8,
                "color": row.colour,
            },
            hovertemplate=(
                f"mean {row.mean:,.1f}, 95 % interval {row.low:,.1f} to {row.high:,.1f}"
                "<extra></extra>"
            ),
        )
    figure.update_layout(**figure_layout(70 + 62 * len(rows), margin={"r": 12}, showlegend=False))
    figure.update_xaxes(
        title={"text": "return of an episode", "standoff": 2},
        fixedrange=True,
        nticks=8,
        zeroline=False,
    )
    figure.update_yaxes(
        tickvals=list(range(len(rows))),
        ticktext=[plain(row.name) for row in rows],
        range=[len(rows) - 0.5, -0.5],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=6,
    )
    return figure


def _spread(count: int) -> NDArray[np.float64]:
    """Small offsets, the same each time, that keep equal points apart."""
    golden = 0.6180339887498949
    numbers = np.arange(1, count + 1, dtype=np.float64)
    return np.asarray((numbers * golden % 1.0 - 0.5) * 0.42)


def _steps_of_colour(track: Track, n_labels: int) -> list[list[Any]]:
    """A colour scale of plain steps, one a label."""
    scale: list[list[Any]] = []
    for label in range(n_labels):
        colour = track.colour if track.dimension is None else label_colour(label)
        scale += [[label / n_labels, colour], [(label + 1) / n_labels, colour]]
    return scale


def _margin(timeline: Timeline, *, top: int, bottom: int) -> dict[str, Any]:
    """Fixed, so that a mark laid over the figure stands where it should."""
    return {"l": timeline.left, "r": timeline.right, "t": top, "b": bottom, "autoexpand": False}
