"""The settings of the page Replay, and the order that they make."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.environments.description import describe_environment
from sarl_core.explaining.words.replay import named_description
from sarl_core.rollouts.player import shield_for
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Outside, Shield
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import (
    environment_choice,
    own_policy,
    rule_set_choice,
    shield_choice,
)
from sarl_dashboard.jobs.replays import ReplayOrder
from sarl_dashboard.state.agents import (
    FRESH_SEED,
    PolicyFile,
    agent_for,
    offered_agents,
)
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.environments import continuous, environment_of
from sarl_dashboard.state.rule_choice import rules_called, rules_for
from sarl_dashboard.state.rule_files import NO_RULES


@dataclass(frozen=True, eq=False)
class ReplaySettings:
    """What the widgets say; what it asks for is put together when it is needed."""

    env: str | None
    agent: str
    policy_file: PolicyFile | None
    rules: str
    seed: int
    projection: Projection
    outside: Outside

    def order(self) -> ReplayOrder:
        """What is asked for.

        Raises:
            SarlError: If it cannot be had.
        """
        env_id = environment_of(self.env)
        rule_set = rules_for(self.rules)
        if rule_set is not None:
            rule_set = shield_for(env_id, Shield(rule_set)).rule_set
        agent = agent_for(self.agent, self.policy_file, env_id, self.seed)
        description = named_description(
            describe_environment(env_id), rule_set, chosen_demonstrations()
        )
        return ReplayOrder(
            env_id,
            agent,
            rules_called(self.rules),
            rule_set,
            self.projection,
            self.seed,
            self.outside,
            description,
        )


def settings() -> ReplaySettings:
    """The widgets."""
    with st.container(border=True):
        in_a_row = 6 if continuous(st.session_state.get("env")) else 5
        with st.grid(in_a_row, min_column_width=150, gap="small"):
            env = environment_choice()
            agent = st.selectbox(
                "Agent",
                offered_agents(),
                key="agent",
                bind="query-params",
                help=with_words(
                    "Novice: random actions. Untrained: a fresh network, its actions sampled. "
                    "Expert: the one that is shipped for this environment. Own file: a policy "
                    "of yours."
                ),
            )
            rules = rule_set_choice("rules", more=[NO_RULES])
            seed = st.number_input(
                "Seed",
                0,
                2**31 - 1,
                FRESH_SEED,
                key="seed",
                bind="query-params",
                help=with_words(
                    "Both runs start in the same state and draw the same random numbers; the "
                    "same seed gives the same replay."
                ),
            )
            projection, outside = shield_choice(env)
        policy_file = own_policy(agent, env)
    return ReplaySettings(env, agent, policy_file, rules, int(seed or 0), projection, outside)
