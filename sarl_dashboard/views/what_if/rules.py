"""The rules that the page What if asks about."""

from __future__ import annotations

from dataclasses import dataclass

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.components.settings import notes_notice, other_data_notice
from sarl_dashboard.session import end_page
from sarl_dashboard.state import compact_set, edits, in_force, rule_base
from sarl_dashboard.state.mined import grown_trees, rules_at
from sarl_dashboard.state.rule_files import fitting_demonstrations
from sarl_dashboard.state.thresholds import chosen_divider


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
    """The rules in force, with their edits; where they are of something else, the page stops."""
    compact = compact_set.chosen_compact(demonstrations)
    trees = compact.trees if compact is not None else grown_trees(demonstrations, chosen_divider())
    if not in_force.is_edited():
        if compact is not None:
            return RulesOnTrees(compact.counted, trees, True)
        if rule_base.at_thresholds():
            return RulesOnTrees(rules_at(), trees, False)
    if other_data_notice():
        end_page()
    rules = in_force.rules()
    rules, notes = rules_for(rules, fitting_demonstrations(rules, demonstrations) or demonstrations)
    notes_notice(notes)
    base = rule_base.base()
    own = edits.trees_with(base, edits.history(base).edits)
    return RulesOnTrees(rules, own or trees, compact is not None)
