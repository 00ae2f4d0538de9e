"""What if: one state, and what the shield would do in it, why, and what would change that."""

from __future__ import annotations

import streamlit as st

from sarl_core.shielding.projection import Projection
from sarl_dashboard.components.journey.steps_needed import say_of_sample
from sarl_dashboard.components.settings import (
    no_boxes_notice,
    outside_choice,
    projection_choice,
)
from sarl_dashboard.session import end_page
from sarl_dashboard.state.agents import PROJECTIONS
from sarl_dashboard.state.data import require_demonstrations
from sarl_dashboard.views.what_if.answer import question_and_answer
from sarl_dashboard.views.what_if.rules import chosen_rules
from sarl_dashboard.views.what_if.situation import situation_of
from sarl_dashboard.views.what_if.state import fit_sliders

st.title("What if")
st.caption(
    "One state, and what the shield would do in it: the rule that applies, the rules that nearly "
    "do, and the least change that makes it decide otherwise."
)
demonstrations = require_demonstrations()
rules = chosen_rules(demonstrations)
if not rules.rule_set.rules:
    st.info(
        "No rule is in force, so there is nothing to ask. Lower a threshold on the Thresholds "
        "page, whose maps show where there are rules.",
        icon=":material/filter_alt_off:",
    )
    st.page_link("thresholds.py", label="Go to Thresholds", icon=":material/arrow_forward:")
    end_page()
with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
    outside = outside_choice(220)
    projection: Projection = PROJECTIONS[0]
    if rules.rule_set.actions[0].is_interval:
        projection = projection_choice(220)
no_boxes_notice([rules.rule_set], outside)
say_of_sample("The ranges and medians of features", demonstrations)
situation = situation_of(demonstrations, rules, projection, outside)
fit_sliders(situation)
question_and_answer(situation)
