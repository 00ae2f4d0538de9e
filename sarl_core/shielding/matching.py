"""Finding the rule that applies to a state.

Rules mined from one tree share the beginnings of their paths; put together again they are a
tree, and the rule that applies is found by walking it. Rules that a person wrote may overlap
others: they are tried one by one, in their order, before the tree is walked.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.rules import Rule

_NO_RULE = -1
# States walked together: few enough for the processor's cache, enough to be worth a call.
_BLOCK = 8192

Numbered = tuple[int, Rule]


class _Node(NamedTuple):
    feature: int
    threshold: float
    left: int
    right: int
    rule: int


_NOTHING = _Node(-1, 0.0, -1, -1, _NO_RULE)


class Matcher:
    """The rules of one action dimension, arranged for finding the one that applies."""

    def __init__(self, scanned: Sequence[Numbered], nodes: Sequence[_Node]) -> None:
        """Lay out the arrays.

        Args:
            scanned: Rules to try one by one, first.
            nodes: The tree of the others, root first.
        """
        self._scanned = list(scanned)
        # One flat list for single states: nothing is faster in plain Python.
        self._nodes = list(nodes)
        self._feature = np.array([node.feature for node in nodes], dtype=np.int64)
        self._threshold = np.array([node.threshold for node in nodes], dtype=np.float64)
        self._children = np.array(
            [(node.left, node.right) for node in nodes], dtype=np.int64
        ).reshape(-1)
        self._rule = np.array([node.rule for node in nodes], dtype=np.int64)

    @classmethod
    def of(cls, rules: Sequence[Numbered]) -> Matcher:
        """Arrange rules.

        Args:
            rules: Each with its index in the rule set, all of one action dimension.

        Returns:
            A matcher that finds, for every state, what a scan in order would find.
        """
        manual = [entry for entry in rules if entry[1].origin == "manual"]
        mined = [entry for entry in rules if entry[1].origin == "mined"]
        nodes = _tree_of(mined)
        if nodes is not None:
            return cls(manual, nodes)
        # A file whose mined rules are not of one tree: what its order says, holds.
        return cls([*manual, *mined], [_NOTHING])

    def match(self, state: list[float]) -> tuple[int | None, float]:
        """The rule that applies to one state.

        Args:
            state: d values that are float32 numbers.

        Returns:
            Its index in the rule set or None, and the distance to the nearest threshold asked.
        """
        margin = float("inf")
        for index, rule in self._scanned:
            for feature, op, threshold in rule.conditions:
                gap = state[feature] - threshold
                distance = -gap if gap < 0 else gap
                if distance < margin:
                    margin = distance
                if (gap <= 0) != (op == "<="):
                    break
            else:
                return index, margin
        nodes = self._nodes
        feature, threshold, left, right, found = nodes[0]
        while feature >= 0:
            gap = state[feature] - threshold
            if gap <= 0:
                if -gap < margin:
                    margin = -gap
                feature, threshold, left, right, found = nodes[left]
            else:
                if gap < margin:
                    margin = gap
                feature, threshold, left, right, found = nodes[right]
        return (found if found >= 0 else None), margin

    def match_batch(
        self, states: NDArray[np.float32]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The rule that applies to each state, as `match`.

        Args:
            states: Shape (B, d), contiguous.

        Returns:
            Index in the rule set or -1, (B,), and the distances, (B,).
        """
        rules = np.full(len(states), _NO_RULE, dtype=np.int64)
        margins = np.full(len(states), np.inf)
        for start in range(0, len(states), _BLOCK):
            block = slice(start, start + _BLOCK)
            rows = self._scan(states[block], rules[block], margins[block])
            self._walk(states[block], rows, rules[block], margins[block])
        return rules, margins

    def _scan(
        self, states: NDArray[np.float32], rules: NDArray[np.int64], margins: NDArray[np.float64]
    ) -> NDArray[np.int64]:
        """Try the scanned rules; fill in what is found and give the rows that are left."""
        left = np.arange(len(states))
        for index, rule in self._scanned:
            holding = left
            for feature, op, threshold in rule.conditions:
                gap = states[holding, feature] - np.float64(threshold)
                margins[holding] = np.minimum(margins[holding], np.abs(gap))
                holding = holding[(gap <= 0) == (op == "<=")]
            rules[holding] = index
            left = left[rules[left] == _NO_RULE]
        return left

    def _walk(
        self, states: NDArray[np.float32], rows: NDArray[np.int64], rules: NDArray[np.int64],
        margins: NDArray[np.float64],
    ) -> None:
        """Walk the tree from its root with some rows; fill in where they end."""
        flat, width = states.ravel(), states.shape[1]
        nodes = np.zeros(len(rows), dtype=np.int64)
        near = margins[rows]
        while len(rows):
            feature = self._feature[nodes]
            ended = feature < 0
            if ended.any():
                rules[rows[ended]] = self._rule[nodes[ended]]
                margins[rows[ended]] = near[ended]
                going = ~ended
                rows, nodes, near = rows[going], nodes[going], near[going]
                feature = feature[going]
            gap = flat[rows * width + feature] - self._threshold[nodes]
            near = np.minimum(near, np.abs(gap))
            nodes = self._children[2 * nodes + (gap > 0)]


def _tree_of(rules: Sequence[Numbered]) -> list[_Node] | None:
    """Put rules that share the beginnings of their paths together again.

    Args:
        rules: Each with its index in the rule set.

    Returns:
        The nodes, root first; None if the rules are not those of one tree.
    """
    nodes = [_NOTHING]
    # A stack and no recursion, because a tree may be deeper than Python's calls may go.
    waiting = [(0, 0, list(rules))]
    while waiting:
        place, depth, group = waiting.pop()
        if not group:
            continue
        if any(rule.length == depth for _, rule in group):
            if len(group) > 1:
                return None
            nodes[place] = _NOTHING._replace(rule=group[0][0])
            continue
        feature, _, threshold = group[0][1].conditions[depth]
        sides: dict[str, list[Numbered]] = {"<=": [], ">": []}
        for entry in group:
            condition = entry[1].conditions[depth]
            if (condition.feature, condition.threshold) != (feature, threshold):
                return None
            sides[condition.op].append(entry)
        left, right = len(nodes), len(nodes) + 1
        nodes[place] = _Node(feature, threshold, left, right, _NO_RULE)
        nodes += [_NOTHING, _NOTHING]
        waiting += [(left, depth + 1, sides["<="]), (right, depth + 1, sides[">"])]
    return nodes
