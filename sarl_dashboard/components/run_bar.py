"""The button that runs episodes beside the page, how far they are, and what came of them."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st

from sarl_core.mining.language import counted
from sarl_dashboard.jobs.episodes import Comparing, Row, job, known
from sarl_dashboard.text import in_full


def run_bar(name: str, rows: Sequence[Row], episodes: int) -> None:
    """Run what is missing; or how far that is, and a way to call it off.

    Args:
        name: Of the place on screen; the buttons are "run_<name>" and "cancel_<name>".
        rows: What is to be run.
        episodes: How many of each.
    """
    asked = job(name)
    if asked is not None and asked.running:
        with st.container(horizontal=True, vertical_alignment="center"):
            st.progress(asked.share, asked.text)
            st.button(
                "Cancel", icon=":material/close:", on_click=asked.cancel, key=f"cancel_{name}"
            )
        return
    ready = sum(found is not None and len(found) == episodes for found in known(rows, episodes))
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            "Run",
            type="primary",
            icon=":material/play_arrow:",
            key=f"run_{name}",
            on_click=_start,
            args=(name, tuple(rows), episodes),
            disabled=ready == len(rows),
        )
        done = "all done already" if ready == len(rows) else f"{ready} done already"
        st.caption(
            f"{counted(episodes, 'episode')} for each of {counted(len(rows), 'combination')}"
            f"{f'; {done}.' if ready else '.'}",
            width="content",
        )
    _say_what_came_of_it(asked, rows)


def _start(name: str, rows: Sequence[Row], episodes: int) -> None:
    st.session_state[f"_job_{name}"] = Comparing(rows, episodes)


def _say_what_came_of_it(asked: Comparing | None, rows: Sequence[Row]) -> None:
    """What the last work has to say besides its numbers."""
    if asked is None:
        return
    keys = {row.key for row in rows}
    sentences = sorted({str(error) for key, error in asked.problems.items() if key in keys})
    if asked.error is not None:
        sentences.append(str(asked.error))
    for sentence in sentences:
        st.error(in_full(sentence), icon=":material/error:")
    if asked.cancelled:
        st.info(
            "Cancelled. What had been finished is kept; Run goes on from there.",
            icon=":material/pause_circle:",
        )
