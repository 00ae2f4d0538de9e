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
from sarl_dashboard.state.data import held_out_digest
from sarl_dashboard.state.mined import grown_trees, mined_rules
from sarl_dashboard.state.thresholds import chosen_divider, chosen_thresholds


@dataclass(frozen=True, eq=False)
class InForce:
    """The rules in force, and what they come from.

    Attributes:
        demonstrations: The chosen ones.
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

    @property
    def compact_digest(self) -> str:
        """What tells a compact set from others; "" for mined rules."""
        return self.compact.digest if self.compact is not None else ""

    @property
    def key(self) -> tuple[object, ...]:
        """What tells the rules, and what is known of them, from all others."""
        if self.compact is not None:
            return (self.compact.digest,)
        rule_set = self.rule_set
        return rule_set.source.digest, rule_set.divider, self.thresholds, held_out_digest()

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
        rule_set = mined_rules(trees, thresholds) if compact is None else compact.counted
    return InForce(demonstrations, trees, thresholds, compact, rule_set)
