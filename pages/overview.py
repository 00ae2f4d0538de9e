"""Overview: what this is, three ways in, what has been done, and what the words mean."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.components.journey.words import ANCHOR, show_words
from sarl_dashboard.views.overview.doors import show_doors
from sarl_dashboard.views.overview.replay import show_replay
from sarl_dashboard.views.overview.stages import show_stages

st.title("Overview")
st.caption(
    "From recordings of an expert to a few rules that a person can read, and that correct an agent "
    "before it acts."
)
left, right = st.columns([5, 3], gap="medium")
with left:
    show_replay()
with right:
    show_doors()
show_stages()
st.header("Words", anchor=ANCHOR)
show_words(2)
