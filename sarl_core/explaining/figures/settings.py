"""The filtered and the unfiltered rule set of several environments, side by side."""

from __future__ import annotations

from collections.abc import Sequence

import plotly.graph_objects as go

from sarl_core.explaining.colours import MUTED_COLOUR
from sarl_core.explaining.figures.comparison import arm_style
from sarl_core.explaining.layouts import LEGEND_ABOVE, figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.explaining.ticks import share_ticks
from sarl_core.mining.language import share_text

SETTING_COLOURS = {
    "filtered": arm_style(0, 0).colour,
    "unfiltered": arm_style(0, 1).colour,
}
"""The same as those of shields with these rules."""

_ROW_HEIGHT = 52


def settings_figure(
    rows: Sequence[tuple[str, str, float]], *, title: str, share: bool
) -> go.Figure:
    """One number of each rule set, a row an environment.

    Args:
        rows: Environment, setting ("filtered" or "unfiltered") and number, in the order to be
            drawn from top to bottom.
        title: Of the axis.
        share: Whether the numbers are shares; else counts, drawn by powers of ten.

    Returns:
        Two points a row, and a line between them.
    """
    names = list(dict.fromkeys(name for name, _, _ in rows))
    figure = go.Figure()
    for place, name in enumerate(names):
        values = [value for other, _, value in rows if other == name]
        figure.add_scatter(
            x=[min(values), max(values)],
            y=[place, place],
            mode="lines",
            line={"color": MUTED_COLOUR, "width": 1.5},
            hoverinfo="skip",
            showlegend=False,
        )
    for setting, colour in SETTING_COLOURS.items():
        chosen = [(name, value) for name, other, value in rows if other == setting]
        texts = [share_text(value) if share else f"{value:,.0f}" for _, value in chosen]
        figure.add_scatter(
            x=[value for _, value in chosen],
            y=[names.index(name) for name, _ in chosen],
            mode="markers+text",
            name=setting,
            text=texts,
            textposition="top center",
            cliponaxis=False,
            marker={"color": colour, "size": 11},
            hovertemplate=[
                f"{plain(name)}, {setting}: <b>{text}</b><extra></extra>"
                for (name, _), text in zip(chosen, texts, strict=True)
            ],
        )
    figure.update_layout(
        **figure_layout(
            90 + _ROW_HEIGHT * len(names),
            margin={"r": 24},
            legend=LEGEND_ABOVE,
        )
    )
    axis = (
        {"range": [-0.03, 1.06], **share_ticks(0, 1)}
        if share
        else {"type": "log", "dtick": 1, "tickformat": ",d"}
    )
    figure.update_xaxes(
        title={"text": title, "standoff": 2}, fixedrange=True, zeroline=False, **axis
    )
    figure.update_yaxes(
        tickvals=list(range(len(names))),
        ticktext=[plain(name) for name in names],
        range=[len(names) - 0.5, -0.7],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=6,
    )
    return figure
