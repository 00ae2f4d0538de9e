"""The run of a replay: by its button, or because a step of another episode was chosen."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.errors import SarlError
from sarl_dashboard.components.run_bar import waited_for
from sarl_dashboard.jobs.replays import (
    Played,
    ReplayOrder,
    compared,
    latest_order,
    replay_cache,
    run,
    show_next,
)
from sarl_dashboard.text import refuse
from sarl_dashboard.views.replay.settings import ReplaySettings


@dataclass(frozen=True, eq=False)
class Jump:
    """A way to a step of another episode of a comparison.

    Attributes:
        order: Of that episode.
        step: In it.
    """

    order: ReplayOrder
    step: int


def jump_to(seed: int, step: int) -> None:
    """Go to a step of another episode; the last thing a callback does."""
    st.session_state["_jump"] = (seed, step)
    st.rerun()  # as a whole: it is another replay


def chosen_jump() -> Jump | None:
    """Where a step of another episode was chosen in the flight recorder, the way there.

    The widgets are told, so this comes before they are drawn.
    """
    seed, step = st.session_state.pop("_jump", (None, None))
    order = latest_order()
    comparison = None if order is None or seed is None else compared(order)
    if comparison is None:
        return None
    st.session_state["seed"], st.session_state["step"] = seed, step
    return Jump(comparison[0].of_seed(seed), step)


def run_bar(settings: ReplaySettings, jump: Jump | None) -> None:
    """The button; what it asks for, or a jump, becomes the latest replay."""
    started = st.button("Run", type="primary", icon=":material/play_arrow:", key="run")
    if jump is None and not started and not st.session_state.pop("_run", False):
        return
    try:
        order = settings.order() if jump is None else jump.order
    except SarlError as error:
        refuse(error)
        return
    if replay_cache().get(order.key) is None:
        replay = waited_for(lambda tell: run(order, tell))
        if replay is None:
            return
        replay_cache().put(order.key, replay)
    show_next(order)


def arrive(jump: Jump, played: Played) -> None:
    """Put the slider on the step that was jumped to, once it is there.

    The slider of another episode is another widget, and a new one takes its step from the URL: now
    that it is there, it is told again, and the row of the step with it.
    """
    if played.order is jump.order:
        st.session_state["_step"], st.session_state["_jumped"] = jump.step, True
        st.rerun()
