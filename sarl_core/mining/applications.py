"""Which rules apply to which pairs, for whole rule sets at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import extend
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE, Numbered, RuleNode, tree_of
from sarl_core.mining.rules import take_back_unanswered
from sarl_core.mining.tree import walk


@dataclass(frozen=True, eq=False)
class Applications:
    """Every rule with every state to which it applies, K in all, by rule and row.

    Attributes:
        rule: Places in the rule set, (K,), ascending.
        row: Rows of the states, (K,), ascending within a rule.
    """

    rule: NDArray[np.int64]
    row: NDArray[np.int64]


def applications(rule_set: RuleSet, observations: NDArray[np.float32]) -> Applications:
    """Find the states of every rule, whether or not another rule would come first.

    Mined rules of one action dimension never overlap, so one walk down their tree finds the rule
    of every state; rules that a person placed are tried one by one.

    Args:
        rule_set: R rules.
        observations: Shape (B, d) or, with what is derived, (B, d + k), float32.

    Returns:
        At most one entry a state and action dimension, and those of placed rules.
    """
    observations = extend(observations, rule_set.source.features)
    parts: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []
    for dimension in range(len(rule_set.actions)):
        numbered = [entry for entry in enumerate(rule_set.rules) if entry[1].dimension == dimension]
        mined = [entry for entry in numbered if not entry[1].placed]
        nodes = tree_of(mined)
        alone = [entry for entry in numbered if entry[1].placed] if nodes is not None else numbered
        if nodes is not None:
            rule = _rule_of_each(nodes, observations)
            take_back_unanswered(rule, observations, rule_set.rules)
            rows = np.flatnonzero(rule != NO_RULE)
            parts.append((rule[rows], rows))
        parts += [_states_of(entry, observations) for entry in alone]
    rule = np.concatenate([entry[0] for entry in parts])
    row = np.concatenate([entry[1] for entry in parts])
    order = np.lexsort((row, rule))
    return Applications(rule[order], row[order])


def labels_of(rule_set: RuleSet, demonstrations: Demonstrations) -> NDArray[np.int64]:
    """What the expert did, as labels of a rule set.

    Args:
        rule_set: In the order of the same features and action dimensions.
        demonstrations: N pairs.

    Returns:
        Shape (N, m), one column an action dimension.
    """
    return np.stack(
        [
            dimension.labels_of(demonstrations.action_columns[:, index])
            for index, dimension in enumerate(rule_set.actions)
        ],
        axis=1,
    )


def _rule_of_each(nodes: list[RuleNode], observations: NDArray[np.float32]) -> NDArray[np.int64]:
    feature, threshold, left, right, rule = (
        np.array(column) for column in zip(*nodes, strict=True)
    )
    ends = walk(observations, feature, threshold.astype(np.float64), left, right)
    return np.asarray(rule[ends], dtype=np.int64)


def _states_of(
    entry: Numbered, observations: NDArray[np.float32]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    place, rule = entry
    rows = np.flatnonzero(rule.applies(observations))
    return np.full(len(rows), place, dtype=np.int64), rows
