"""Figures of a comparison: the return of every episode, and what is typical of each arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from sarl_core.explaining.colours import LABEL_COLOURS, faded
from sarl_core.explaining.layouts import LEGEND_ABOVE, figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.mining.language import at_least_text
from sarl_core.rollouts.episodes import Episodes
from sarl_core.studies.comparison import Arm, Comparison

_BLUE, _ORANGE, _GREEN, _PINK, _SKY, _YELLOW, _GREY, _VIOLET, _BROWN, _OLIVE = LABEL_COLOURS
_VERMILION = "#D55E00"
# As in the paper: the novice alone is blue and the expert green, filtered rules are orange and
# unfiltered ones red.
_ALONE = (_BLUE, _GREEN, _SKY, _GREY, _OLIVE)
_SHIELDED = (_ORANGE, _VERMILION, _VIOLET, _PINK, _BROWN, _YELLOW)
_SYMBOLS = ("circle", "diamond", "square", "triangle-up", "x")
_DASHES = ("solid", "dot", "dash", "dashdot", "longdash")
_ROW_HEIGHT = 46


@dataclass(frozen=True)
class ArmStyle:
    """How an arm is drawn.

    Attributes:
        colour: Tells the shield; without one, the agent.
        symbol: Tells the agent.
        dash: Likewise.
    """

    colour: str
    symbol: str
    dash: str


def arm_style(agent: int, rules: int | None) -> ArmStyle:
    """The look of the arm of an agent and a rule set.

    Args:
        agent: Number of the agent, from 0; in the paper's colours the novice is 0, the expert 1.
        rules: Number of the rule set, from 0, None for no shield; in the paper's colours the
            filtered rules are 0, the unfiltered ones 1.

    Returns:
        The style; the same for the same numbers.
    """
    colours, number = (_ALONE, agent) if rules is None else (_SHIELDED, rules)
    return ArmStyle(
        colours[number % len(colours)],
        _SYMBOLS[agent % len(_SYMBOLS)],
        _DASHES[agent % len(_DASHES)],
    )


def arm_styles(arms: Sequence[Arm]) -> tuple[ArmStyle, ...]:
    """The look of several arms, agents and rule sets numbered as they appear.

    Args:
        arms: What is compared.

    Returns:
        One entry an arm.
    """
    agents: list[Any] = []
    rule_sets: list[int] = []
    styles = []
    for arm in arms:
        if arm.agent not in agents:
            agents.append(arm.agent)
        rules = None
        if arm.rules is not None:
            if id(arm.rules) not in rule_sets:
                rule_sets.append(id(arm.rules))
            rules = rule_sets.index(id(arm.rules))
        styles.append(arm_style(agents.index(arm.agent), rules))
    return tuple(styles)


def returns_figure(
    comparison: Comparison, *, styles: Sequence[ArmStyle] | None = None, height: int = 400
) -> go.Figure:
    """The return of every episode, a line an arm (the paper's Fig. 5 to 7).

    Args:
        comparison: A arms.
        styles: A entries; those of `arm_styles` where not given.
        height: In pixels.

    Returns:
        Episodes to the right, returns upwards; a click on a name hides its line.
    """
    figure = go.Figure()
    for arm, episodes, style in _drawn(comparison, styles):
        name = plain(arm.name)
        numbers = np.arange(1, len(episodes) + 1)
        figure.add_scatter(
            x=numbers,
            y=episodes.returns,
            mode="lines+markers" if len(episodes) <= 200 else "lines",
            name=name,
            line={"color": faded(style.colour, 0.55), "width": 1.4, "dash": style.dash},
            marker={"color": style.colour, "size": 4.5, "symbol": style.symbol},
            customdata=episodes.seeds,
            hovertemplate=(
                f"{name}<br>episode %{{x}}, seed %{{customdata}}: <b>%{{y:,.1f}}</b><extra></extra>"
            ),
        )
    longest = max((len(episodes) for episodes in comparison.episodes), default=1)
    figure.update_layout(
        **figure_layout(height, margin={"r": 24}),
        showlegend=True,
        legend=LEGEND_ABOVE,
    )
    figure.update_xaxes(
        title={"text": "episode", "standoff": 2},
        range=[0, max(longest, 2) + 1],
        nticks=8,
        tickformat="d",
        fixedrange=True,
        zeroline=False,
    )
    figure.update_yaxes(
        title={"text": "return", "standoff": 4}, nticks=7, fixedrange=True, zeroline=False
    )
    return figure


def typical_figure(
    comparison: Comparison,
    *,
    styles: Sequence[ArmStyle] | None = None,
    height: int | None = None,
) -> go.Figure:
    """The interquartile mean of each arm's returns, with its 95 % interval.

    Args:
        comparison: A arms.
        styles: A entries; those of `arm_styles` where not given.
        height: In pixels; as the number of arms asks where not given.

    Returns:
        A row an arm, from top to bottom; returns to the right.
    """
    figure = go.Figure()
    for row, (arm, episodes, style) in enumerate(_drawn(comparison, styles)):
        typical = episodes.statistics
        figure.add_scatter(
            x=[typical.iqm],
            y=[row],
            mode="markers+text",
            text=[f"{typical.iqm:,.1f}{_failing(episodes)}"],
            textposition="top center",
            cliponaxis=False,
            marker={"color": style.colour, "size": 11, "symbol": style.symbol},
            error_x={
                "type": "data",
                "symmetric": False,
                "array": [typical.high - typical.iqm],
                "arrayminus": [typical.iqm - typical.low],
                "thickness": 3,
                "width": 7,
                "color": style.colour,
            },
            hovertemplate=(
                f"{plain(arm.name)}: <b>{typical.iqm:,.1f}</b><br>95 % interval "
                f"{typical.low:,.1f} to {typical.high:,.1f}<br>"
                f"mean {typical.mean:,.1f}, {len(episodes)} episodes"
                "<extra></extra>"
            ),
        )
    rows = len(comparison.arms)
    figure.update_layout(
        **figure_layout(height or 60 + _ROW_HEIGHT * rows, margin={"r": 24}, showlegend=False)
    )
    figure.update_xaxes(
        title={"text": "typical return (IQM, 95 % interval)", "standoff": 2},
        fixedrange=True,
        nticks=6,
        zeroline=False,
    )
    figure.update_yaxes(
        tickvals=list(range(rows)),
        ticktext=[plain(arm.name) for arm in comparison.arms],
        range=[rows - 0.5, -0.7],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=6,
    )
    return figure


def _failing(episodes: Episodes) -> str:
    """How many episodes fail, beside a number that leaves out the worst ones."""
    rate = episodes.failures
    if rate is None or rate.unknown == rate.of:
        return ""
    return f" ({at_least_text(rate.rate, rate.unknown)} fail)"


def _drawn(comparison: Comparison, styles: Sequence[ArmStyle] | None) -> zip[Any]:
    return zip(
        comparison.arms,
        comparison.episodes,
        styles or arm_styles(comparison.arms),
        strict=True,
    )
