"""The figure of an aggregation: what each round brought."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import plotly.graph_objects as go
from msgspec import Meta, Struct
from plotly.subplots import make_subplots

from sarl_core.documents import Count, MisfitError, NotNegative, Number, Share, conformed
from sarl_core.errors import InputError
from sarl_core.explaining.colours import LABEL_COLOURS, MARKER_COLOUR, faded
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.ticks import share_ticks
from sarl_core.improving.aggregation import AggregationRound
from sarl_core.mining.language import share_text

_BLUE, _GREEN = LABEL_COLOURS[0], LABEL_COLOURS[2]
_PANELS = ("Return", "Coverage", "Expert would do otherwise", "Rules")
_PANEL_HEIGHTS = (0.43, 0.19, 0.19, 0.19)
_ROUNDS_HEIGHT = 560


@dataclass(frozen=True)
class RoundPoint:
    """What one round brought, whether it was run just now or stands in a card.

    Attributes:
        number: Counted from 1.
        mean: Mean return of its episodes.
        std: Their standard deviation.
        coverage: Share of the met states in which some rule applied.
        disagreement: Share of the covered decisions in which the expert would do otherwise.
        rules: Number of rules.
        pairs: State-action pairs that they were grown from.
        failures: How many of its episodes failed; None where that is not known.
    """

    number: Count
    mean: Number
    std: NotNegative
    coverage: Share
    disagreement: Share
    rules: Count
    pairs: Count
    failures: Count | None = None


def points_of(rounds: Sequence[AggregationRound]) -> tuple[RoundPoint, ...]:
    """The rounds of an aggregation as points of the figure.

    Args:
        rounds: Those that are finished.

    Returns:
        One entry a round.
    """
    return tuple(
        RoundPoint(
            number=one.number,
            mean=one.mean_return,
            std=float(one.returns.std(ddof=1)) if len(one.returns) > 1 else 0.0,
            coverage=one.coverage,
            disagreement=one.disagreement,
            rules=one.rules,
            pairs=one.pairs,
            failures=None if one.failures is None else one.failures.count,
        )
        for one in rounds
    )


def card_points(card: Mapping[str, Any]) -> tuple[RoundPoint, ...]:
    """The rounds that a card tells of.

    Args:
        card: As `aggregation_card` gives it.

    Returns:
        One entry a round.

    Raises:
        InputError: If it is no such card.
    """
    try:
        return conformed(card, _RoundsCard).rounds
    except MisfitError as error:
        raise InputError(
            f"the card does not tell of its rounds ({error}); make the rules again with aggregate"
        ) from error


class _RoundsCard(Struct):
    rounds: Annotated[tuple[RoundPoint, ...], Meta(min_length=1)]


def rounds_figure(
    points: Sequence[RoundPoint],
    *,
    planned: int | None = None,
    chosen: int | None = None,
    reported: float | None = None,
) -> go.Figure:
    """Return, coverage, disagreement and number of rules over the rounds.

    Args:
        points: The finished rounds, at least one.
        planned: Number of rounds there will be; those that are finished where not given.
        chosen: Number of the round whose rules were taken.
        reported: Mean return of these on fresh episodes.

    Returns:
        Four panels over each other, which share the axis of rounds; the return with one standard
        deviation to either side.
    """
    numbers = [point.number for point in points]
    means = np.array([point.mean for point in points])
    spreads = np.array([point.std for point in points])
    figure = make_subplots(
        rows=len(_PANELS),
        cols=1,
        shared_xaxes=True,
        row_heights=list(_PANEL_HEIGHTS),
        vertical_spacing=0.075,
    )
    figure.add_scatter(
        x=[*numbers, *reversed(numbers)],
        y=np.round(np.concatenate([means + spreads, (means - spreads)[::-1]]), 3),
        mode="lines",
        line={"width": 0},
        fill="toself",
        fillcolor=faded(_BLUE, 0.16),
        hoverinfo="skip",
        row=1,
        col=1,
    )
    shares = [[getattr(point, name) for point in points] for name in ("coverage", "disagreement")]
    for row, (values, tips) in enumerate(
        (
            (means, [f"{value:,.1f}" for value in means.tolist()]),
            *((one, [share_text(share, decimals=1) for share in one]) for one in shares),
            ([point.rules for point in points], [f"{point.rules:,}" for point in points]),
        ),
        start=1,
    ):
        extra = "<br>deviation %{customdata:,.1f}" if row == 1 else ""
        figure.add_scatter(
            x=numbers,
            y=np.round(np.asarray(values, dtype=np.float64), 5),
            mode="lines+markers",
            name=_PANELS[row - 1],
            customdata=np.round(spreads, 3) if row == 1 else None,
            hovertext=tips,
            line={"color": _BLUE, "width": 2.2 if row == 1 else 1.6},
            marker={"color": _BLUE, "size": 7 if row == 1 else 5},
            hovertemplate=(
                f"round %{{x}}, {_PANELS[row - 1].lower()}: <b>%{{hovertext}}</b>{extra}"
                "<extra></extra>"
            ),
            row=row,
            col=1,
        )
    last = max(planned or 0, *numbers)
    _mark_chosen(figure, points, chosen, reported, last)
    _finish_rounds(figure, points, last)
    return figure


def _mark_chosen(
    figure: go.Figure,
    points: Sequence[RoundPoint],
    chosen: int | None,
    reported: float | None,
    last: int,
) -> None:
    """A stripe through all panels at the chosen round, and what it achieved afterwards."""
    place = next((point for point in points if point.number == chosen), None)
    if place is None:
        return
    wide = 0.006 * max(last, 4)
    for row in range(1, len(_PANELS) + 1):
        figure.add_vrect(
            x0=place.number - wide,
            x1=place.number + wide,
            fillcolor=MARKER_COLOUR,
            opacity=0.25,
            line_width=0,
            layer="below",
            row=row,
            col=1,
        )
    figure.add_scatter(
        x=[place.number],
        y=[round(place.mean, 3)],
        mode="markers",
        name="chosen",
        marker={
            "size": 15,
            "symbol": "circle-open",
            "color": MARKER_COLOUR,
            "line": {"width": 2.5},
        },
        hoverinfo="skip",
        row=1,
        col=1,
    )
    if reported is not None:
        figure.add_scatter(
            x=[place.number],
            y=[round(reported, 3)],
            mode="markers",
            name="fresh episodes",
            marker={"size": 12, "symbol": "diamond", "color": _GREEN},
            hovertemplate="on fresh episodes: <b>%{y:,.1f}</b><extra></extra>",
            row=1,
            col=1,
        )


def _finish_rounds(figure: go.Figure, points: Sequence[RoundPoint], last: int) -> None:
    figure.update_layout(
        **figure_layout(_ROUNDS_HEIGHT, margin={"r": 16, "t": 26}, showlegend=False)
    )
    figure.update_xaxes(
        range=[0.5, max(last, 2) + 0.5],
        tickformat="d",
        # Whole rounds only: ticks between them would mean nothing.
        dtick=max(1, -(-last // 12)),
        tick0=1,
        fixedrange=True,
        zeroline=False,
    )
    figure.update_xaxes(title={"text": "round", "standoff": 2}, row=len(_PANELS), col=1)
    figure.update_yaxes(fixedrange=True, zeroline=False, nticks=4)
    figure.update_yaxes(nticks=6, row=1, col=1)
    figure.update_yaxes(range=[0, 1.08], **share_ticks(0, 1, 3), row=2, col=1)
    most = max(point.disagreement for point in points)
    highest = max(1.15 * most, 0.05)
    figure.update_yaxes(range=[0, highest], **share_ticks(0, highest, 3), row=3, col=1)
    rules = max(point.rules for point in points)
    figure.update_yaxes(range=[0, 1.2 * rules], tickformat=",d", row=4, col=1)
    for row, title in enumerate(_PANELS, start=1):
        figure.add_annotation(
            text=f"<b>{title}</b>",
            x=0,
            y=1,
            xref="x domain" if row == 1 else f"x{row} domain",
            yref="y domain" if row == 1 else f"y{row} domain",
            xanchor="left",
            yanchor="bottom",
            yshift=2,
            showarrow=False,
        )
