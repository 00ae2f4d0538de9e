"""What the Improve page asks for: who is asked, for how many rules, and how often."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import SarlError
from sarl_core.improving.plan import Plan
from sarl_core.improving.refinement import SearchEffort
from sarl_core.mining.budgeted_trees import MIN_RULES
from sarl_core.rollouts.choices import CHOICE_TEXTS, Choice
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import environment_choice
from sarl_dashboard.state.agents import PolicyFile, has_expert, own_agents, policy_upload
from sarl_dashboard.state.environments import environment_of
from sarl_dashboard.state.rule_files import OWN_FILE
from sarl_dashboard.state.thresholds import MAX_DIVIDER, MIN_DIVIDER

SHIPPED_EXPERT, NOBODY = "shipped", "nobody"
EVERY_LEAF, AT_THRESHOLDS = "every leaf", "at the thresholds"
MOST = 1_000  # of rules, episodes and steps; what needs more is for the command line
MOST_ROUNDS = 200


@dataclass(frozen=True, eq=False)
class ImproveChoices:
    """What the widgets say."""

    env: str | None
    expert: str
    policy_file: PolicyFile | None
    max_rules: int
    cut: str
    rounds: int
    episodes: int
    refinement: int
    validation: int
    seed: int
    divider: int
    choose: Choice


def number(label: str, key: str, low: int, high: int, usual: int, hint: str) -> int:
    """A whole number."""
    value = st.number_input(
        label, low, high, usual, key=key, bind="query-params", help=with_words(hint)
    )
    return int(usual if value is None else value)


def _usual_expert(env: str | None) -> str:
    """Who is asked where nothing else is said: who is offered, where no expert is shipped."""
    with suppress(SarlError):
        if not has_expert(environment_of(env)):
            return next(iter(own_agents()), SHIPPED_EXPERT)
    return SHIPPED_EXPERT


def settings(demonstrations: Demonstrations) -> ImproveChoices:
    """The widgets."""
    expert = st.session_state.get("expert") or st.query_params.get("expert")
    has_expert = expert != NOBODY
    max_rules, rounds, episodes, policy_file = MIN_RULES, 1, 0, None
    with st.container(border=True):
        with st.grid(4 if has_expert else 3, min_column_width=150, gap="small"):
            env = environment_choice()
            experts = (SHIPPED_EXPERT, *own_agents(), OWN_FILE, NOBODY)
            expert = st.selectbox(
                "Expert",
                experts,
                index=experts.index(_usual_expert(env)),
                key="expert",
                bind="query-params",
                help=with_words(
                    "Who is asked. Shipped: the expert that comes with this environment. Own "
                    "file: a policy of yours. Nobody: the page shows which states need a "
                    "demonstration."
                ),
            )
            if has_expert:
                max_rules = number(
                    "Most rules",
                    "max_rules",
                    MIN_RULES,
                    MOST,
                    24,
                    "Of each action. Few can be read, more achieve more.",
                )
                rounds = number(
                    "Rounds",
                    "rounds",
                    1,
                    MOST_ROUNDS,
                    10,
                    "How often the rules act and the expert answers. The best round is kept.",
                )
            else:
                episodes = _episodes("Episodes")
        with st.popover("More", icon=":material/tune:"):
            rest = _further(demonstrations, rounds, has_expert=has_expert)
        if expert == OWN_FILE:
            policy_file = policy_upload("The expert", "expert_file", env)
    return ImproveChoices(
        env,
        expert,
        policy_file,
        max_rules,
        rest.cut,
        rounds,
        episodes or rest.episodes,
        rest.refinement,
        rest.validation,
        rest.seed,
        rest.divider,
        rest.choose,
    )


@dataclass(frozen=True)
class FurtherChoices:
    """What few need to change, as `ImproveChoices` has it."""

    episodes: int
    cut: str
    refinement: int
    validation: int
    seed: int
    divider: int
    choose: Choice


def _episodes(label: str) -> int:
    return number(
        label,
        "round_episodes",
        1,
        MOST,
        20,
        "In each of them the rules shield a novice, which acts at random.",
    )


def _further(demonstrations: Demonstrations, rounds: int, *, has_expert: bool) -> FurtherChoices:
    """The widgets that most leave as they are."""
    cut, episodes, refinement, validation, divider = EVERY_LEAF, 0, 0, 1, MIN_DIVIDER
    choose: Choice = "return"
    if has_expert:
        cut = st.selectbox(
            "Rules are",
            (EVERY_LEAF, AT_THRESHOLDS),
            key="cut",
            bind="query-params",
            help=with_words(
                "Every leaf: in every state some rule applies. At the thresholds: only where "
                "support and confidence reach those in the sidebar; elsewhere the agent acts alone."
            ),
        )
        episodes = _episodes("Episodes a round")
        validation = number(
            "Episodes to choose by",
            "validation",
            1,
            MOST,
            128,
            "All rounds are tried on a few episodes, the better half on twice as many, and so on; "
            "the last one left on this many.",
        )
        choose = st.selectbox(
            "Choose by",
            tuple(CHOICE_TEXTS),
            key="choose",
            bind="query-params",
            format_func=lambda name: f"{name} first",
            help=with_words(
                "Which of the tried is the best. Return: the highest mean return. Failures: the "
                "fewest failures, and among equals the highest mean return. It is reported on "
                "other episodes."
            ),
        )
        if cut == EVERY_LEAF:
            effort = SearchEffort(Plan.search_episodes, rounds)
            none, one = (effort.cost(turns) for turns in range(2))
            refinement = number(
                "Refinement turns",
                "refine",
                0,
                MOST,
                0,
                "Afterwards the rules' conditions, numbers and actions are changed to where they "
                f"achieve more, so many times. Each turn takes up to {one - none:,} episodes, and "
                f"before the first one some of the rounds are moved, which takes {none:,}. 0: not "
                "at all.",
            )
    seed = number("Seed", "improve_seed", 0, MOST, 0, "Another one gives other episodes.")
    if not demonstrations.is_discrete:
        divider = st.slider(
            "Divider",
            MIN_DIVIDER,
            MAX_DIVIDER,
            key="divider",
            value=MIN_DIVIDER,
            bind="query-params",
            help=with_words("Number of equal intervals each continuous action is divided into."),
        )
    return FurtherChoices(episodes, cut, refinement, validation, seed, divider, choose)
