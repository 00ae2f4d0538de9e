"""Worth of each rule: what each rule of a shield is worth, found by taking it out.

What is known of the present choices is shown at once, whoever ran it and whenever; Run adds what is
missing. The work goes on beside the page, in processes of its own.
"""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_dashboard.components.journey.environment_needed import require_environment
from sarl_dashboard.components.run_bar import bars_at_work
from sarl_dashboard.components.settings import known_seeds_notice
from sarl_dashboard.session import end_page
from sarl_dashboard.text import refuse
from sarl_dashboard.views.ablation.outcome import PLACE, outcome
from sarl_dashboard.views.ablation.settings import settings

st.title("Worth of each rule")
st.caption(
    "What each rule is worth: the same episodes again with one rule taken out, so that one sees "
    "which rules carry load, which do harm, and which do nothing."
)
require_environment(PLACE)
try:
    choice = settings()
except SarlError as error:
    refuse(error)
    bars_at_work(PLACE)
    end_page()
if choice.on_demonstrated_seeds:
    known_seeds_notice()
outcome(choice)
