"""A button that begins long work, how far it is, and what came of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import streamlit as st

from sarl_dashboard.jobs.mining import Mining, Result, Work, mining_results
from sarl_dashboard.text import in_full


def _job(place: str) -> Mining | None:
    found = st.session_state.get(f"_job_{place}")
    return found if isinstance(found, Mining) else None


def _at_work(place: str) -> bool:
    asked = _job(place)
    return asked is not None and asked.running


def _start(place: str, key: object, work: Work[Any]) -> None:
    kept = mining_results()
    st.session_state[f"_job_{place}"] = Mining(key, work, lambda found: kept.put(key, found))


def worked_out(
    place: str, key: object, work: Work[Result], hint: str, show: Callable[[Result], None]
) -> None:
    """A button that begins work, how far it is, and what came of it.

    Args:
        place: Name on screen; the buttons are "run_<place>" and "cancel_<place>".
        key: Of everything that the result depends on.
        work: Gives the result.
        hint: Beside the button.
        show: Draws the result.
    """
    going = _at_work(place)

    @st.fragment(run_every=1.0 if going else None)
    def progress_and_result() -> None:
        if going != _at_work(place):
            st.rerun()  # as a whole: from now on every second, or no longer
        asked, kept = _job(place), mining_results().get(key)
        with st.container(horizontal=True, vertical_alignment="center"):
            if asked is not None and asked.running:
                st.progress(asked.share, asked.text)
                st.button(
                    "Cancel", icon=":material/close:", on_click=asked.cancel, key=f"cancel_{place}"
                )
            elif kept is None:
                st.button(
                    "Run",
                    type="primary",
                    icon=":material/play_arrow:",
                    key=f"run_{place}",
                    on_click=_start,
                    args=(place, key, work),
                )
                st.caption(hint, width="content")
        if asked is not None and asked.key == key and not asked.running and kept is None:
            if asked.error is not None:
                st.error(in_full(str(asked.error)), icon=":material/error:")
            elif asked.cancelled:
                st.info("Cancelled; nothing was kept.", icon=":material/pause_circle:")
        if kept is not None:
            show(kept)

    progress_and_result()
