"""Rules as columns of a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sarl_core.mining.action_words import says_text
from sarl_core.mining.algorithm_1 import cut_nodes, rules_at
from sarl_core.mining.language import conditions_text
from sarl_core.mining.never.never_rules import mine_at
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds, name_at
from sarl_core.mining.tree import PolicyTree, source_of


class TopRules(NamedTuple):
    """Some rules of a set that was not made as a whole.

    Attributes:
        part: With these rules alone.
        names: What each is called in the whole set.
    """

    part: RuleSet
    names: tuple[str, ...]


def top_rules(trees: Sequence[PolicyTree], thresholds: Thresholds, most: int) -> TopRules:
    """The rules with the most support, without making the rest.

    Args:
        trees: One an action dimension.
        thresholds: In force.
        most: Number of rules to keep of each action dimension.

    Returns:
        A part of what `mine_rules` gives, the most support first; of `mine_never_rules` where
        there is an epsilon.
    """
    if thresholds.never is not None:
        return _top_never_rules(trees, thresholds, most)
    top: list[tuple[Rule, str]] = []
    before = 0
    for tree in trees:
        nodes = cut_nodes(
            tree,
            supp_min=thresholds.support,
            conf_min=thresholds.confidence,
            lift_min=thresholds.lift,
            max_depth=thresholds.max_depth,
        )
        first = np.argsort(-tree.samples[nodes], kind="stable")[:most]
        names = [name_at(before + place) for place in first.tolist()]
        top += zip(rules_at(tree, nodes[first]), names, strict=True)
        before += len(nodes)
    top.sort(key=lambda one: -one[0].samples)
    part = RuleSet(
        rules=tuple(rule for rule, _ in top),
        actions=tuple(tree.dimension for tree in trees),
        source=source_of(trees),
        thresholds=thresholds,
        divider=trees[0].divider,
    )
    return TopRules(part, tuple(name for _, name in top))


def _top_never_rules(trees: Sequence[PolicyTree], at: Thresholds, most: int) -> TopRules:
    """The same where rules forbid, of which there are few enough to make them all."""
    every = mine_at(trees, at)
    top: list[Rule] = []
    for dimension in range(len(trees)):
        top += sorted(every.of_dimension(dimension), key=lambda rule: -rule.samples)[:most]
    top.sort(key=lambda rule: -rule.samples)
    return TopRules(replace(every, rules=tuple(top)), tuple(map(every.name_of, top)))


def rule_columns(rules: Sequence[Rule], rule_set: RuleSet) -> dict[str, list[object]]:
    """Rules as columns, for a table that people read.

    Args:
        rules: Some rules of the set.
        rule_set: Knows the names.

    Returns:
        Column name to one value a rule. Shares are in percent; what follows from the states of a
        rule that has none is NaN.
    """

    def mined_value(rule: Rule, value: float) -> float:
        return value if rule.samples else math.nan

    return {
        "Action": [says_text(rule, rule_set.actions[rule.dimension]) for rule in rules],
        "When": [conditions_text(rule, rule_set) for rule in rules],
        "Support": [100 * rule.support for rule in rules],
        "Confidence": [mined_value(rule, 100 * rule.confidence) for rule in rules],
        "Lift": [mined_value(rule, rule.lift) for rule in rules],
        "Joint support": [100 * rule.joint_support for rule in rules],
        "States": [rule.samples for rule in rules],
        "Length": [rule.length for rule in rules],
    }
