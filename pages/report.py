"""Report: the rules in one file, for people who know only the task."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_dashboard.jobs.report import comparison_of_session
from sarl_dashboard.session import end_page
from sarl_dashboard.state.data import chosen_dataset, require_demonstrations
from sarl_dashboard.text import refuse
from sarl_dashboard.views.report.order import order_of
from sarl_dashboard.views.report.preview import report_of
from sarl_dashboard.views.report.settings import settings

st.title("Report")
st.caption(
    "The rules in one file for people who know only the task: what was demonstrated, every rule in "
    "words with its evidence and pictures, what the rules do not reach, and what nobody promises."
)
demonstrations = require_demonstrations()
comparison, _ = comparison_of_session(demonstrations.env_id)
choices = settings(comparison is not None)
try:
    order = order_of(choices, demonstrations)
except SarlError as error:
    refuse(error)
    end_page()
report_of(order, chosen_dataset().replace("_", "-"))
