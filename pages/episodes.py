"""Episodes: what was demonstrated, step by step."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.state.data import all_demonstrations, require_demonstrations
from sarl_dashboard.views.episodes.steps import show_episodes

st.title("Episodes")
st.caption(
    "What was demonstrated, one episode at a time: the actions, the rule that applies at each "
    "step, and the features."
)
require_demonstrations()
demonstrations = all_demonstrations()
assert demonstrations is not None
if not say_steps_needed("going through an episode", demonstrations):
    show_episodes(demonstrations)
