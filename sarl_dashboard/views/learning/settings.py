"""What the Learning page asks for: rules, ways to learn, and how long."""

from __future__ import annotations

from typing import NamedTuple

import streamlit as st

from sarl_core.environments.description import describe_environment
from sarl_core.errors import InputError, SarlError
from sarl_core.learning.arms import ARMS
from sarl_core.learning.run import TRIAL_EPISODES
from sarl_core.learning.study import LearningPlan
from sarl_core.rollouts.choices import CHOICE_TEXTS, Choice
from sarl_core.serving.limits import ServerLimits
from sarl_core.shielding.projection import Projection
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import notes_notice, projection_choice, rule_set_choice
from sarl_dashboard.jobs.learning import LearningOrder
from sarl_dashboard.state.agents import AGENTS, PROJECTIONS, has_expert, own_agents
from sarl_dashboard.state.environments import environment_of
from sarl_dashboard.state.rule_choice import rules_for
from sarl_dashboard.text import refuse

MOST_EPISODES = 500
NOBODY = "nobody"


def settings() -> LearningOrder | None:
    """The widgets; None where what they say cannot be learned, which is then said."""
    limits = ServerLimits.of_process()
    with st.container(border=True):
        with st.grid(3, min_column_width=150, gap="small"):
            rules = rule_set_choice(
                "learn_rules", about="In force while learning.", persist_state="session"
            )
            steps = st.number_input(
                "Steps",
                1_000,
                limits.learning_steps,
                min(20_000, limits.learning_steps),
                1_000,
                key="learn_steps",
                bind="query-params",
                persist_state="session",
                help=with_words(
                    "Of each learner. Lunar Lander needs 100,000 and more to show what a way to "
                    "learn is worth, Cart Pole 30,000. This server takes up to "
                    f"{limits.learning_steps:,}."
                ),
            )
            seeds = st.number_input(
                "Learners of each kind",
                1,
                limits.learning_seeds,
                1,
                key="learn_seeds",
                bind="query-params",
                persist_state="session",
                help=with_words(
                    "One may have been lucky; three say more. This server takes up to "
                    f"{limits.learning_seeds}."
                ),
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
        with st.container(horizontal=True, vertical_alignment="center", gap="small"):
            rest = further_settings()
            explain_arms()
    try:
        env_id = environment_of(None)
        rule_set = rules_for(rules)
        chosen = tuple(arm for arm in ARMS.values() if arm.name in names)
        if not chosen:
            raise InputError("no way to learn is chosen; choose at least one above")
        plan = LearningPlan(
            env_id,
            rule_set,
            chosen,
            int(steps),
            tuple(range(int(seeds))),
            rest.projection,
            rest.episodes,
            choose=rest.choose,
        )
        notes_notice(plan.notes)
    except SarlError as error:
        refuse(error)
        return None
    agent = rest.agent
    compared = None if agent == NOBODY else (agent, own_agents().get(agent, agent))
    return LearningOrder(
        env_id,
        rule_set,
        chosen,
        int(steps),
        int(seeds),
        rest.projection,
        rest.episodes,
        rest.choose,
        compared,
    )


class FurtherSettings(NamedTuple):
    """What few need to change.

    Attributes:
        episodes: After learning, of each learner.
        projection: What a continuous action that breaks a rule becomes.
        choose: What the best way to learn is chosen by.
        agent: Who plays too and learns nothing, or `NOBODY`.
    """

    episodes: int
    projection: Projection
    choose: Choice
    agent: str


def further_settings() -> FurtherSettings:
    """The widgets that most leave as they are."""
    with st.popover("More", icon=":material/tune:"):
        episodes = st.number_input(
            "Episodes afterwards",
            1,
            MOST_EPISODES,
            TRIAL_EPISODES,
            key="learn_episodes",
            bind="query-params",
            persist_state="session",
            help=with_words("After learning, of each learner, without the shield and with it."),
        )
        projection = PROJECTIONS[0] if is_discrete() else projection_choice()
        choose = st.selectbox(
            "Choose by",
            tuple(CHOICE_TEXTS),
            key="learn_choose",
            bind="query-params",
            persist_state="session",
            format_func=lambda name: f"{name} first",
            help=with_words(
                "Which way to learn is the best of those that are safe and good. Return: the "
                "highest mean return afterwards. Failures: the fewest failures, and among equals "
                "the highest mean return. It is reported on other episodes."
            ),
        )
        agent = st.selectbox(
            "Compare with",
            (NOBODY, *comparable_agents()),
            key="learn_compare",
            bind="query-params",
            persist_state="session",
            help=with_words(
                "An agent that plays the episodes after learning too, without the shield and "
                "with it, and learns nothing."
            ),
        )
    return FurtherSettings(int(episodes), projection, choose, agent)


def explain_arms() -> None:
    """What the ways to learn are."""
    with st.popover("What they do", icon=":material/help:", type="tertiary"):
        for arm in ARMS.values():
            st.markdown(f"**{arm.title}.** {arm.what}")
        st.caption(
            "PPO, DQN and SAC are the usual learners. PPO learns from what it has just done. "
            "DQN, and SAC where actions are continuous, learn from a memory of all they did."
        )


def comparable_agents() -> tuple[str, ...]:
    """Agents that need no file: the usual ones, and those of whoever runs the server."""
    try:
        expert = has_expert(environment_of(None))
    except SarlError:
        expert = False
    return (*(name for name in AGENTS if name != "expert" or expert), *own_agents())


def is_discrete() -> bool:
    """Whether the environment takes labels; True where it cannot be used."""
    try:
        return describe_environment(environment_of(None)).is_discrete
    except SarlError:
        return True
