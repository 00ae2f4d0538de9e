"""Figures of how relevant rules are to a learner: kept, broken, applied, as it learns."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.explaining.colours import LABEL_COLOURS, MUTED_COLOUR, faded
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.explaining.ticks import share_ticks
from sarl_core.learning.relevance import Relevance
from sarl_core.mining.language import share_text
from sarl_core.rollouts.statistics import mean_interval

# As in the paper: green is kept, red is broken; solid is filtered, dashed is unfiltered.
OBEYED_COLOUR, BROKEN_COLOUR = LABEL_COLOURS[2], "#D55E00"
_DASHES = ("solid", "dash", "dot", "dashdot")
Floats = NDArray[np.float64]


def obeyed_figure(relevance: Relevance, *, confidence: float | None = None) -> go.Figure:
    """How often the rule that applied was kept and how often it was broken (Figure 4).

    Args:
        relevance: R rule sets, K learners, P + 1 tests.
        confidence: A level to mark, as the rules' minimum confidence.

    Returns:
        For each rule set two lines, means over the learners, with 95 % intervals; as shares of
        the steps with a rule.
    """
    figure = go.Figure()
    for number, name in enumerate(relevance.names):
        obeyed = relevance.obeyed_share[number]
        for word, shares, colour in (
            ("kept", obeyed, OBEYED_COLOUR),
            ("broken", 1.0 - obeyed, BROKEN_COLOUR),
        ):
            _add_line(
                figure,
                relevance.learned_steps,
                shares,
                f"{word}, {name}",
                colour,
                _DASHES[number % 4],
            )
    if confidence is not None:
        figure.add_hline(
            y=confidence,
            line={"color": MUTED_COLOUR, "width": 1, "dash": "dot"},
            annotation={"text": f"minimum confidence {confidence:g}", "font": {"size": 11}},
            annotation_position="top left",
        )
    _finish(figure, "share of the steps with a rule", 400, share=True)
    return figure


def applied_figure(relevance: Relevance) -> go.Figure:
    """At which share of the test steps a rule applied.

    Args:
        relevance: R rule sets, K learners, P + 1 tests.

    Returns:
        A line a rule set, with its 95 % interval.
    """
    figure = go.Figure()
    for number, name in enumerate(relevance.names):
        _add_line(
            figure,
            relevance.learned_steps,
            relevance.applied_share[number],
            name,
            MUTED_COLOUR,
            _DASHES[number % 4],
        )
    _finish(figure, "share of all steps", 300, share=True)
    return figure


def learner_figure(relevance: Relevance) -> go.Figure:
    """How good the learners are.

    Args:
        relevance: K learners, P + 1 tests.

    Returns:
        The mean return of the test episodes, with its 95 % interval.
    """
    figure = go.Figure()
    _add_line(
        figure,
        relevance.learned_steps,
        relevance.returns,
        "mean return",
        LABEL_COLOURS[0],
        "solid",
        share=False,
    )
    _finish(figure, "mean return", 300, share=False)
    figure.update_layout(showlegend=False)
    return figure


def _add_line(
    figure: go.Figure,
    steps: NDArray[np.int64],
    values: Floats,
    name: str,
    colour: str,
    dash: str,
    *,
    share: bool = True,
) -> None:
    """A mean over learners, (K, P + 1) values, and the band of its interval."""
    intervals = [mean_interval(column) for column in values.T]
    means = [interval.mean for interval in intervals]
    as_text = _shares if share else _numbers
    low = np.array([interval.low for interval in intervals])
    high = np.array([interval.high for interval in intervals])
    if share:
        low, high = np.clip(low, 0.0, 1.0), np.clip(high, 0.0, 1.0)
    figure.add_scatter(
        x=np.concatenate([steps, steps[::-1]]),
        y=np.round(np.concatenate([high, low[::-1]]), 5),
        mode="lines",
        line={"width": 0},
        fill="toself",
        fillcolor=faded(colour, 0.18),
        hoverinfo="skip",
        showlegend=False,
        legendgroup=name,
    )
    figure.add_scatter(
        x=steps,
        y=np.round(means, 5),
        mode="lines",
        name=plain(name),
        legendgroup=name,
        line={"color": colour, "width": 2.2, "dash": dash},
        customdata=np.stack([as_text(np.array(means)), as_text(low), as_text(high)], axis=1),
        hovertemplate=(
            f"{plain(name)}, after %{{x:,}} steps: <b>%{{customdata[0]}}</b><br>95 % interval "
            "%{customdata[1]} to %{customdata[2]}<extra></extra>"
        ),
    )


def _shares(values: Floats) -> NDArray[np.str_]:
    return np.array([share_text(value) for value in values.tolist()])


def _numbers(values: Floats) -> NDArray[np.str_]:
    return np.array([f"{value:,.1f}" for value in values.tolist()])


def _finish(figure: go.Figure, title: str, height: int, *, share: bool) -> None:
    figure.update_layout(
        **figure_layout(
            height,
            margin={"r": 24},
            legend={"orientation": "h", "x": 0, "y": 1.02, "xanchor": "left", "yanchor": "bottom"},
        )
    )
    figure.update_xaxes(
        title={"text": "steps learned", "standoff": 2},
        fixedrange=True,
        nticks=7,
        tickformat=",d",
        zeroline=False,
    )
    shares: dict[str, Any] = {"range": [0, 1.03], **share_ticks(0, 1)} if share else {}
    figure.update_yaxes(
        title={"text": title, "standoff": 4}, fixedrange=True, nticks=6, zeroline=False, **shares
    )
