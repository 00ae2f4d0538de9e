"""Rules: every rule in plain language, with the evidence behind it."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.components.elsewhere import elsewhere_notice
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.state.data import require_demonstrations
from sarl_dashboard.state.mined import fidelity_at
from sarl_dashboard.views.rules.in_force import rules_in_force
from sarl_dashboard.views.rules.table import nothing_in_force, search_and_rules

st.title("Rules")
st.caption("Every rule in words, and how much of what the expert did stands behind it.")
in_force = rules_in_force(require_demonstrations())
if not in_force.rule_set.rules:
    nothing_in_force(in_force.thresholds)
else:
    if not in_force.edits:
        elsewhere_notice(in_force.thresholds, fidelity_at(in_force.thresholds))
    search_and_rules(in_force)
cross_fitting.make_ready()
