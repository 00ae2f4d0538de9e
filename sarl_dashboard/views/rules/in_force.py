"""The rules in force, and what they come from."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.state import compact_set
from sarl_dashboard.state.compact_set import Compact
from sarl_dashboard.state.data import data_parts
from sarl_dashboard.state.mined import grown_trees, mined_rules
from sarl_dashboard.state.thresholds import chosen_divider, chosen_thresholds


@dataclass(frozen=True, eq=False)
class InForce:
    """The rules in force, and what they come from.

    Attributes:
        demonstrations: The chosen ones, with what the rules derive.
        trees: One an action dimension.
        thresholds: At which they are cut.
        compact: The compact set whose rules they are; None for mined ones.
        rule_set: The rules, counted on the demonstrations.
    """

    demonstrations: Demonstrations
    trees: tuple[PolicyTree, ...]
    thresholds: Thresholds
    compact: Compact | None
    rule_set: RuleSet

    def tree(self, rule: Rule) -> PolicyTree:
        """The tree of a rule's action dimension."""
        return self.trees[rule.dimension]


def rules_in_force(demonstrations: Demonstrations) -> InForce:
    """The compact rules where they were chosen, else those at the thresholds.

    Args:
        demonstrations: The chosen ones.
    """
    compact = compact_set.chosen_compact(demonstrations)
    thresholds = chosen_thresholds()
    trees = grown_trees(demonstrations, chosen_divider()) if compact is None else compact.trees
    with st.spinner("Mining the rules …"):
        rule_set = (
            mined_rules(trees, thresholds, data_parts()) if compact is None else compact.counted
        )
    if compact is not None:
        demonstrations = compact.demonstrations
    return InForce(demonstrations, trees, thresholds, compact, rule_set)
