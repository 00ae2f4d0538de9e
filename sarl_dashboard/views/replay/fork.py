"""The fork on the page Replay: the same episode once more, without the change of one step."""

from __future__ import annotations

import streamlit as st

from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.words.fork import REST_TEXT, fork_text
from sarl_core.rendering.forking import Fork, Rest
from sarl_dashboard.jobs.replays import Order, Replay, kept_forks, run_fork, with_progress
from sarl_dashboard.text import escaped

RESTS: dict[str, Rest] = {"only this change": "shielded", "the shield from here on": "alone"}


def fork_section(replay: Replay, order: Order, current: int) -> None:
    """What the change at a step was worth.

    Args:
        replay: On screen.
        order: Asked for it.
        current: The step that is chosen.
    """
    steps = replay.shown.steps
    assert steps is not None
    st.html(heading("Without this change"))
    if not steps.intervened[current]:
        st.caption(
            "Choose a step at which the rules changed the action: from there the episode can go on "
            "a second time without that change."
            if steps.intervened.any()
            else "The rules changed nothing in this episode, so there is nothing to withhold."
        )
        return
    with st.container(horizontal=True, vertical_alignment="bottom"):
        chosen = st.segmented_control(
            "Withhold",
            list(RESTS),
            default=next(iter(RESTS)),
            key="withhold",
            bind="query-params",
            required=True,
        )
        rest = RESTS[chosen or next(iter(RESTS))]
        key = (order.request, current, rest)
        found = kept_forks().get(key)
        slot = st.empty()
        if found is None and slot.button(
            f"Go on without the change at step {current:,}",
            key="fork",
            icon=":material/call_split:",
        ):
            found = with_progress(lambda tell: run_fork(order, current, rest, tell))
            if found is not None:
                kept_forks().put(key, found)
                slot.empty()
    st.caption(
        f"{REST_TEXT[rest]} Up to step {current:,} both are the same episode, and the agent draws "
        "the same random numbers in both."
    )
    if found is not None:
        show(found)


def show(found: Fork) -> None:
    """Both branches, and what differs."""
    with_it, without = found.branches
    st.markdown(escaped(fork_text(found)))
    with st.grid(4, min_column_width=150):
        st.metric("Return with it", f"{with_it.gained:,.1f}", border=True, height="stretch")
        st.metric(
            "Return without it",
            f"{without.gained:,.1f}",
            delta=round(found.difference, 1),
            border=True,
            height="stretch",
        )
        st.metric("Length with it", f"{with_it.steps:,}", border=True, height="stretch")
        st.metric("Length without it", f"{without.steps:,}", border=True, height="stretch")
    gif = found.gif()
    st.image(gif, width="content", alt="Left: with the change. Right: without it.")
    st.download_button(
        "Download GIF",
        gif,
        f"fork-{found.step}-{found.rest}.gif",
        "image/gif",
        key="fork_gif",
        on_click="ignore",
        icon=":material/download:",
    )
