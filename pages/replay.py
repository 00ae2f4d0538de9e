"""An agent in its environment, with the rules as a shield and without, on one seed."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.components.journey.environment_needed import require_environment
from sarl_dashboard.jobs.replays import EPISODE_RUNS, FORK, REPLAY, arrived, latest
from sarl_dashboard.views.replay.episodes import comparison, take_up
from sarl_dashboard.views.replay.film import film, headline
from sarl_dashboard.views.replay.numbers import numbers
from sarl_dashboard.views.replay.run import arrive, open_with, replay_bar, set_out
from sarl_dashboard.views.replay.settings import settings
from sarl_dashboard.views.replay.steps import step_by_step

st.title("Replay")
st.caption(
    "An agent with the rules as a shield, which replaces actions that break one, and without; the "
    "rules are learned from demonstrations and guarantee nothing."
)
set_out()
require_environment(REPLAY, FORK, EPISODE_RUNS)
result, form = st.container(), st.container()
with form:
    choices = settings()
with result:
    order = open_with(choices)
at_work = REPLAY.at_work
jump = arrived()
played = latest()
first = played is None and at_work
# How far the work is stands where the picture will be, or below the form that asked for it. It is
# drawn before all that follows: a press on Run is answered with it.
with result if first else form:
    if first:
        st.caption("The first replay begins by itself. In the form below you choose another one.")
    replay_bar(order, played, missed=at_work and jump is None)
if played is None:
    if order is not None and not REPLAY.at_work:
        st.info(
            "Choose an agent and the rules, then press Run. What rules do shows best with the "
            "novice, which acts at random, and the unfiltered rules; those at the paper's filtered "
            "thresholds may apply at few steps. The work goes on while you look at other pages.",
            icon=":material/play_circle:",
        )
else:
    with result:
        headline(played.replay)
        film(played.replay)
        numbers(played.replay)
    take_up(played.order)
    step_by_step(played)
    if jump is not None:
        arrive(jump, played)
    comparison(played.order)
