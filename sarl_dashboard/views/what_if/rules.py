"""The rules that the page What if asks about."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.components.settings import notes_notice
from sarl_dashboard.state import compact_set, edits
from sarl_dashboard.state.mined import grown_trees, rules_at
from sarl_dashboard.state.rule_files import fitting_demonstrations
from sarl_dashboard.state.thresholds import chosen_divider

IN_FORCE, EDITED = "as mined", "edited"


@dataclass(frozen=True, eq=False)
class RulesOnTrees:
    """Rules, and the trees on which the way of a state is shown.

    Attributes:
        rule_set: The rules.
        trees: Of each action dimension, grown from the chosen data.
        leaves: Whether every leaf of them is a rule.
    """

    rule_set: RuleSet
    trees: tuple[PolicyTree, ...]
    leaves: bool


def chosen_rules(demonstrations: Demonstrations) -> RulesOnTrees:
    """The set in force, or the same with the edits."""
    compact = compact_set.chosen_compact(demonstrations)
    if compact is not None:
        in_force = RulesOnTrees(compact.counted, compact.trees, True)
    else:
        trees = grown_trees(demonstrations, chosen_divider())
        in_force = RulesOnTrees(rules_at(), trees, False)
    if (
        not edits.offered()
        or st.segmented_control(
            "Rules",
            [IN_FORCE, EDITED],
            default=IN_FORCE,
            key="edits",
            bind="query-params",
            required=True,
        )
        != EDITED
    ):
        return in_force
    edited = edits.edited_rules()
    fitted = fitting_demonstrations(edited, demonstrations)
    if fitted is not None:
        edited, notes = rules_for(edited, fitted)
        notes_notice(notes)
        return RulesOnTrees(edited, edits.edited_trees() or in_force.trees, in_force.leaves)
    st.info(
        "The edited rules speak of other features or actions than the chosen demonstrations, "
        "so the rules in force are shown instead; choose the demonstrations of their "
        "environment in the sidebar.",
        icon=":material/swap_horiz:",
    )
    return in_force
