"""The settings of the page Worth of each rule, and the ablation that they ask for."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.errors import InputError
from sarl_core.rollouts.player import check_environment
from sarl_core.shielding.shield import Shield
from sarl_core.studies.ablation import MOST_RULES
from sarl_core.studies.ablation_run import LEAST_EPISODES
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import (
    environment_choice,
    no_boxes_notice,
    notes_notice,
    own_policy,
    rule_set_choice,
    shield_choice,
)
from sarl_dashboard.jobs.ablation import Wanted
from sarl_dashboard.jobs.episodes import Row
from sarl_dashboard.state import in_force
from sarl_dashboard.state.agents import FRESH_SEED, agent_for, offered_agents
from sarl_dashboard.state.environments import demonstrated, environment_of
from sarl_dashboard.state.rule_choice import rules_for
from sarl_dashboard.state.rule_files import IN_LIBRARY, OWN_FILE

MOST_EPISODES = 500


@dataclass(frozen=True, eq=False)
class AblationChoice:
    """What was chosen.

    Attributes:
        wanted: The ablation.
        rules: What its rules are called on screen.
    """

    wanted: Wanted
    rules: str

    @property
    def linked(self) -> dict[str, str] | None:
        """The address of its rules on the Rules page; None if they are not there."""
        return in_force.address_of(self.rules)

    @property
    def on_demonstrated_seeds(self) -> bool:
        """Whether some of its episodes are among the demonstrated ones."""
        row, episodes = self.wanted.row, self.wanted.episodes
        return self.rules not in (IN_LIBRARY, OWN_FILE) and demonstrated(
            row.env_id, row.seed, episodes
        )


def settings() -> AblationChoice:
    """The widgets, and what they ask for.

    Raises:
        SarlError: If it cannot be had.
    """
    with st.container(border=True):
        with st.grid(4, min_column_width=150, gap="small"):
            env = environment_choice()
            agent = st.selectbox(
                "Agent",
                offered_agents(),
                key="agent",
                bind="query-params",
                help=with_words(
                    "Whom the rules hold. With the novice, which acts at random, they have the "
                    "most to do."
                ),
            )
            rules = rule_set_choice("rules")
            most = st.number_input(
                "Rules to take out",
                1,
                MOST_RULES,
                25,
                key="most_rules",
                bind="query-params",
                help=with_words("At most so many: those that change the most actions."),
            )
            episodes = st.number_input(
                "Episodes",
                LEAST_EPISODES,
                MOST_EPISODES,
                50,
                key="ablation_episodes",
                bind="query-params",
                help=with_words(
                    "With every rule taken out, and with none. More of them show smaller "
                    "differences."
                ),
            )
            seed = st.number_input(
                "First seed",
                0,
                2**31 - 1 - 1_000,
                FRESH_SEED,
                key="first_seed",
                bind="query-params",
                help=with_words(
                    "The episodes start from this seed, the next one, and so on, the same with "
                    "every rule taken out. The same seeds give the same result."
                ),
            )
            projection, outside = shield_choice(env)
        policy_file = own_policy(agent, env)

    env_id, first = environment_of(env), int(seed or 0)
    rule_set = rules_for(rules)
    chosen = agent_for(agent, policy_file, env_id, first)
    if rule_set is None or not any(rule.enabled for rule in rule_set.rules):
        raise InputError(
            "there is no rule that could be taken out; lower the thresholds in the sidebar, or "
            "choose other rules"
        )
    no_boxes_notice([rule_set], outside)
    notes_notice(check_environment(env_id, Shield(rule_set)).notes)
    row = Row("all rules", env_id, first, chosen, rule_set, projection, outside)
    wanted = Wanted(row, int(episodes or LEAST_EPISODES), int(most or 1))
    return AblationChoice(wanted, rules)
