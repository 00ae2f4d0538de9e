"""What a page shows while the trees of many states grow."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.growing.growth import learner_for
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs import growing
from sarl_dashboard.session import end_page
from sarl_dashboard.state import combining, hold_out, rule_base
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.mined import learner_of
from sarl_dashboard.state.thresholds import (
    AUTOMATIC,
    choose_learner,
    chosen_divider,
)


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
    if lies_waiting:
        _show_other_ways(demonstrations)
    end_page()


def _show_other_ways(demonstrations: Demonstrations) -> None:
    """What takes back a choice that asks for this tree: its own page needs the tree, too."""
    ways: list[tuple[str, Callable[[], None]]] = []
    if learner_of(demonstrations) != learner_for(AUTOMATIC, len(demonstrations)):
        ways.append(("Choose the learner automatically", partial(choose_learner, AUTOMATIC)))
    if hold_out.chosen().share:
        ways.append(("Hold out no episodes", partial(hold_out.choose_share, hold_out.NOTHING)))
    choice = combining.chosen()
    if choice.on:
        ways.append(("Combine no features", partial(combining.choose, choice._replace(on=False))))
    if ways:
        with st.container(horizontal=True, vertical_alignment="center"):
            st.caption("Or take back a choice that asks for another tree:", width="content")
            for label, take_back in ways:
                st.button(label, icon=":material/undo:", on_click=take_back)
