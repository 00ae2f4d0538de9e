"""Measure: any agents with any shields on the same seeds, in one table and one picture.

What is known of the present choices is shown at once, whoever ran it and whenever; Run adds what is
missing. The work goes on beside the page, in processes of its own.
"""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_dashboard.components.journey.environment_needed import require_environment
from sarl_dashboard.components.run_bar import bars_at_work
from sarl_dashboard.components.settings import known_seeds_notice, other_data_notice
from sarl_dashboard.jobs.certificates import CERTIFICATE
from sarl_dashboard.jobs.episodes import COMPARISON
from sarl_dashboard.session import end_page
from sarl_dashboard.state.environments import demonstrated, environment_of
from sarl_dashboard.state.rule_files import IN_FORCE
from sarl_dashboard.text import refuse
from sarl_dashboard.views.shield.certificate import certify_section
from sarl_dashboard.views.shield.lines import guards, line, pilots
from sarl_dashboard.views.shield.settings import settings
from sarl_dashboard.views.shield.table import comparison_of

st.title("Measure")
st.caption(
    "What a shield is worth that was learned from demonstrations and guarantees nothing: agents "
    "with the rules and without, on the same seeds."
)
require_environment(COMPARISON)
choices = settings()
if choices.from_demonstrations and IN_FORCE in choices.shields:
    other_data_notice()
try:
    env_id = environment_of(choices.env)
    agents = pilots(choices, env_id)
except SarlError as error:
    refuse(error)
    bars_at_work(COMPARISON, CERTIFICATE)
    end_page()
shields = guards(choices)
lines = [line(choices, env_id, agent, shield) for agent in agents for shield in shields]
if not lines:
    st.info(
        "Choose at least one agent and one shield; a shield of your own needs its file.",
        icon=":material/checklist:",
    )
    bars_at_work(COMPARISON, CERTIFICATE)
    end_page()
if choices.from_demonstrations and demonstrated(env_id, choices.seed, choices.episodes):
    known_seeds_notice()
comparison_of(lines, choices.episodes)
certify_section(lines)
