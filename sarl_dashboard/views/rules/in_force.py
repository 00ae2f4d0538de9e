"""The rules in force, and what they come from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.words.what_if import node_in
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.state import compact_set, edits, in_force, rule_base
from sarl_dashboard.state.compact_set import Compact
from sarl_dashboard.state.data import data_parts
from sarl_dashboard.state.mined import grown_trees, mined_rules
from sarl_dashboard.state.rule_files import fitting_demonstrations
from sarl_dashboard.state.thresholds import chosen_divider, chosen_thresholds


class TreePlace(NamedTuple):
    """A node of a tree."""

    tree: PolicyTree
    node: int


@dataclass(frozen=True, eq=False)
class InForce:
    """The rules in force, and what they come from.

    Attributes:
        demonstrations: The chosen ones, with what the rules derive.
        trees: One an action dimension; () where the rules are not of trees that are known.
        thresholds: At which they are cut.
        compact: The compact set whose rules they are; None for others.
        rule_set: The rules, counted on the demonstrations where these have their features.
        edits: How many edits they have.
    """

    demonstrations: Demonstrations
    trees: tuple[PolicyTree, ...]
    thresholds: Thresholds
    compact: Compact | None
    rule_set: RuleSet
    edits: int = 0

    def place(self, rule: Rule) -> TreePlace | None:
        """Where a rule was cut; None where it is no node of these trees."""
        if rule.dimension >= len(self.trees):
            return None
        tree = self.trees[rule.dimension]
        node = node_in(tree, rule, self.rule_set, leaves=self.compact is not None)
        return None if node is None else TreePlace(tree, node)


def rules_in_force(demonstrations: Demonstrations) -> InForce:
    """The rules that were chosen in the sidebar, with their edits.

    Args:
        demonstrations: The chosen ones.
    """
    compact = compact_set.chosen_compact(demonstrations)
    if compact is not None:
        of = InForce(
            compact.demonstrations, compact.trees, chosen_thresholds(), compact, compact.counted
        )
    else:
        trees = grown_trees(demonstrations, chosen_divider())
        rule_set = mined_rules(trees, chosen_thresholds(), data_parts())
        of = InForce(demonstrations, trees, chosen_thresholds(), None, rule_set)
    if not in_force.is_edited() and (compact is not None or rule_base.at_thresholds()):
        return of
    base, rule_set = rule_base.base(), in_force.rules()
    fitted = fitting_demonstrations(rule_set, demonstrations)
    own = edits.trees_with(base, edits.history(base).edits)
    return InForce(
        fitted or demonstrations,
        () if fitted is None else own or of.trees,
        rule_set.thresholds,
        compact,
        rule_set,
        in_force.count(),
    )
