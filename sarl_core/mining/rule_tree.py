"""Putting rules that share the beginnings of their paths together again: a tree.

The rule that applies to a state is found by walking it, and a rule file without its
demonstrations can be counted on others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.recoding import recoded
from sarl_core.errors import InputError
from sarl_core.mining.growing.structure import TreeStructure, count_tree
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, node_of
from sarl_core.mining.tree import LEAF, PolicyTree

NO_RULE = -1

Numbered = tuple[int, Rule]


class RuleNode(NamedTuple):
    """A node of the tree of some rules.

    Attributes:
        feature: Queried there, `LEAF` where a path ends.
        threshold: To the left where the feature is at most this.
        left: Place of the left child.
        right: Place of the right child.
        rule: Index of the rule that ends here, `NO_RULE` where none does.
    """

    feature: int
    threshold: float
    left: int
    right: int
    rule: int


NOTHING = RuleNode(LEAF, 0.0, LEAF, LEAF, NO_RULE)


def tree_of(rules: Sequence[Numbered]) -> list[RuleNode] | None:
    """The tree that rules of one action dimension were cut from.

    Args:
        rules: Each with its index in the rule set.

    Returns:
        The nodes, root first, children behind their parents; None if the rules are not those of
        one tree.
    """
    nodes = [NOTHING]
    # A stack and no recursion, because a tree may be deeper than Python's calls may go.
    waiting = [(0, 0, list(rules))]
    while waiting:
        place, depth, group = waiting.pop()
        if not group:
            continue
        first = group[0][1].conditions
        if len(first) == depth:
            if len(group) > 1:
                return None
            nodes[place] = NOTHING._replace(rule=group[0][0])
            continue
        feature, _, threshold = first[depth]
        below: list[Numbered] = []
        above: list[Numbered] = []
        for entry in group:
            conditions = entry[1].conditions
            if len(conditions) == depth:
                return None
            own_feature, op, at = conditions[depth]
            if own_feature != feature or at != threshold:
                return None
            (below if op == "<=" else above).append(entry)
        left, right = len(nodes), len(nodes) + 1
        nodes[place] = RuleNode(feature, threshold, left, right, NO_RULE)
        nodes += [NOTHING, NOTHING]
        waiting += [(left, depth + 1, below), (right, depth + 1, above)]
    return nodes


def recount(rule_set: RuleSet, demonstrations: Demonstrations) -> tuple[PolicyTree, ...]:
    """Count other demonstrations at the nodes of a rule set that covers every state.

    Args:
        rule_set: Its `cut` is "leaves".
        demonstrations: N pairs of the same features and actions.

    Returns:
        One tree an action dimension, whose leaves are the rules, under the rules' numbers.

    Raises:
        InputError: If the rules are not the leaves of trees, or are for other features or
            actions.
    """
    demonstrations = recoded(demonstrations, rule_set.source.features, called="the demonstrations")
    rule_set = rules_for(rule_set, demonstrations).rule_set
    return tuple(
        count_tree(
            _structure(rule_set, dimension), demonstrations, dimension, divider=rule_set.divider
        )
        for dimension in range(len(rule_set.actions))
    )


def _structure(rule_set: RuleSet, dimension: int) -> TreeStructure:
    rules = [entry for entry in enumerate(rule_set.rules) if entry[1].dimension == dimension]
    nodes = tree_of(rules)
    if nodes is None or any(node.feature == LEAF and node.rule == NO_RULE for node in nodes):
        raise InputError(
            f"the rules of {rule_set.actions[dimension].name!r} are not all leaves of one tree; "
            "give a rule set that covers every state"
        )
    numbers = _numbers(rule_set, nodes)
    n = len(nodes)
    feature = np.full(n, LEAF, dtype=np.int64)
    threshold = np.zeros(n)
    left, right = np.full((2, n), LEAF, dtype=np.int64)
    label = np.full(n, -1, dtype=np.int64)
    for node, number in zip(nodes, numbers, strict=True):
        if node.feature == LEAF:
            label[number] = rule_set.rules[node.rule].action
        else:
            feature[number], threshold[number] = node.feature, node.threshold
            left[number], right[number] = numbers[node.left], numbers[node.right]
    return TreeStructure(feature, threshold, left, right, label)


def _numbers(rule_set: RuleSet, nodes: list[RuleNode]) -> list[int]:
    """Node numbers under which a rule's name says its node; the others fill the gaps."""
    try:
        ends = {
            place: node_of(rule_set.rules[node.rule])
            for place, node in enumerate(nodes)
            if node.feature == LEAF
        }
    except (IndexError, ValueError):  # somebody gave the rules names of their own
        return list(range(len(nodes)))
    known = set(ends.values())
    if len(nodes) > 1 and len(known) == len(ends) and known <= set(range(1, len(nodes))):
        free = iter(number for number in range(len(nodes)) if number not in known)
        return [ends[place] if place in ends else next(free) for place in range(len(nodes))]
    return list(range(len(nodes)))
