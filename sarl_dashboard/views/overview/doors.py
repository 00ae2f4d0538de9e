"""Three ways in."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.components.journey.first_run import (
    STEPS,
    first_run_done,
    link_to_step,
    step_at_hand,
)
from sarl_dashboard.state.data import UPLOAD


def show_doors() -> None:
    """The example, data of one's own, and rules that others are to understand."""
    with st.container(border=True):
        st.markdown("**See the example**")
        *steps, last = (step.what for step in STEPS)
        st.caption(
            f"A first run on Lunar Lander in five steps: {'; '.join(steps)}; and {last}. It takes "
            "a few minutes, and no file."
        )
        waits = step_at_hand()
        with st.container(horizontal=True, gap="small"):
            if waits is None:
                key = "first_run_again" if first_run_done() else "first_run_begin_on"
                link_to_step(0, "Begin the first run", ":material/flag:", key=key)
            else:
                label = f"Go on with step {waits + 1}: {STEPS[waits].page}"
                link_to_step(waits, label, ":material/play_arrow:", key="first_run_on")
                link_to_step(0, "Begin it anew", ":material/flag:", key="first_run_again")
    with st.container(border=True):
        st.markdown("**Use my data**")
        st.caption(
            "A table of what somebody did, step by step: CSV, Excel, Parquet, and more. No "
            "environment is needed."
        )
        st.page_link(
            "demonstrations.py",
            label="Upload a file",
            icon=":material/upload_file:",
            query_params={"data": UPLOAD},
        )
    with st.container(border=True):
        st.markdown("**Explain a rule set**")
        st.caption(
            "The rules in force, or those of a file, as one page in plain words for people who "
            "know only the task."
        )
        st.page_link("report.py", label="Write a report", icon=":material/summarize:")
