"""A compact set as the rules in force: in the URL, and counted on the chosen demonstrations.

They come as a file, built from other pairs than those on screen. What stands behind a rule is
shown of the demonstrations that were chosen, so the rules are made a tree again and counted there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.recoding import recoded
from sarl_core.errors import SarlError
from sarl_core.mining.budgeted_trees import leaf_rules
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import recount
from sarl_core.mining.rules import Condition, Rule
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.cache import cached
from sarl_dashboard.state import rule_base


@dataclass(frozen=True, eq=False)
class Compact:
    """A compact set of the chosen data.

    Attributes:
        shipped: The rules as they are in the file.
        trees: The same rules as trees, one an action dimension, counted on the demonstrations.
        counted: The rules with what was counted.
        demonstrations: Those they were counted on, with what these rules derive.
    """

    shipped: RuleSet
    trees: tuple[PolicyTree, ...]
    counted: RuleSet
    demonstrations: Demonstrations

    @cached_property
    def _in_file(self) -> dict[tuple[int, tuple[Condition, ...]], Rule]:
        return {(rule.dimension, rule.conditions): rule for rule in self.shipped.rules}

    def as_shipped(self, rule: Rule) -> Rule:
        """A counted rule as it is in the file."""
        return self._in_file[rule.dimension, rule.conditions]


def chosen_compact(demonstrations: Demonstrations) -> Compact | None:
    """The chosen rules as trees, if they are a compact set, shipped or kept.

    Args:
        demonstrations: N pairs to count.

    Returns:
        None where they are others, as where they are not the leaves of trees.
    """
    if rule_base.at_thresholds():
        return None
    try:
        fixed = rule_base.base()
        if fixed.rule_set.cut != "leaves":
            return None
        return _counted(fixed.rule_set, demonstrations)
    except SarlError:
        return None


@cached(show_spinner="Counting the compact rules …")
def _counted(shipped: RuleSet, demonstrations: Demonstrations) -> Compact:
    features = shipped.source.features
    demonstrations = recoded(demonstrations, features, called="the demonstrations")
    trees = recount(shipped, demonstrations)
    rules = leaf_rules(trees)
    compact = Compact(shipped, trees, rules, demonstrations)
    # The box is of the pairs that the rules were built from, whatever they are counted on.
    boxed = tuple(replace(rule, box=compact.as_shipped(rule).box) for rule in rules)
    return replace(compact, counted=replace(rules, rules=boxed))
