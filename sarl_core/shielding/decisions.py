"""Which rule decides each of many states, for a rule set and for every edit of it.

Mined rules of one action dimension never overlap, so where they lie is found once, by walking
their tree. An edit switches some of them off and puts others before them; what it changes follows
from that one walk and the few placed rules, without a tree being made again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.derived import Extension
from sarl_core.errors import InputError
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE, tree_of
from sarl_core.mining.rules import Rule, take_back_unanswered
from sarl_core.shielding.matching import Matcher


@dataclass(frozen=True, eq=False)
class Ground:
    """States, and the mined rule that each of them lies in.

    Attributes:
        rule_set: With n rules of m action dimensions.
        states: With what the rules derive, (B, d + k), float32.
        mined: Index of the rule that is not placed and applies, switched on or not, or -1, (B, m).
        in_trees: For each dimension whether its mined rules are of one tree; where they are not,
            they may overlap and are tried one by one.
    """

    rule_set: RuleSet
    states: NDArray[np.float32]
    mined: NDArray[np.int64]
    in_trees: tuple[bool, ...]


class Deciding(NamedTuple):
    """The rules that decide B states.

    Attributes:
        first: Index of the rule in force, or -1, (B, m).
        second: Index of the rule that would be in force without the first, or -1, (B, m).
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]


def ground_of(rule_set: RuleSet, states: NDArray[np.float32]) -> Ground:
    """Walk states once, for everything that is asked about a rule set and its edits.

    Args:
        rule_set: With n rules of m action dimensions.
        states: Shape (B, d) or, with what is derived, (B, d + k), float32.

    Returns:
        Where they lie.

    Raises:
        InputError: If the states have another number of features than the rules ask about.
    """
    states = np.ascontiguousarray(states, dtype=np.float32)
    extension = Extension.of(rule_set.source.features)
    widths = (extension.width, len(rule_set.source.features))
    if states.ndim != 2 or states.shape[1] not in widths:
        raise InputError(
            f"the rules ask about {extension.width} features and the states have "
            f"{states.shape[-1] if states.ndim else 0}; use states of the rules' environment"
        )
    states = extension.many(states)
    mined = np.full((len(states), len(rule_set.actions)), NO_RULE, dtype=np.int64)
    in_trees = []
    for dimension in range(len(rule_set.actions)):
        rules = [
            (index, rule)
            for index, rule in enumerate(rule_set.rules)
            if rule.dimension == dimension and not rule.placed
        ]
        nodes = tree_of(rules)
        in_trees.append(nodes is not None)
        if nodes is not None:
            mined[:, dimension] = Matcher([], nodes).match_batch(states)[0]
            take_back_unanswered(mined[:, dimension], states, rule_set.rules)
    return Ground(rule_set, states, mined, tuple(in_trees))


def deciding(ground: Ground, rule_set: RuleSet | None = None) -> Deciding:
    """The rule that decides each state, and the one behind it.

    Args:
        ground: Of a rule set and B states.
        rule_set: An edit of that rule set; itself where not given.

    Returns:
        Indices into the edited set's rules, exactly what `Shield` finds.
    """
    rule_set = ground.rule_set if rule_set is None else rule_set
    index_of = {rule.id: index for index, rule in enumerate(rule_set.rules)}
    target = np.full(len(ground.rule_set.rules) + 1, NO_RULE, dtype=np.int64)
    for place, rule in enumerate(ground.rule_set.rules):
        index = index_of.get(rule.id, NO_RULE)
        now = rule_set.rules[index] if index >= 0 else None
        if now is not None and now.enabled and not now.placed:
            target[place] = index
    first = np.full(ground.mined.shape, NO_RULE, dtype=np.int64)
    second = first.copy()
    for dimension in range(len(rule_set.actions)):
        columns = first[:, dimension], second[:, dimension]
        for index in _tried(ground, rule_set, dimension):
            rows = np.flatnonzero(rule_set.rules[index].applies(ground.states))
            _fill(*columns, rows, np.full(len(rows), index))
        if ground.in_trees[dimension]:
            mined = target[ground.mined[:, dimension]]  # -1 takes the last, which is no rule
            rows = np.flatnonzero(mined >= 0)
            _fill(*columns, rows, mined[rows])
    return Deciding(first, second)


def _fill(
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    rows: NDArray[np.int64],
    rules: NDArray[np.int64],
) -> None:
    """Enter rules that apply to some rows, behind those that were entered before."""
    free = first[rows] == NO_RULE
    behind = ~free & (second[rows] == NO_RULE)
    first[rows[free]] = rules[free]
    second[rows[behind]] = rules[behind]


def _tried(ground: Ground, rule_set: RuleSet, dimension: int) -> list[int]:
    """The rules that are tried one by one, in the order in which a shield tries them."""
    numbered = [
        (index, rule)
        for index, rule in enumerate(rule_set.rules)
        if rule.dimension == dimension and rule.enabled
    ]
    placed = [index for index, rule in numbered if rule.placed]
    if ground.in_trees[dimension]:
        return placed
    return placed + [index for index, rule in numbered if not rule.placed]


def labels_at(rule_set: RuleSet, rules: NDArray[np.int64]) -> NDArray[np.int64]:
    """What rules say.

    Args:
        rule_set: With n rules.
        rules: Indices, -1 for none, any shape.

    Returns:
        Labels, -1 for none, the same shape.
    """
    labels = np.array([rule.action for rule in rule_set.rules] + [NO_RULE], dtype=np.int64)
    return np.asarray(labels[rules])


def regions(ground: Ground) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Every rule with every state to which it applies, whether or not it decides there.

    Args:
        ground: Of a rule set and B states.

    Returns:
        Indices of rules, (pairs,), and of states, (pairs,).
    """
    rows, dimensions = np.nonzero(ground.mined >= 0)
    rules = [ground.mined[rows, dimensions]]
    states = [rows]
    for index, rule in enumerate(ground.rule_set.rules):
        if _outside_trees(ground, rule):
            rows = np.flatnonzero(rule.applies(ground.states))
            rules.append(np.full(len(rows), index))
            states.append(rows)
    return np.concatenate(rules), np.concatenate(states)


def _outside_trees(ground: Ground, rule: Rule) -> bool:
    return rule.placed or not ground.in_trees[rule.dimension]
