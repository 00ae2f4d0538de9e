"""What a replay is of, and the film of it."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.keeping import keep_result_button
from sarl_dashboard.components.settings import no_boxes_notice, notes_notice
from sarl_dashboard.jobs.replays import ReplayPair, movie
from sarl_dashboard.state.agents import FRESH_SEED
from sarl_dashboard.state.environments import demonstrated
from sarl_dashboard.state.rule_files import NO_RULES, OWN_FILE
from sarl_dashboard.text import escaped
from sarl_dashboard.views.replay.player import film_player, step_of
from sarl_dashboard.views.replay.steps import look_at


def headline(replay: ReplayPair) -> None:
    """Whose episode it is, and what should be known about it.

    Args:
        replay: To show.
    """
    order, rule_set = replay.order, replay.order.rule_set
    st.markdown(
        f"**{escaped(replay.plain.agent.capitalize())}** in **{escaped(str(order.env_id))}**, seed "
        f"{order.seed}" + (f", {len(rule_set):,} rules ({order.rules})" if rule_set else "")
    )
    notes_notice(note for episode in replay.film.episodes for note in episode.remarks)
    no_boxes_notice([] if rule_set is None else [rule_set], order.outside)


def film(replay: ReplayPair) -> None:
    """The episode as a film, and the film as files."""
    order = replay.order
    if order.rules not in (OWN_FILE, NO_RULES) and demonstrated(order.env_id, order.seed, 1):
        st.caption(
            ":material/casino: The demonstrations have an episode of this seed, where the rules "
            f"know the way. A seed such as {FRESH_SEED:,} shows what they bring elsewhere."
        )
    film_player(
        replay.film,
        replay.name,
        "The episode, with the rules and without" if replay.shielded is not None else "The episode",
        key="film",
        on_step=pick_in_film,
    )
    env = str(order.env_id).rsplit("/", 1)[-1].rsplit(":", 1)[-1]
    name = f"replay-{env}-{order.agent.choice}-{order.seed}"
    with st.container(horizontal=True):
        download("Download GIF", replay.film.gif(), f"{name}.gif", key="gif")
        download("Download MP4", partial(movie, replay.film), f"{name}.mp4", key="mp4")
        keep_result_button(replay.film.gif(), f"{name}.gif", key="keep_replay")


def pick_in_film() -> None:
    """Go to the step at which the film was stopped; for a callback, and the last thing it does."""
    look_at(step_of("film"))
