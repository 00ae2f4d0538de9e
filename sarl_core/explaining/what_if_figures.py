"""What the shield would do along each feature of a state, as a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import faded, label_colour
from sarl_core.explaining.language import label_text, number_text
from sarl_core.explaining.markup import plain
from sarl_core.explaining.what_if import with_unit
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import RuleSet
from sarl_core.shielding.near import Line

_ROW = 34  # pixels
_PALE = 0.32
_QUIET = "#7d8a95"
_HAIR = 0.004  # of a row: what is narrower is drawn so wide


def lines_figure(
    lines: Sequence[Line],
    ranges: Sequence[tuple[float, float]],
    values: Sequence[float],
    features: Sequence[Feature],
    dimension: int,
    rule_set: RuleSet,
    *,
    dark: bool = False,
) -> go.Figure:
    """A bar for each feature, coloured by what would be executed along it.

    Full colour where a rule decides, pale where the agent's action is passed on because no rule
    applies or the rule abstains.

    Args:
        lines: Of the features to show, from top to bottom.
        ranges: Ends of each bar, in the feature's unit.
        values: The present values.
        features: Names and units, likewise.
        dimension: Action dimension that gives the colours.
        rule_set: The shield's.
        dark: Whether it stands on dark ground.

    Returns:
        Every bar is as wide as the figure; the present value is marked on it.
    """
    labels = rule_set.actions[dimension]
    bars: dict[tuple[int, bool], list[tuple[float, float, int, str]]] = {}
    for row, (line, (low, high), feature) in enumerate(zip(lines, ranges, features, strict=True)):
        for start, end, label, ruled in stretches(line, (low, high), dimension, rule_set):
            left, right = (start - low) / (high - low), (end - low) / (high - low)
            text = (
                f"{plain(feature.name)} {number_text(start, apart_from=end)} to "
                f"{plain(with_unit(number_text(end, apart_from=start), feature))}<br>"
                + plain(_does(label, labels))
                + ("" if ruled else ", as the agent wants")
            )
            bars.setdefault((label, ruled), []).append((left, right, row, text))
    figure = go.Figure()
    for (label, ruled), parts in sorted(bars.items()):
        colour = label_colour(label)
        figure.add_bar(
            base=[left for left, *_ in parts],
            x=[max(right - left, _HAIR) for left, right, *_ in parts],
            y=[row for _, _, row, _ in parts],
            orientation="h",
            width=0.5,
            marker={"color": colour if ruled else faded(colour, _PALE), "line": {"width": 0}},
            name=plain(_does(label, labels)),
            customdata=[text for *_, text in parts],
            hovertemplate="%{customdata}<extra></extra>",
        )
    places = [
        (value - low) / (high - low) for value, (low, high) in zip(values, ranges, strict=True)
    ]
    figure.add_scatter(
        x=places,
        y=list(range(len(lines))),
        mode="markers",
        marker={
            "symbol": "line-ns-open",
            "size": 17,
            "color": "#f1f5f7" if dark else "#1d2730",
            "line": {"width": 3, "color": "#f1f5f7" if dark else "#1d2730"},
        },
        customdata=[
            plain(f"{feature.name} is {with_unit(number_text(value), feature)}")
            for value, feature in zip(values, features, strict=True)
        ],
        hovertemplate="%{customdata}<extra></extra>",
        name="the state",
    )
    _add_ends(figure, ranges, features)
    figure.update_layout(
        height=_ROW * len(lines) + 16,
        margin={"l": 8, "r": 8, "t": 8, "b": 8},
        barmode="overlay",
        showlegend=False,
        hovermode="closest",
        dragmode=False,
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
    )
    figure.update_xaxes(visible=False, range=[-0.012, 1.012], fixedrange=True)
    figure.update_yaxes(
        tickvals=list(range(len(lines))),
        ticktext=[plain(feature.name) for feature in features],
        range=[len(lines) - 0.4, -0.6],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        ticklabelstandoff=6,
    )
    return figure


def stretches(
    line: Line, ends: tuple[float, float], dimension: int, rule_set: RuleSet
) -> list[tuple[float, float, int, bool]]:
    """The parts of a bar, neighbours that look the same made one.

    Args:
        line: What the shield does along the feature.
        ends: Of the bar.
        dimension: Action dimension.
        rule_set: The shield's.

    Returns:
        Start, end, label of what is executed, and whether a rule decides it; from left to right,
        without gaps.
    """
    low, high = ends
    executed = line.decisions.executed[:, dimension]
    shown = rule_set.actions[dimension].labels_of(executed).tolist()
    # A rule that abstains is in force, and something else is executed.
    ruled = [
        rule >= 0 and rule_set.rules[rule].action == label
        for rule, label in zip(line.decisions.rules[:, dimension].tolist(), shown, strict=True)
    ]
    starts = [-np.inf, *line.starts[1:].astype(np.float64).tolist()]
    found: list[tuple[float, float, int, bool]] = []
    for place, start in enumerate(starts):
        end = starts[place + 1] if place + 1 < len(starts) else np.inf
        left, right = max(start, low), min(end, high)
        if left >= right:
            continue
        looks = (shown[place], ruled[place])
        if found and found[-1][2:] == looks:
            found[-1] = (found[-1][0], right, *looks)
        else:
            found.append((left, right, *looks))
    return found


def _does(label: int, labels: LabelledDimension) -> str:
    return label_text(label, labels) if 0 <= label < labels.n_labels else f"action {label}"


def _add_ends(
    figure: go.Figure, ranges: Sequence[tuple[float, float]], features: Sequence[Feature]
) -> None:
    """The ends of each bar, written under it in small.

    As points with text: annotations take Plotly a hundred times as long.
    """
    for side, place, anchor in ((0, 0.0, "middle right"), (1, 1.0, "middle left")):
        figure.add_scatter(
            x=[place] * len(ranges),
            y=[row + 0.4 for row in range(len(ranges))],
            mode="text",
            text=[
                plain(with_unit(number_text(ends[side]), feature))
                for ends, feature in zip(ranges, features, strict=True)
            ],
            textposition=anchor,
            textfont={"size": 10, "color": _QUIET},
            hoverinfo="skip",
        )
