"""What a number of rules achieves: return and failures, with one feature a query and with two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import sqrt
from typing import Any

import numpy as np
import plotly.graph_objects as go
from msgspec import Struct
from plotly.subplots import make_subplots

from sarl_core.documents import Count, MisfitError, NotNegative, Number, Share, conformed
from sarl_core.errors import InputError
from sarl_core.explaining.colours import LABEL_COLOURS, MARKER_COLOUR
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.ticks import share_ticks
from sarl_core.mining.language import share_text

_COLOURS = {False: LABEL_COLOURS[0], True: LABEL_COLOURS[2]}
_NAMES = {False: "one feature a condition", True: "two features a condition"}
_RETURN_HEIGHT, _BOTH_HEIGHT = 300, 430
_CERTAIN = 1.96  # standard errors of a 95 % interval


class BudgetPoint(Struct, frozen=True):
    """What the best rules of a number achieve.

    Attributes:
        rules: Most rules of an action dimension.
        mean: Mean return.
        std: Standard deviation of the returns.
        episodes: How many it was measured on.
        failures: How many of them failed; None where that is not known.
        failure_low: Lower end of the 95 % interval of the rate.
        failure_high: Upper end.
        combined: Whether a query may ask about two features.
        refined: Whether the rules were changed by what they achieve.
    """

    rules: Count
    mean: Number
    std: NotNegative
    episodes: Count
    failures: Count | None = None
    failure_low: Share = 0.0
    failure_high: Share = 1.0
    combined: bool = False
    refined: bool = False

    @property
    def half(self) -> float:
        """Half the width of the 95 % interval of the mean."""
        return _CERTAIN * self.std / sqrt(max(self.episodes, 1))

    @property
    def rate(self) -> float:
        """Share of the episodes that failed, where that is known."""
        return (self.failures or 0) / max(self.episodes, 1)


class PublishedPoint(Struct, frozen=True):
    """What others have reported.

    Attributes:
        rules: Number of leaves.
        mean: Mean return.
        name: Who they are.
    """

    rules: Count
    mean: Number
    name: str


class _Budgets(Struct):
    environments: dict[str, tuple[BudgetPoint, ...]]


def budget_points(document: Mapping[str, Any], env_id: str) -> tuple[BudgetPoint, ...]:
    """What each number of rules achieves in an environment.

    Args:
        document: `environments` to lists of points.
        env_id: Which one.

    Returns:
        By number of rules; () where the document does not have the environment.

    Raises:
        InputError: If the document is of another form.
    """
    try:
        points = conformed(document, _Budgets).environments.get(env_id, ())
    except MisfitError as error:
        raise InputError(
            f"the returns by number of rules are not of the expected form ({error}); write them "
            "again"
        ) from error
    return tuple(sorted(points, key=lambda point: point.rules))


def budget_figure(
    points: Sequence[BudgetPoint], *, published: Sequence[PublishedPoint] = ()
) -> go.Figure:
    """Return and, where they are known, failures against the number of rules.

    Args:
        points: By number of rules, at least one.
        published: What others have reported.

    Returns:
        Rules to the right, by powers of two; means and rates with their 95 % intervals, a line
        where a query asks about one feature and one where it may ask about two, and diamonds
        for rules that were refined.
    """
    known = any(point.failures is not None for point in points)
    figure = make_subplots(
        rows=1 + known,
        cols=1,
        shared_xaxes=True,
        row_heights=[0.66, 0.34] if known else None,
        vertical_spacing=0.06,
    )
    for combined in (False, True):
        for refined in (False, True):
            chosen = [
                point for point in points if (point.combined, point.refined) == (combined, refined)
            ]
            if chosen:
                _add_line(figure, chosen, known)
    if published:
        figure.add_scatter(
            x=[point.rules for point in published],
            y=[point.mean for point in published],
            mode="markers",
            text=[point.name for point in published],
            name="published",
            marker={"symbol": "x", "size": 9, "color": MARKER_COLOUR},
            hovertemplate="%{text}, %{x} leaves: <b>%{y:,.1f}</b><extra></extra>",
            row=1,
            col=1,
        )
    rules = sorted({point.rules for point in points} | {point.rules for point in published})
    figure.update_layout(
        **figure_layout(_BOTH_HEIGHT if known else _RETURN_HEIGHT, margin={"r": 24}),
        showlegend=True,
        legend={"orientation": "h", "x": 0, "y": 1.02, "xanchor": "left", "yanchor": "bottom"},
    )
    figure.update_xaxes(
        type="log",
        tickvals=_spaced(rules),
        ticktext=[f"{count:,}" for count in _spaced(rules)],
        range=[float(np.log10(rules[0])) - 0.12, float(np.log10(rules[-1])) + 0.12],
        fixedrange=True,
        zeroline=False,
    )
    figure.update_xaxes(
        title={"text": "most rules of an action", "standoff": 2}, row=1 + known, col=1
    )
    figure.update_yaxes(fixedrange=True, nticks=6, zeroline=False)
    figure.update_yaxes(title={"text": "mean return", "standoff": 4}, row=1, col=1)
    if known:
        figure.update_yaxes(
            title={"text": "failures", "standoff": 4},
            rangemode="tozero",
            **share_ticks(
                0.0, max(point.failure_high for point in points if point.failures is not None), 3
            ),
            row=2,
            col=1,
        )
    return figure


def _add_line(figure: go.Figure, points: Sequence[BudgetPoint], known: bool) -> None:
    """The points of one kind, in each panel."""
    first = points[0]
    colour = _COLOURS[first.combined]
    name = f"{_NAMES[first.combined]}{', refined' * first.refined}"
    look = {
        "mode": "markers" if first.refined else "lines+markers",
        "name": name,
        "legendgroup": name,
        "cliponaxis": False,
        "line": {"color": colour, "width": 2.2},
        "marker": {
            "color": colour,
            "size": 11 if first.refined else 7,
            "symbol": "diamond" if first.refined else "circle",
        },
    }
    figure.add_scatter(
        x=[point.rules for point in points],
        y=[point.mean for point in points],
        error_y={"type": "data", "array": [point.half for point in points], "thickness": 1.6},
        customdata=[[point.half, point.episodes] for point in points],
        hovertemplate=(
            "at most %{x} rules: mean <b>%{y:,.1f}</b> ± %{customdata[0]:,.1f}<br>"
            "%{customdata[1]:,} episodes<extra></extra>"
        ),
        row=1,
        col=1,
        **look,
    )
    points = [point for point in points if point.failures is not None]
    if known and points:
        rates = np.array([point.rate for point in points])
        figure.add_scatter(
            x=[point.rules for point in points],
            y=rates,
            error_y={
                "type": "data",
                "symmetric": False,
                "array": np.array([point.failure_high for point in points]) - rates,
                "arrayminus": rates - np.array([point.failure_low for point in points]),
                "thickness": 1.6,
            },
            customdata=[
                [share_text(point.rate), point.failures, point.episodes] for point in points
            ],
            hovertemplate=(
                "at most %{x} rules: <b>%{customdata[0]}</b> failed<br>%{customdata[1]:,} of "
                "%{customdata[2]:,} episodes<extra></extra>"
            ),
            showlegend=False,
            row=2,
            col=1,
            **look,
        )


def _spaced(rules: Sequence[int]) -> list[int]:
    """Numbers of rules that can be written beside each other on an axis of powers of two."""
    spaced = [rules[0]]
    for count in rules[1:]:
        if count >= 1.25 * spaced[-1]:
            spaced.append(count)
    return spaced
