"""Evidence: how sure each rule is, and whether the demonstrations are enough and agree."""

from __future__ import annotations

import streamlit as st
from markupsafe import Markup

from sarl_core.explaining.html.headings import note
from sarl_core.explaining.words.cross_fit import influence_sentences
from sarl_core.mining.language import share_text, threshold_text
from sarl_dashboard.components.edits_notice import without_edits_notice
from sarl_dashboard.components.elsewhere import elsewhere_notice
from sarl_dashboard.components.hold_out import leave_out_choice
from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.session import end_page
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.data import all_demonstrations, mined_data, require_demonstrations
from sarl_dashboard.state.mined import fidelity_at
from sarl_dashboard.state.thresholds import (
    BOTH,
    DEMAND,
    chosen_confidence,
    chosen_epsilon,
    chosen_mode,
    chosen_thresholds,
)
from sarl_dashboard.views.evidence.contradictions import show_contradictions
from sarl_dashboard.views.evidence.evidence import chosen_evidence
from sarl_dashboard.views.evidence.held_out import hold_out_choice
from sarl_dashboard.views.evidence.learning_curve import show_curve
from sarl_dashboard.views.evidence.missing_episodes import show_enough
from sarl_dashboard.views.evidence.overview import show_overview
from sarl_dashboard.views.evidence.stability import show_stability

st.title("Evidence")
st.caption(
    "How sure each rule is: how often it was right in episodes that it was not mined from, and in "
    "how many of them, each counted once because its steps are alike."
)
require_demonstrations()
forbids = chosen_mode() != DEMAND
if forbids:
    st.caption(
        "A rule that forbids is right in a state if the expert did not do there what it forbids. "
        f"At an epsilon of {threshold_text(chosen_epsilon())} it should be in at least "
        f"{share_text(1.0 - chosen_epsilon())} of the states of an episode."
    )
if chosen_mode() == BOTH:
    st.caption(
        f"A rule that demands should be right in at least {share_text(chosen_confidence())}, the "
        "minimum confidence. Each rule is tried in all states that it applies to. All together are "
        "judged as they are used: where a rule that demands applies, those that forbid have no say."
    )
mined = mined_data()
if forbids and mined is not None and mined.held_out and not mined.counted(chosen_thresholds()):
    st.info(
        "Of more than two actions a mined file counts, in the episodes held out, how often the "
        "expert did the most frequent one, and not how often it did another that is forbidden; "
        "choose rules that demand on the page Thresholds, or the demonstrations themselves in the "
        "sidebar.",
        icon=":material/block:",
    )
    end_page()
demonstrations = all_demonstrations()
assert demonstrations is not None
hold_out_choice(demonstrations)
without_edits_notice()
if not rule_base.at_thresholds():
    st.info(
        "The rules in force were built from other states, the held-out ones perhaps among them, so "
        "they cannot be tried here. This page is about the rules at the thresholds.",
        icon=":material/info:",
    )
evidence = chosen_evidence()
if not evidence.rule_set.rules:
    st.info(
        "There is no rule at the present thresholds. Lower one of them on the Thresholds page, "
        "whose maps show where there are rules.",
        icon=":material/filter_alt_off:",
    )
    st.page_link("thresholds.py", label="Go to Thresholds", icon=":material/arrow_forward:")
else:
    show_overview(evidence)
    if not (evidence.mined and evidence.held_out):  # what these episodes say stands above
        elsewhere_notice(
            evidence.thresholds,
            fidelity_at(evidence.thresholds),
            lambda judged: Markup().join(map(note, influence_sentences(judged))),
        )
enough, curve, stability, contradictions, left_out = st.tabs(
    [
        "Enough demonstrations?",
        "Learning curve",
        "Stability",
        "Contradictions",
        "Leave episodes out",
    ],
    key="about",
    on_change="rerun",
    bind="query-params",
)
if curve.open:
    with curve:
        show_curve(evidence)
elif stability.open:
    with stability:
        show_stability(evidence)
elif contradictions.open:
    with contradictions:
        show_contradictions(evidence.parts.remaining, evidence.rule_set)
elif left_out.open:
    with left_out:
        if not say_steps_needed("leaving episodes out", demonstrations):
            st.caption(
                "Episodes that are left out are there for nothing: rules are neither mined from "
                "them nor tried on them, on any page. The file stays as it is."
            )
            leave_out_choice(demonstrations)
elif evidence.rule_set.rules:
    with enough:
        show_enough(evidence)
cross_fitting.make_ready()
