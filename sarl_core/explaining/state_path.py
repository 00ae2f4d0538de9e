"""The way of one state through the rules: which queries it was asked, and how near it came."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.derived import Extension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE, RuleNode, tree_of
from sarl_core.mining.rules import Condition


class StateQuery(NamedTuple):
    """One query, as a state answered it.

    Attributes:
        condition: What holds for the state.
        value: Of the feature.
        distance: To the threshold.
    """

    condition: Condition
    value: float
    distance: float


class StatePath(NamedTuple):
    """The way of a state.

    Attributes:
        queries: From the root to where it ends.
        rule: Index of the rule it ends at, None where no rule applies.
    """

    queries: tuple[StateQuery, ...]
    rule: int | None


class PathFinder:
    """The rules of a set, arranged for following a state through them."""

    def __init__(self, rule_set: RuleSet) -> None:
        """Put the rules of each action dimension together to a tree.

        Args:
            rule_set: The rules; those that are switched off are left out.
        """
        self.rule_set = rule_set
        self._extension = Extension.of(rule_set.source.features)
        self._trees: list[list[RuleNode] | None] = [
            tree_of(
                [
                    (index, rule)
                    for index, rule in enumerate(rule_set.rules)
                    if rule.dimension == dimension and rule.enabled and not rule.placed
                ]
            )
            for dimension in range(len(rule_set.actions))
        ]

    def path(self, dimension: int, state: NDArray[np.float32], rule: int) -> StatePath:
        """The way of a state.

        Args:
            dimension: Index of the action dimension.
            state: Shape (d,), or with what the rules derive (d + k,).
            rule: Index of the rule in force there, -1 for none, as it was recorded.

        Returns:
            The queries it was asked. A rule that a person placed is not in the tree: its own
            conditions are the way to it.
        """
        state = self._extension.many(state[None])[0]
        nodes = self._trees[dimension]
        if rule >= 0 and (nodes is None or self.rule_set.rules[rule].placed):
            conditions = self.rule_set.rules[rule].conditions
            return StatePath(tuple(_query(one, state) for one in conditions), rule)
        queries: list[StateQuery] = []
        node = nodes[0] if nodes else None
        while nodes and node is not None and node.feature >= 0:
            below = bool(state[node.feature] <= np.float64(node.threshold))
            condition = Condition(node.feature, "<=" if below else ">", node.threshold)
            queries.append(_query(condition, state))
            node = nodes[node.left if below else node.right]
        ends = node.rule if node is not None else NO_RULE
        if any(math.isnan(query.value) for query in queries):  # a formula has no value there
            ends = NO_RULE
        return StatePath(tuple(queries), ends if ends != NO_RULE else None)


def _query(condition: Condition, state: NDArray[np.float32]) -> StateQuery:
    value = float(state[condition.feature])
    return StateQuery(condition, value, abs(value - condition.threshold))
