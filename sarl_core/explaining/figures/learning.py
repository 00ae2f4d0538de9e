"""Figures of learning under a shield: how it went, and what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from sarl_core.decimals import rounded_text
from sarl_core.explaining.colours import LABEL_COLOURS, MUTED_COLOUR, faded
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.ticks import share_ticks
from sarl_core.files import whole_file
from sarl_core.learning.arms import LearningArm
from sarl_core.learning.study_files import LearningRun, LearningStudy
from sarl_core.learning.summary import (
    SAFE_SHARE,
    ArmSummary,
    ComparedSummary,
    summarise_compared,
    summarise_study,
)
from sarl_core.mining.language import share_text

_BLUE, _ORANGE, _GREEN, _PINK, _SKY, _, _, _VIOLET, _BROWN, _ = LABEL_COLOURS
_COLOURS = {
    "none": MUTED_COLOUR,
    "override": _ORANGE,
    "penalty": _PINK,
    "executed": _SKY,
    "mask": _BLUE,
    "imitate": _GREEN,
    "handover": _VIOLET,
    "none-replay": MUTED_COLOUR,
    "replay": _BROWN,
}
_GOOD, _CORNER = "#009E73", "safe and good"
_BINS = 24
_PANELS = ("return of an episode", "failures so far", "changed by the rules")
_ROW_HEIGHT = 46
_NARROW = (295, 380)  # pixels of a plot on a narrow screen
_POINT, _GAP, _LETTER, _LINE = 8, 11, 6.8, 15  # pixels of a point and of its name
_UPS = (0, 17, -17, 34, -34, 51, -51)
_Box = tuple[float, float, float, float]


def arm_colour(arm: LearningArm) -> str:
    """The colour of an arm, the same in every figure.

    Args:
        arm: Any.

    Returns:
        As "#0072B2".
    """
    return _COLOURS[arm.name]


def curves_figure(study: LearningStudy, *, height: int = 720) -> go.Figure:
    """How learning went: return, failures so far, and how often the rules changed an action.

    Args:
        study: Finished, or at work: then each line ends where its runs are.
        height: In pixels.

    Returns:
        Three panels above each other; a line an arm, the mean of its seeds, in a band from the
        least to the largest. A click on a name hides its lines.
    """
    figure = make_subplots(rows=3, cols=1, shared_xaxes=True, vertical_spacing=0.05)
    for arm in study.arms:
        runs = [run for run in study.runs if run.arm == arm and len(run.curve)]
        if not runs:
            continue
        edges = np.linspace(0, study.steps, _BINS + 1).round().astype(np.int64)
        for row, values in enumerate(_panels(runs, edges, shielded=arm.shielded), start=1):
            x = edges if row == 2 else (edges[:-1] + edges[1:]) / 2
            _line(figure, arm, x, values, row)
    figure.update_layout(
        **figure_layout(height, margin={"r": 16}),
        showlegend=True,
        legend={
            "orientation": "h",
            "x": 0,
            "y": 1.01,
            "xanchor": "left",
            "yanchor": "bottom",
            "itemwidth": 30,
        },
    )
    figure.update_xaxes(
        range=[0, study.steps], fixedrange=True, nticks=7, tickformat=",d", zeroline=False
    )
    figure.update_xaxes(title={"text": "steps of learning", "standoff": 2}, row=3, col=1)
    for row, title in enumerate(_PANELS, start=1):
        figure.update_yaxes(
            title={"text": title, "standoff": 14},
            automargin=True,
            fixedrange=True,
            nticks=6,
            zeroline=False,
            row=row,
            col=1,
        )
    figure.update_yaxes(rangemode="tozero", row=2, col=1)
    figure.update_yaxes(**share_ticks(0, 1), range=[0, 1], row=3, col=1)
    return figure


def outcome_figure(
    summaries: Sequence[ArmSummary],
    compared: ComparedSummary | None = None,
    *,
    height: int = 460,
) -> go.Figure:
    """Safe while learning against good afterwards, a point an arm.

    Args:
        summaries: Of `summarise_study`.
        compared: Of `summarise_compared`: a dashed line, because it has not learned.
        height: In pixels.

    Returns:
        Failures while learning to the right, return afterwards without a shield upwards; small
        points are single learners. The shaded corner is where an arm is both.
    """
    figure = go.Figure()
    plain = next((one for one in summaries if one.arm.name == "none"), None)
    crashes = [count for one in summaries for count in one.crashes] or [0]
    means = [mean for one in summaries for mean in one.alone.means] or [0.0]
    means += [] if compared is None else [compared.alone.mean]
    width = max(crashes) * 1.12 + 1
    span = max(max(means) - min(means), 1.0)
    bottom, top = min(means) - 0.1 * span, max(means) + 0.16 * span
    if plain is not None:
        figure.add_shape(
            type="rect",
            x0=-0.02 * width,
            x1=SAFE_SHARE * plain.mean_crashes,
            y0=plain.alone.mean,
            y1=top,
            fillcolor=faded(_GOOD, 0.12),
            line={"width": 0},
            layer="below",
        )
        figure.add_annotation(
            x=SAFE_SHARE * plain.mean_crashes,
            y=top,
            text=_CORNER,
            showarrow=False,
            xanchor="right",
            yanchor="top",
            font={"color": _GOOD},
        )
    if compared is not None:
        figure.add_hline(
            y=compared.alone.mean,
            line={"color": MUTED_COLOUR, "width": 1.5, "dash": "dash"},
            annotation={
                "text": compared.agent,
                "font": {"color": MUTED_COLOUR},
                "xanchor": "right",
            },
        )
    for one, place in zip(summaries, _label_places(summaries, (bottom, top), width), strict=True):
        colour = arm_colour(one.arm)
        figure.add_scatter(
            x=one.crashes,
            y=one.alone.means,
            mode="markers",
            marker={"color": colour, "size": 6, "opacity": 0.5, "symbol": _symbol(one.arm)},
            customdata=one.seeds,
            hovertemplate=(
                f"{one.arm.title}, seed %{{customdata}}<br>%{{x:,}} failures while learning<br>"
                "return afterwards %{y:,.0f}<extra></extra>"
            ),
        )
        figure.add_scatter(
            x=[one.mean_crashes],
            y=[one.alone.mean],
            mode="markers",
            text=[f"<b>{one.arm.title}</b>"],
            cliponaxis=False,
            marker={
                "color": colour,
                "size": 14,
                "symbol": _symbol(one.arm),
                "line": {"width": 1, "color": "#ffffff"},
            },
            hovertemplate=(
                f"{one.arm.title}<br>%{{x:,.0f}} failures while learning<br>return afterwards "
                f"%{{y:,.0f}}<br>mean of {len(one.seeds)}<extra></extra>"
            ),
        )
        figure.add_annotation(
            x=one.mean_crashes,
            y=one.alone.mean,
            text=f"<b>{one.arm.title}</b>",
            showarrow=False,
            xanchor="right" if place.left else "left",
            xshift=-_GAP if place.left else _GAP,
            yshift=place.up,
            font={"size": 12},
        )
    figure.update_layout(**figure_layout(height, margin={"r": 16}, showlegend=False))
    figure.update_xaxes(
        title={"text": "failures while learning", "standoff": 2},
        range=[-0.02 * width, width],
        fixedrange=True,
        nticks=7,
        zeroline=False,
    )
    figure.update_yaxes(
        title={"text": "return afterwards, shield off", "standoff": 14},
        automargin=True,
        range=[bottom, top],
        fixedrange=True,
        nticks=7,
        zeroline=False,
    )
    return figure


def afterwards_figure(
    summaries: Sequence[ArmSummary], compared: ComparedSummary | None = None
) -> go.Figure:
    """Returns after learning, with the shield taken off and with it on.

    Args:
        summaries: Of `summarise_study`.
        compared: Of `summarise_compared`.

    Returns:
        A row an arm, and one of the agent that they are compared with: interquartile means with
        their 95 % intervals, filled without the shield, hollow with it; the dotted line is PPO
        that never had a shield.
    """
    figure = go.Figure()
    plain = next((one for one in summaries if one.arm.name == "none"), None)
    if plain is not None:
        figure.add_vline(
            x=plain.alone.returns.iqm, line={"color": MUTED_COLOUR, "width": 1.5, "dash": "dot"}
        )
    lines = [(one.arm.title, arm_colour(one.arm), one.alone, one.shielded) for one in summaries]
    if compared is not None:
        lines.append((compared.agent, MUTED_COLOUR, compared.alone, compared.shielded))
    for row, (title, colour, alone, shielded) in enumerate(lines):
        for trials, shift, symbol, words in (
            (alone, -0.14, "diamond", "shield off"),
            (shielded, 0.2, "circle-open", "shield on"),
        ):
            if trials is None:
                continue
            returns = trials.returns
            figure.add_scatter(
                x=[returns.iqm],
                y=[row + shift],
                mode="markers",
                marker={
                    "color": colour,
                    "size": 11,
                    "symbol": symbol,
                    "line": {"width": 2, "color": colour},
                },
                error_x={
                    "type": "data",
                    "symmetric": False,
                    "array": [returns.high - returns.iqm],
                    "arrayminus": [returns.iqm - returns.low],
                    "thickness": 2.5,
                    "width": 6,
                    "color": colour,
                },
                name=words,
                legendgroup=words,
                showlegend=row == 0,
                hovertemplate=(
                    f"{title}, {words}: <b>{rounded_text(returns.iqm)}</b><br>95 % "
                    f"interval {rounded_text(returns.low)} to {rounded_text(returns.high)}<br>mean "
                    f"{rounded_text(returns.mean)}<extra></extra>"
                ),
            )
    rows = len(lines)
    figure.update_layout(
        **figure_layout(84 + _ROW_HEIGHT * rows, margin={"r": 16}),
        showlegend=True,
        legend={"orientation": "h", "x": 0, "y": 1.01, "xanchor": "left", "yanchor": "bottom"},
    )
    figure.update_xaxes(
        title={"text": "typical return, 95 % interval", "standoff": 2},
        fixedrange=True,
        nticks=7,
        zeroline=False,
    )
    figure.update_yaxes(
        tickvals=list(range(rows)),
        ticktext=[title for title, *_ in lines],
        range=[rows - 0.5, -0.6],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=6,
    )
    return figure


def save_learning_figures(study: LearningStudy, folder: Path) -> None:
    """Draw a study as ``outcome.png``, ``curves.png`` and ``afterwards.png``.

    Args:
        study: With finished runs.
        folder: Where they go.

    Raises:
        WorkError: If there is no Chromium or Chrome to draw with, or a file cannot be written.
    """
    from sarl_core.explaining.figures.png import drawing_pictures

    summaries, compared = summarise_study(study), summarise_compared(study)
    figures = {
        "outcome": outcome_figure(summaries, compared, height=520),
        "curves": curves_figure(study, height=820),
        "afterwards": afterwards_figure(summaries, compared),
    }
    with drawing_pictures() as draw:
        for name, figure in figures.items():
            figure.update_layout(
                template="plotly_white",
                width=960,
                paper_bgcolor="#ffffff",
                margin={"l": 70, "t": 60},
            )
            picture = draw(figure)
            with whole_file(folder / f"{name}.png") as unfinished:
                unfinished.write_bytes(picture)


def _panels(
    runs: Sequence[LearningRun], edges: NDArray[np.int64], *, shielded: bool
) -> list[NDArray[np.float64]]:
    """One row a run for each panel, NaN beyond where a run is."""
    returns, crashes, changed = [], [], []
    for run in runs:
        bins = run.curve.binned(edges)
        returns.append(bins.returns)
        changed.append(bins.interventions if shielded else np.full(len(edges) - 1, np.nan))
        so_far = run.curve.crashes_at(edges).astype(np.float64)
        so_far[edges > max(run.done, 1)] = np.nan
        crashes.append(so_far)
    return [np.array(returns), np.array(crashes), np.array(changed)]


def _line(
    figure: go.Figure, arm: LearningArm, x: NDArray[Any], values: NDArray[np.float64], row: int
) -> None:
    """An arm in one panel: the mean of its runs, in a band of all of them."""
    there = ~np.isnan(values).all(axis=0)
    if not there.any():
        return
    x, values = x[there], values[:, there]
    colour = arm_colour(arm)
    common = {"legendgroup": arm.name, "showlegend": False}
    if len(values) > 1:
        low, high = np.nanmin(values, axis=0), np.nanmax(values, axis=0)
        figure.add_scatter(
            x=np.concatenate([x, x[::-1]]),
            y=np.concatenate([high, low[::-1]]),
            fill="toself",
            fillcolor=faded(colour, 0.13),
            line={"width": 0},
            mode="lines",
            hoverinfo="skip",
            row=row,
            col=1,
            **common,
        )
    means = np.nanmean(values, axis=0)
    texts = [share_text(mean) if row == 3 else f"{mean:,.0f}" for mean in means.tolist()]
    figure.add_scatter(
        x=x,
        y=means,
        hovertext=texts,
        mode="lines",
        name=arm.title,
        line={"color": colour, "width": 2.2, "dash": "dot" if arm.replay else "solid"},
        hovertemplate=f"{arm.title}<br>%{{x:,.0f}} steps: <b>%{{hovertext}}</b><extra></extra>",
        row=row,
        col=1,
        **(common | {"showlegend": row == 1}),
    )


def _symbol(arm: LearningArm) -> str:
    return "square" if arm.replay else "circle"


class _LabelPlace(NamedTuple):
    """Where a name stands beside its point: on which side, and how many pixels further up."""

    left: bool
    up: int


def _label_places(
    summaries: Sequence[ArmSummary], ends: tuple[float, float], width: float
) -> list[_LabelPlace]:
    """Where each name stands, so that none covers another or a point, on a narrow screen too.

    Args:
        summaries: Whose names they are.
        ends: Of the returns, the least first.
        width: Most failures.
    """
    across, high = _NARROW
    points = [
        (
            across * (one.mean_crashes / width + 0.02) / 1.02,
            high * (one.alone.mean - ends[0]) / (ends[1] - ends[0]),
        )
        for one in summaries
    ]
    taken = [(x - _POINT, x + _POINT, y - _POINT, y + _POINT) for x, y in points]
    for one, (x, _) in zip(summaries, points, strict=True):
        if one.arm.name == "none":  # by which the corner is drawn, with its name at the top
            end = SAFE_SHARE * x + (1 - SAFE_SHARE) * across * 0.02 / 1.02
            taken.append((end - _LETTER * len(_CORNER), end, high - _LINE, high))
    places: list[_LabelPlace] = []
    for one, (x, y) in zip(summaries, points, strict=True):
        left, long = one.mean_crashes > 0.6 * width, _GAP + _LETTER * len(one.arm.title)
        sides = (x - long, x - _GAP) if left else (x + _GAP, x + long)
        boxes = {up: (*sides, y + up - _LINE / 2, y + up + _LINE / 2) for up in _UPS}
        free = [up for up, box in boxes.items() if not any(_covers(box, other) for other in taken)]
        up = free[0] if free else 0
        taken.append(boxes[up])
        places.append(_LabelPlace(left, up))
    return places


def _covers(one: _Box, other: _Box) -> bool:
    return one[0] < other[1] and other[0] < one[1] and one[2] < other[3] and other[2] < one[3]
