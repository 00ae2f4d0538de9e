"""The run of a replay: by its button, or because a step of another episode was chosen."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs.replays import (
    REPLAY,
    Jump,
    Played,
    ReplayOrder,
    begin_anew,
    compared,
    latest_order,
    replaying,
)
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.text import refuse
from sarl_dashboard.views.replay.settings import ReplaySettings


def jump_to(seed: int, step: int) -> None:
    """Go to a step of another episode; the last thing a callback does."""
    st.session_state["_jump"] = (seed, step)
    st.rerun()  # as a whole: it is another replay


def set_out() -> None:
    """Where a step of another episode was chosen in the flight recorder, set out for it.

    The widgets are told, so this comes before they are drawn.
    """
    seed, step = st.session_state.pop("_jump", (None, None))
    order = latest_order()
    comparison = None if order is None or seed is None else compared(order)
    if comparison is not None:
        st.session_state["seed"] = seed
        jump = Jump(comparison[0].of_seed(seed), step)
        REPLAY.begin(lambda: replaying(jump))


def open_with(settings: ReplaySettings) -> ReplayOrder | None:
    """What the settings ask for, which is run unasked where none of this task was yet.

    Args:
        settings: On the page.

    Returns:
        None if it cannot be had, and then the page says why.
    """
    try:
        order = settings.order()
    except SarlError as error:
        refuse(error)
        return None
    demonstrations = chosen_demonstrations()
    task = (str(order.env_id), "" if demonstrations is None else demonstrations.digest)
    if st.session_state.get("_replayed_task") != task:
        st.session_state["_replayed_task"] = task
        begin_anew(order)
    return order


def replay_bar(order: ReplayOrder | None, played: Played | None, *, missed: bool) -> None:
    """The button, or how far the work is.

    Args:
        order: What the settings ask for; None if it cannot be had.
        played: On screen; None where nothing is yet.
        missed: As of `watched`.
    """
    offer = None
    if order is not None:
        jump = Jump(order)
        also = "" if order.rule_set is None else ", with the rules and without"
        offer = Offer(
            key=order.key,
            start=lambda: replaying(jump),
            about=f"One episode, on seed {order.seed:,}{also}.",
            complete=False,
            cancelled="Cancelled; nothing was kept.",
        )
        if st.session_state.pop("_run", False):
            REPLAY.begin(offer.start)
    watched(REPLAY, lambda _: run_bar(REPLAY, offer), seconds=0.5, missed=missed)
    changed = played is not None and (order is None or order.key != played.order.key)
    # Below the buttons: what goes away above one that is being pressed moves it from the pointer.
    if changed and not REPLAY.at_work:
        st.markdown(":orange[:material/info: The settings have changed since: press Run.]")


def arrive(jump: Jump, played: Played) -> None:
    """Put the slider on the step that was jumped to, once it is there.

    The slider of another episode is another widget, and a new one takes its step from the URL: now
    that it is there, it is told again, and the row of the step with it.
    """
    if played.order is jump.order and jump.step is not None:
        st.session_state["_step"], st.session_state["_jumped"] = jump.step, True
        st.rerun()
