"""Steps from left to right: the colours of labels, a mark at a step, and the step of a click."""

from __future__ import annotations

from typing import Any

import streamlit as st
from markupsafe import Markup

from sarl_core.explaining.colours import INTERVENTION_COLOUR, label_colour
from sarl_core.explaining.figures.replay import Timeline
from sarl_core.explaining.html.step_card import legend
from sarl_core.mining.action_words import label_text
from sarl_core.mining.labels import LabelledDimension
from sarl_dashboard.components.places import placed


def show_legend(dimensions: tuple[LabelledDimension, ...], *, marks: str = "") -> None:
    """The colours of the strip.

    Args:
        dimensions: Whose labels it has.
        marks: What its marks are, "" where there are none.
    """
    many = len(dimensions) > 1
    entries = [
        (f"{dimension.name} {text}" if many else text, label_colour(label))
        for dimension in dimensions
        for label in range(min(dimension.n_labels, 24))
        for text in [label_text(label, dimension)]
    ]
    if marks:
        entries.append((marks, INTERVENTION_COLOUR))
    st.html(legend(entries, after="Click a step to look at it."))


def clicked_step(key: str) -> int | None:
    """The step that was clicked in a figure over a timeline; None where a click took it back.

    Args:
        key: Of the widget.
    """
    picked: Any = st.session_state[key]
    points = picked.selection.points
    if not points:
        return None
    step = points[0]["customdata"]
    return int(step["0"] if isinstance(step, dict) else step[0])


def mark_room(timeline: Timeline) -> Markup:
    """The room that the mark over the figures has, where `mark_at` puts it."""
    return placed(
        "timeline",
        left=f"{timeline.left}px",
        right=f"{timeline.right}px",
        bottom=f"{timeline.bottom}px",
    )


def mark_at(timeline: Timeline, step: int) -> Markup:
    """Style that puts the mark over a step."""
    return placed("timeline", across=f"{timeline.place(step):.5f}")
