"""Learning: agents learn under the shield, and show what they are worth without it.

The study that is shipped stands first. Studies of a visitor's own learn in a process beside the
page, which goes on while other pages are looked at, and when all of them are closed.
"""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.views.learning.own import show_own
from sarl_dashboard.views.learning.shipped import show_shipped

SHIPPED, OWN = "The study", "Your own"

st.title("Learning")
st.caption(
    "How often agents fail while they learn by trial and error under the rules, and what they are "
    "worth when the shield is taken off."
)
view = st.segmented_control(
    "View",
    [SHIPPED, OWN],
    default=SHIPPED,
    key="learn_view",
    bind="query-params",
    persist_state="session",
    required=True,
    label_visibility="collapsed",
)
if view == SHIPPED:
    show_shipped()
else:
    show_own()
