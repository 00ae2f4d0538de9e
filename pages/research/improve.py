"""Improve: the expert answers where the rules lead, and few rules are made of all its answers.

Where there is nobody to ask, the page shows which states need a demonstration. The work goes on
beside the page, in processes of its own.
"""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_dashboard.components.journey.environment_needed import require_environment
from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.components.run_bar import bars_at_work
from sarl_dashboard.session import end_page
from sarl_dashboard.state.data import require_demonstrations
from sarl_dashboard.text import refuse
from sarl_dashboard.views.improve.order import order_of
from sarl_dashboard.views.improve.run import PLACE, run_of
from sarl_dashboard.views.improve.settings import settings

st.title("Improve")
st.caption(
    "Better rules of the same expert: they act, it says what it would have done where they lead, "
    "and few rules are made of all its answers; with nobody to ask, the states that need a "
    "demonstration."
)
require_environment(PLACE)
demonstrations = require_demonstrations()
if say_steps_needed("improving rules", demonstrations):
    bars_at_work(PLACE)
    end_page()
choices = settings(demonstrations)
order = None
try:
    order = order_of(choices, demonstrations)
except SarlError as error:
    refuse(error)
run_of(order)
