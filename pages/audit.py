"""Audit: rules held against a log of what somebody did, and the episodes in which they broke."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.views.audit.answer import show_answer
from sarl_dashboard.views.audit.logs import chosen_logs, chosen_rules
from sarl_dashboard.views.audit.timeline import show_timeline

st.title("Audit")
st.caption(
    "Rules held against a log of what somebody did (a person, a controller, an agent in "
    "operation), for which no environment is needed."
)
rules = chosen_rules()
logs = chosen_logs(rules)
show_answer(logs)
show_timeline(rules, logs.first)
