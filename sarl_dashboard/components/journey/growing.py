"""What a page shows while the trees of many states grow."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs import growing
from sarl_dashboard.session import end_page
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.thresholds import chosen_divider


def require_trees(title: str) -> None:
    """Where the trees of many states are not there yet, grow them, say so, and stop.

    Args:
        title: Of the page, which needs them.
    """
    demonstrations = chosen_demonstrations()
    if demonstrations is None or not rule_base.at_thresholds():
        return
    divider = chosen_divider()
    if not growing.is_long(demonstrations) or growing.is_done(demonstrations, divider):
        return
    key, job = growing.key_of(demonstrations, divider), growing.PLACE.job
    start = partial(growing.job_of, demonstrations, divider)
    lies_waiting = job is not None and job.key == key and (job.cancelled or job.error is not None)
    if not (lies_waiting or (job is not None and job.key == key and job.running)):
        growing.PLACE.begin(start)
    st.title(title)
    offer = Offer(
        key=key,
        start=start,
        about=f"{len(demonstrations):,} states: rules are what a decision tree of them says.",
        complete=False,
        cancelled="Cancelled. Without the tree there are no rules to show; the data can be looked "
        "at on the page Demonstrations.",
        label="Grow the tree",
    )
    watched(growing.PLACE, lambda _: run_bar(growing.PLACE, offer))
    end_page()
