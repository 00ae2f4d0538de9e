"""What the page Measure asks for: agents, shields, and the episodes to compare them on."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.mining.rules import FILTERED, UNFILTERED
from sarl_core.shielding.shield import Outside, Projection
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import (
    environment_choice,
    offered_rule_sets,
    rule_sets_help,
    shield_choice,
)
from sarl_dashboard.state import in_force
from sarl_dashboard.state.agents import (
    FRESH_SEED,
    PolicyFile,
    has_expert,
    offered_agents,
    policy_uploads,
)
from sarl_dashboard.state.environments import continuous, environment_of
from sarl_dashboard.state.rule_files import (
    CHOSEN,
    COMPACT_ENDINGS,
    EDITED,
    IN_FORCE,
    NO_SHIELD,
    OWN_FILE,
    PAPERS,
    UNEDITED,
)
from sarl_dashboard.state.thresholds import chosen_thresholds

MOST_EPISODES = 1_000


@dataclass(frozen=True, eq=False)
class ShieldChoices:
    """What the widgets say."""

    env: str | None
    episodes: int
    seed: int
    projection: Projection
    outside: Outside
    agents: list[str]
    shields: list[str]
    policy_files: list[PolicyFile]

    @property
    def from_demonstrations(self) -> bool:
        """Whether some of the rules come from the chosen demonstrations."""
        return any(name not in (NO_SHIELD, OWN_FILE) for name in self.shields)


def _usual_agents(env: str | None) -> list[str]:
    """Who acts where nothing else is said: also one who knows the task, if there is one."""
    with suppress(SarlError):
        if has_expert(environment_of(env)):
            return ["novice", "expert"]
    return ["novice"]


def _usual_shields() -> list[str]:
    """What is compared where nothing else is said: the paper's two, or what was chosen instead."""
    usual = in_force.kind() == CHOSEN and chosen_thresholds() in (FILTERED, UNFILTERED)
    return [NO_SHIELD, *(PAPERS if usual else [IN_FORCE])]


def settings() -> ShieldChoices:
    """The widgets."""
    with st.container(border=True):
        in_a_row = 5 if continuous(st.session_state.get("env")) else 4
        with st.grid(in_a_row, min_column_width=150, gap="small"):
            env = environment_choice()
            episodes = st.number_input(
                "Episodes",
                1,
                MOST_EPISODES,
                20,
                key="episodes",
                bind="query-params",
                help=with_words(
                    "So many for every agent with every shield, each on a seed of its own. The "
                    "paper's figures show 100."
                ),
            )
            seed = st.number_input(
                "First seed",
                0,
                2**31 - 1 - MOST_EPISODES,
                FRESH_SEED,
                key="first_seed",
                bind="query-params",
                help=with_words(
                    "The episodes start from this seed, the next one, and so on, the same for "
                    "all agents. The same seeds give the same result."
                ),
            )
            projection, outside = shield_choice(env)
        agents = st.pills(
            "Agents",
            offered_agents(),
            selection_mode="multi",
            default=_usual_agents(env),
            key="agents",
            bind="query-params",
            help=with_words(
                "Novice: random actions. Expert: the one that is shipped for this environment. "
                "Untrained: a fresh network, its actions sampled, which is nearly the same as "
                "random. Own file: policies of yours."
            ),
        )
        policy_files: list[PolicyFile] = []
        if OWN_FILE in agents:
            policy_files = policy_uploads("Policies", "policy_files", env)
        offered = offered_rule_sets(
            [NO_SHIELD, *PAPERS, IN_FORCE, CHOSEN, *COMPACT_ENDINGS, EDITED, UNEDITED]
        )
        shields = st.pills(
            "Shields",
            offered,
            selection_mode="multi",
            default=_usual_shields(),
            key="shields",
            bind="query-params",
            help=with_words(rule_sets_help(offered)),
        )
    return ShieldChoices(
        env,
        int(episodes or 1),
        int(seed or 0),
        projection,
        outside,
        [name for name in offered_agents() if name in agents],
        [name for name in offered if name in shields],
        policy_files,
    )
