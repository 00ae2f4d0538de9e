"""What was done in an episode of a log, its features, and where it broke the rules."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.auditing.audit import Audit
from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import (
    INTERVENTION_COLOUR,
    MUTED_COLOUR,
    OUTSIDE_COLOUR,
)
from sarl_core.explaining.figures.replay import Timeline, Track
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.explaining.ticks import round_ticks, tick_text
from sarl_core.mining.action_words import label_text, says_label

_ROW_HEIGHT = 84  # pixels, of a feature
_NO_OR_YES = {"tickvals": [0, 1], "ticktext": ["no", "yes"]}
_TITLE = 18  # of these


def audit_tracks(audit: Audit, rows: slice) -> tuple[Track, ...]:
    """The rows of the strip of an episode.

    Args:
        audit: Of the log.
        rows: Of the episode, T of them.

    Returns:
        For each action dimension what was done and what the rule in force says, and where rules
        forbid what it forbids: what was done, if that breaks it; then the breaks, those outside the
        data of their rules, and the near misses, where there are any.
    """
    says, forbids = np.full((2, len(audit.rule_set) + 1), np.nan)
    for place, rule in enumerate(audit.rule_set):
        (forbids if rule.forbids else says)[place] = rule.label
    tracks = []
    for index, dimension in enumerate(audit.rule_set.actions):
        name = f"{dimension.name}: " if len(audit.rule_set.actions) > 1 else ""
        done = audit.labels[rows, index].astype(np.float64)
        tracks.append(Track(f"{name}done", done, dimension))
        in_force = audit.rules[rows, index]
        kinds = {rule.kind for rule in audit.rule_set if rule.dimension == index} or {"do"}
        if "do" in kinds:
            tracks.append(Track(f"{name}rule says", says[in_force], dimension))
        if "never" in kinds:
            forbidden = forbids[in_force]
            broken = audit.breaks[rows, index] & ~np.isnan(forbidden)
            tracks.append(Track(f"{name}forbidden", np.where(broken, done, forbidden), dimension))
    broken = audit.is_broken[rows]
    tracks.append(Track("broken", np.where(broken, 0.0, np.nan), None))
    for called, marks, colour in (
        ("outside data", audit.outside[rows], OUTSIDE_COLOUR),
        ("near miss", audit.near[rows] >= 0, MUTED_COLOUR),
    ):
        if marks.any():
            tracks.append(Track(called, np.where(marks, 0.0, np.nan), None, colour))
    return tuple(tracks)


def step_texts(audit: Audit, rows: slice) -> list[str]:
    """What is said of each step of an episode.

    Args:
        audit: Of the log.
        rows: Of the episode.

    Returns:
        As "step 17: brake; R3 says lift".
    """
    rule_set = audit.rule_set
    texts = []
    assert audit.log.steps is not None
    for row in range(rows.start, rows.stop):
        parts = []
        for index, dimension in enumerate(rule_set.actions):
            place = int(audit.rules[row, index])
            done = label_text(int(audit.labels[row, index]), dimension)
            if place < 0:
                parts.append(f"{done}, no rule")
                continue
            rule = rule_set[place]
            said = says_label(rule, dimension)
            parts.append(f"{done}; {rule_set.name_of(rule)} says {said}")
        texts.append(f"step {audit.log.steps[row]}: {', '.join(parts)}")
    return texts


def feature_lines(
    features: Sequence[Feature],
    values: NDArray[np.float32],
    breaks: NDArray[np.bool_],
    timeline: Timeline,
    *,
    first: int = 0,
) -> go.Figure:
    """A small figure for each feature, one below the other, over the same steps.

    Each point carries its step in ``customdata``, as those of the strip do.

    Args:
        features: k of them, from top to bottom.
        values: Shape (T, k).
        breaks: Where a rule was broken, (T,).
        timeline: Where the steps stand.
        first: Number of the first step.

    Returns:
        Lines, and a mark at each break.
    """
    places = np.arange(len(values))
    numbers = places + first
    figure = go.Figure()
    height = _ROW_HEIGHT * len(features)
    for row, feature in enumerate(features):
        axis = "" if row == 0 else str(row + 1)
        unit = f" ({feature.unit})" if feature.unit else ""
        figure.add_scatter(
            x=places,
            y=values[:, row],
            yaxis=f"y{axis}",
            mode="lines+markers",
            line={
                "width": 1.6,
                "color": MUTED_COLOUR,  # no action's
                "shape": "linear" if feature.indicator is None else "hvh",
            },
            marker={"size": 1, "opacity": 0},
            customdata=np.stack([places, numbers], axis=1),
            hovertemplate="step %{customdata[1]}: %{y:.4g}" + plain(unit) + "<extra></extra>",
        )
        # Of their own, so that a step that is selected does not hide them.
        figure.add_scatter(
            x=places[breaks],
            y=values[breaks, row],
            yaxis=f"y{axis}",
            mode="markers",
            marker={"size": 6, "color": INTERVENTION_COLOUR},
            unselected={"marker": {"opacity": 1}},
            customdata=np.stack([places, numbers], axis=1)[breaks],
            hoverinfo="skip",
        )
        top = 1 - row / len(features)
        figure.update_layout(
            {
                f"yaxis{axis}": {
                    "domain": [top - 1 / len(features), top - _TITLE / height],
                    "fixedrange": True,
                    "nticks": 3,
                    "automargin": False,
                    "zeroline": False,
                }
                | ({} if feature.indicator is None else _NO_OR_YES)
            }
        )
        figure.add_annotation(
            text=plain(f"{feature.name}{unit}"),
            x=0,
            y=top,
            xref="paper",
            yref="paper",
            xanchor="left",
            yanchor="top",
            showarrow=False,
        )
    figure.update_layout(
        **figure_layout(
            height + 8 + timeline.bottom,
            margin={
                "l": timeline.left,
                "r": timeline.right,
                "t": 8,
                "b": timeline.bottom,
                "autoexpand": False,
            },
            showlegend=False,
            hoverdistance=-1,
        )
    )
    ticks = round_ticks(first, first + len(values) - 1, 7, whole=True)
    figure.update_xaxes(
        title={"text": "step", "standoff": 2},
        anchor="y" if len(features) == 1 else f"y{len(features)}",
        fixedrange=True,
        range=timeline.range,
        tickvals=[tick - first for tick in ticks],
        ticktext=[tick_text(tick) for tick in ticks],
        zeroline=False,
        automargin=False,
    )
    return figure
