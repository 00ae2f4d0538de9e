"""Steps from left to right: the colours of labels, a mark at a step, and the step of a click."""

from __future__ import annotations

from typing import Any

import streamlit as st

from sarl_core.explaining.colours import INTERVENTION_COLOUR, label_colour
from sarl_core.explaining.figures.replay import Timeline
from sarl_core.explaining.html.step_card import legend
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import label_text


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


def mark_style(timeline: Timeline) -> str:
    """The mark over the figures, where `at_step` puts it."""
    return (
        "<style>"
        ".st-key-timeline { position: relative; }"
        ".st-key-timeline::after { content: ''; position: absolute; z-index: 2; top: 0;"
        f" bottom: {timeline.bottom}px; width: 2px; pointer-events: none;"
        f" left: calc({timeline.left - 1}px"
        f" + (100% - {timeline.left + timeline.right}px) * var(--step-x, 0));"
        # Of the page's ink, with a rim, so that it is seen on every colour.
        " background: currentColor;"
        " box-shadow: 0 0 0 1px rgba(140, 150, 160, 0.6); }"
        "</style>"
    )


def mark_at(timeline: Timeline, step: int) -> str:
    """Style that puts the mark of `mark_style` over a step."""
    return f"<style>.st-key-timeline {{ --step-x: {timeline.place(step):.5f}; }}</style>"
