"""Finding the rule that applies to a state.

Rules mined from one tree share the beginnings of their paths; put together again they are a
tree, and the rule that applies is found by walking it. Rules that a person wrote or pinned may
overlap others: they are tried one by one, in their order, before the tree is walked.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.rule_tree import NO_RULE, NOTHING, Numbered, RuleNode, tree_of

# States walked together: few enough for the processor's cache, enough to be worth a call.
_BLOCK = 32_768
# States that are sooner walked one by one than made ready to be walked together.
_FEW = 24
# Levels they walk before those that have reached a leaf are taken out.
_LEVELS = 4

_Borders = tuple[tuple[int, float], ...]  # features and thresholds


class Matcher:
    """The rules of one action dimension, arranged for finding the one that applies."""

    def __init__(self, scanned: Sequence[Numbered], nodes: Sequence[RuleNode]) -> None:
        """Lay out the tree, for single states and for many.

        Args:
            scanned: Rules to try one by one, first.
            nodes: The tree of the others, root first, children behind their parents.
        """
        self._scanned, self._nodes = list(scanned), list(nodes)
        self._root = _nested(nodes)
        # For many states arrays. A leaf leads to itself, and asks what changes no margin.
        self._rule = np.array([node.rule for node in nodes], dtype=np.int64)
        self._ends = np.array([node.feature < 0 for node in nodes])
        self._feature = np.array([max(node.feature, 0) for node in nodes], dtype=np.int64)
        self._threshold = np.array(
            [np.inf if node.feature < 0 else node.threshold for node in nodes], dtype=np.float64
        )
        self._children = np.array(
            [
                (place, place) if node.feature < 0 else (node.left, node.right)
                for place, node in enumerate(nodes)
            ],
            dtype=np.int64,
        ).reshape(-1)

    @classmethod
    def of(cls, rules: Sequence[Numbered]) -> Matcher:
        """Arrange rules.

        Args:
            rules: Each with its index in the rule set, all of one action dimension.

        Returns:
            A matcher that finds, for every state, what a scan in order would find.
        """
        placed = [entry for entry in rules if entry[1].placed]
        others = [entry for entry in rules if not entry[1].placed]
        nodes = tree_of(others)
        if nodes is not None:
            return cls(placed, nodes)
        # A file whose mined rules are not of one tree: what its order says, holds.
        return cls([*placed, *others], [NOTHING])

    def __reduce__(self) -> tuple[Any, ...]:
        # What is nested as deep as the tree could not be pickled.
        return Matcher, (self._scanned, self._nodes)

    @property
    def scanned(self) -> tuple[int, ...]:
        """Indices of the rules that are tried one by one, in their order.

        Where one of them is taken out, another may apply; where a rule of the tree is, none does.
        """
        return tuple(index for index, _ in self._scanned)

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
                if not (gap <= 0 if op == "<=" else gap > 0):  # NaN is on neither side
                    break
            else:
                return index, margin + 0.0
        feature, threshold, left, right = self._root
        while feature >= 0:
            feature, threshold, left, right = left if state[feature] <= threshold else right
        if not threshold:
            # Replaced at once, for who asks at the same time.
            threshold[:] = self._borders(state)
        upper, lower = threshold
        for feature, border in upper:
            distance = border - state[feature]
            if distance < margin:
                margin = distance
        for feature, border in lower:
            distance = state[feature] - border
            if distance < margin:
                margin = distance
        # Plus 0, so that what lies on a threshold is 0 away from it and not -0.
        return left, margin + 0.0

    def _borders(self, state: list[float]) -> tuple[_Borders, _Borders]:
        """The nearest thresholds above and below all states that are led where this one is.

        Of the thresholds of one feature on a path the nearest is the same for all of them.
        """
        upper: dict[int, float] = {}
        lower: dict[int, float] = {}
        feature, threshold, left, right = self._root
        while feature >= 0:
            node = left if state[feature] <= threshold else right
            known = upper if node is left else lower
            if feature not in known or (threshold < known[feature]) == (node is left):
                known[feature] = threshold
            feature, threshold, left, right = node
        return tuple(upper.items()), tuple(lower.items())

    def match_batch(
        self, states: NDArray[np.float32]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The rule that applies to each state, as `match`.

        Args:
            states: Shape (B, d), contiguous.

        Returns:
            Index in the rule set or -1, (B,), and the distances, (B,).
        """
        rules = np.full(len(states), NO_RULE, dtype=np.int64)
        margins = np.full(len(states), np.inf)
        if len(states) <= _FEW:
            for row, state in enumerate(states.tolist()):
                rule, margins[row] = self.match(state)
                rules[row] = NO_RULE if rule is None else rule
            return rules, margins
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
                margins[holding] = np.fmin(margins[holding], np.abs(gap))
                holding = holding[gap <= 0 if op == "<=" else gap > 0]
            rules[holding] = index
            left = left[rules[left] == NO_RULE]
        return left

    def _walk(
        self,
        states: NDArray[np.float32],
        rows: NDArray[np.int64],
        rules: NDArray[np.int64],
        margins: NDArray[np.float64],
    ) -> None:
        """Walk the tree from its root with some rows; fill in where they end."""
        flat, first = states.ravel(), rows * states.shape[1]
        nodes = np.zeros(len(rows), dtype=np.int64)
        near = margins[rows]
        while len(rows):
            for _ in range(_LEVELS):
                value = flat.take(first + self._feature.take(nodes))
                gap = value - self._threshold.take(nodes)
                np.fmin(near, np.abs(gap), out=near)
                nodes = self._children.take(2 * nodes + ~(gap <= 0))
            ended = self._ends.take(nodes)
            done, going = np.flatnonzero(ended), np.flatnonzero(~ended)
            rules[rows.take(done)] = self._rule.take(nodes.take(done))
            margins[rows.take(done)] = near.take(done)
            rows, first = rows.take(going), first.take(going)
            nodes, near = nodes.take(going), near.take(going)


def _nested(nodes: Sequence[RuleNode]) -> Any:
    """A tree for single states: tuples in tuples, the fastest there is in plain Python.

    Returns:
        The root, as (feature, threshold, left, right). In a leaf a list, empty until they are
        asked for, holds its borders in the place of the threshold, and the left child is its rule.
    """
    made: list[Any] = [None] * len(nodes)
    for place in reversed(range(len(nodes))):
        node = nodes[place]
        if node.feature < 0:
            made[place] = (node.feature, [], None if node.rule < 0 else node.rule, None)
        else:
            made[place] = (node.feature, node.threshold, made[node.left], made[node.right])
    return made[0]
