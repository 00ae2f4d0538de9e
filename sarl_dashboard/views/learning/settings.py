"""What the Learning page asks for: rules, ways to learn, and how long."""

from __future__ import annotations

import streamlit as st

from sarl_core.environments.description import describe_environment
from sarl_core.errors import InputError, SarlError
from sarl_core.learning.arms import ARMS
from sarl_core.learning.study import LearningPlan
from sarl_dashboard.components.settings import notes_notice
from sarl_dashboard.jobs.learning import LearningOrder
from sarl_dashboard.state.agents import PROJECTIONS
from sarl_dashboard.state.environments import environment_of
from sarl_dashboard.state.rule_choice import rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, OWN_FILE, compact_file
from sarl_dashboard.text import refuse

MOST_STEPS, MOST_SEEDS = 500_000, 5


def settings() -> LearningOrder | None:
    """The widgets; None where what they say cannot be learned, which is then said."""
    with st.container(border=True):
        discrete = is_discrete()
        with st.grid(3 if discrete else 4, min_column_width=150, gap="small"):
            rules = st.selectbox(
                "Rules",
                [
                    name
                    for name in ("unfiltered", "filtered", CHOSEN, COMPACT, OWN_FILE)
                    if name != COMPACT or compact_file().is_file()
                ],
                key="learn_rules",
                bind="query-params",
                persist_state="session",
                help="In force while learning. Unfiltered: support 0, confidence 1. Filtered: "
                "support 0.005, confidence 0.95. At the thresholds: those in the sidebar. "
                "Compact: a small set that is shipped. Own file: rules you saved.",
            )
            steps = st.number_input(
                "Steps",
                1_000,
                MOST_STEPS,
                20_000,
                1_000,
                key="learn_steps",
                bind="query-params",
                persist_state="session",
                help="Of each learner. Lunar Lander needs 100,000 and more to show what a way to "
                "learn is worth, Cart Pole 30,000.",
            )
            seeds = st.number_input(
                "Learners of each kind",
                1,
                MOST_SEEDS,
                1,
                key="learn_seeds",
                bind="query-params",
                persist_state="session",
                help="One may have been lucky; three say more.",
            )
            projection = PROJECTIONS[0]
            if not discrete:
                projection = st.selectbox(
                    "Replace by",
                    PROJECTIONS,
                    key="projection",
                    bind="query-params",
                    help="What a continuous action that breaks a rule becomes. Centre: the middle "
                    "of the rule's interval. Clip: the nearest value in it. Expert: what the "
                    "expert typically did there.",
                )
        names = st.pills(
            "Ways to learn",
            list(ARMS),
            selection_mode="multi",
            default=["none", "override", "handover"],
            format_func=lambda name: ARMS[name].title,
            key="learn_arms",
            bind="query-params",
            persist_state="session",
        )
        with st.popover("What they do", icon=":material/help:", type="tertiary"):
            for arm in ARMS.values():
                st.markdown(f"**{arm.title}.** {arm.what}")
            st.caption(
                "PPO, DQN and SAC are the usual learners. PPO learns from what it has just done. "
                "DQN, and SAC where actions are continuous, learn from a memory of all they did."
            )
        file = (
            st.file_uploader("Rule file (.json)", key="learn_rule_file")
            if rules == OWN_FILE
            else None
        )
    try:
        env_id = environment_of(None)
        rule_set = rules_for(rules, file)
        chosen = tuple(arm for arm in ARMS.values() if arm.name in names)
        if not chosen:
            raise InputError("no way to learn is chosen; choose at least one above")
        plan = LearningPlan(
            env_id, rule_set, chosen, int(steps), tuple(range(int(seeds))), projection
        )
        notes_notice(plan.notes)
    except SarlError as error:
        refuse(error)
        return None
    return LearningOrder(env_id, rule_set, chosen, int(steps), int(seeds), projection)


def is_discrete() -> bool:
    """Whether the environment takes labels; True where it cannot be used."""
    try:
        return describe_environment(environment_of(None)).is_discrete
    except SarlError:
        return True
