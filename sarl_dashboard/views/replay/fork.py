"""The fork on the page Replay: the same episode once more, without the change of one step."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.words.fork import REST_TEXT, fork_text
from sarl_core.rendering.fork import Fork, Rest
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.jobs.replays import FORK, Played, fork_cache, forking, movie
from sarl_dashboard.state.url import set_url_choice, url_text
from sarl_dashboard.text import digest_of, escaped
from sarl_dashboard.views.replay.player import film_player

RESTS: dict[str, Rest] = {"only this change": "shielded", "the shield from here on": "alone"}


def fork_section(played: Played, current: int) -> None:
    """What the change at a step was worth.

    Args:
        played: On screen.
        current: The step that is chosen.
    """
    steps, order = played.replay.steps, played.order
    changed = steps.intervened.nonzero()[0].tolist()
    possible = {f"{step}:{rest}" for step in changed for rest in RESTS.values()} | {""}
    linked = url_text("fork", "", possible.__contains__)
    st.html(heading("Without this change"))
    if not steps.intervened[current]:
        st.caption(
            "Choose a step at which the rules changed the action: from there the episode can go on "
            "a second time without that change."
            if steps.intervened.any()
            else "The rules changed nothing in this episode, so there is nothing to withhold."
        )
        return
    result = st.container()
    chosen = st.segmented_control(
        "Withhold",
        list(RESTS),
        default=next(iter(RESTS)),
        key="withhold",
        bind="query-params",
        required=True,
    )
    rest = RESTS[chosen or next(iter(RESTS))]
    key = (order.key, current, rest)
    about = (
        f"{REST_TEXT[rest]} Up to step {current:,} both are the same episode, and the agent draws "
        "the same random numbers in both."
    )
    name = f"{current}:{rest}"

    def start() -> Job[Fork]:
        set_url_choice("fork", name)
        return forking(order, current, rest)

    if (
        linked == name
        and key not in fork_cache()
        and not FORK.at_work
        and st.session_state.get("_fork_opened") != key
    ):  # a link to it; cancelled, it is not begun again
        st.session_state["_fork_opened"] = key
        FORK.begin(start)
    offer = Offer(
        key=key,
        start=start,
        about=about,
        complete=False,
        cancelled="Cancelled; nothing was kept.",
        label=f"Go on without the change at step {current:,}",
        icon=":material/call_split:",
        type="secondary",
    )

    def bar(at_work: bool) -> None:
        if at_work or key not in fork_cache():
            run_bar(FORK, offer)
        else:
            st.caption(about)

    watched(FORK, bar, seconds=0.5)
    branched = fork_cache().get(key)
    if branched is not None:
        with result:
            show(branched)


def show(branched: Fork) -> None:
    """Both branches, and what differs."""
    with_it, without = branched.branches
    st.markdown(escaped(fork_text(branched)))
    with st.grid(4, min_column_width=150):
        st.metric("Return with it", f"{with_it.gained:,.1f}", border=True, height="stretch")
        st.metric(
            "Return without it",
            f"{without.gained:,.1f}",
            delta=round(branched.difference, 1),
            border=True,
            height="stretch",
        )
        st.metric("Length with it", f"{with_it.steps:,}", border=True, height="stretch")
        st.metric("Length without it", f"{without.steps:,}", border=True, height="stretch")
    film = branched.replay
    gif, name = film.gif(), f"fork-{branched.step}-{branched.rest}"
    film_player(film, digest_of(gif), "Left: with the change. Right: without it.", key="fork_film")
    with st.container(horizontal=True):
        download("Download GIF", gif, f"{name}.gif", key="fork_gif")
        download("Download MP4", partial(movie, film), f"{name}.mp4", key="fork_mp4")
