"""What one rule set says where the other says something, as a table in colour."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from sarl_core.explaining.colours import LAYER_SCALE, faded, label_colour
from sarl_core.explaining.difference_words import said_text
from sarl_core.explaining.markup import plain
from sarl_core.shielding.disagreement import Disagreement

_TEXT_UP_TO = 8  # labels; more leave no room for numbers
_SAME = "#8796A3"
_MARK = 0.06  # width of the stripe in the action's colour, in cells


def confusion_figure(
    found: Disagreement, dimension: int, *, names: tuple[str, str], noun: str = "state"
) -> go.Figure:
    """How many states the first set says one thing of and the second another.

    Args:
        found: The comparison.
        dimension: Action dimension.
        names: What the two sets are called.
        noun: What a state is called.

    Returns:
        A row for each thing the first says, a column for each the second says, "no rule" last.
        Where both say the same the cells are grey; elsewhere the darker the more states.
    """
    action = found.first.actions[dimension]
    counts = found.confusion(dimension)
    size = len(counts)
    said = [plain(said_text(label, action)) for label in range(size)]
    differing = counts.astype(float)
    np.fill_diagonal(differing, np.nan)
    differing[differing == 0] = np.nan
    same = np.full(counts.shape, np.nan)
    np.fill_diagonal(same, 1.0)
    hover = [
        [
            f"{plain(names[0])}: <b>{said[row]}</b><br>{plain(names[1])}: <b>{said[column]}</b>"
            f"<br>{counts[row, column]:,} {noun}{'' if counts[row, column] == 1 else 's'}"
            for column in range(size)
        ]
        for row in range(size)
    ]
    figure = go.Figure()
    ticks = list(range(size))
    grey = faded(_SAME, 0.28)
    figure.add_heatmap(
        x=ticks,
        y=ticks,
        z=same,
        colorscale=[(0, grey), (1, grey)],
        showscale=False,
        hoverinfo="skip",
        xgap=2,
        ygap=2,
        name="same",
    )
    figure.add_heatmap(
        x=ticks,
        y=ticks,
        z=differing,
        zmin=0,
        zmax=float(np.nanmax(differing)) if np.isfinite(differing).any() else 1.0,
        colorscale=[list(stop) for stop in LAYER_SCALE],
        showscale=False,
        hoverinfo="skip",
        xgap=2,
        ygap=2,
        name="different",
        text=[
            [
                f"{counts[row, column]:,}" if counts[row, column] and row != column else ""
                for column in ticks
            ]
            for row in ticks
        ],
        texttemplate="%{text}" if size - 1 <= _TEXT_UP_TO else "",
    )
    figure.add_scatter(
        x=[column for _ in ticks for column in ticks],
        y=[row for row in ticks for _ in ticks],
        mode="text" if size - 1 <= _TEXT_UP_TO else "markers",
        marker={"size": 1, "opacity": 0},
        text=[
            f"{counts[row, column]:,}" if row == column and counts[row, column] else ""
            for row in ticks
            for column in ticks
        ],
        hovertext=[text for row in hover for text in row],
        hovertemplate="%{hovertext}<extra></extra>",
        showlegend=False,
        name="counts",
    )
    shapes = []
    for label in range(size - 1):  # the actions in their colours, beside the axes
        box = {"type": "rect", "fillcolor": label_colour(label), "line": {"width": 0}}
        edge, middle = (-0.5 - _MARK, -0.5), (label - 0.46, label + 0.46)
        for (x0, x1), (y0, y1) in ((edge, middle), (middle, edge)):
            shapes.append({**box, "x0": x0, "x1": x1, "y0": y0, "y1": y1})
    figure.update_layout(
        shapes=shapes,  # at once: one by one, Plotly copies them all each time
        height=min(130 + 52 * size, 620),
        margin={"l": 8, "r": 8, "t": 8, "b": 8},
        hovermode="closest",
        hoverdistance=-1,
        dragmode=False,
        showlegend=False,
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
    )
    common = {
        "tickvals": ticks,
        "ticktext": said,
        "showgrid": False,
        "zeroline": False,
        "fixedrange": True,
        "automargin": True,
    }
    figure.update_xaxes(
        title={"text": f"{plain(names[1])} says", "standoff": 6},
        range=[-0.5 - _MARK, size - 0.5],
        side="top",
        **common,
    )
    figure.update_yaxes(
        title={"text": f"{plain(names[0])} says", "standoff": 14},
        range=[size - 0.5, -0.5 - _MARK],
        **common,
    )
    return figure
