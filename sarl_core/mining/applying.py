"""Which rules apply to which pairs, for whole rule sets at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.rule_tree import NO_RULE, Numbered, RuleNode, tree_of
from sarl_core.mining.rules import RuleSet
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
        observations: Shape (B, d), float32.

    Returns:
        At most one entry a state and action dimension, and those of placed rules.
    """
    found: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = []
    for dimension in range(len(rule_set.actions)):
        numbered = [entry for entry in enumerate(rule_set.rules) if entry[1].dimension == dimension]
        mined = [entry for entry in numbered if not entry[1].placed]
        nodes = tree_of(mined)
        alone = [entry for entry in numbered if entry[1].placed] if nodes is not None else numbered
        if nodes is not None:
            rule = _rule_of_each(nodes, observations)
            rows = np.flatnonzero(rule != NO_RULE)
            found.append((rule[rows], rows))
        found += [_states_of(entry, observations) for entry in alone]
    rule = np.concatenate([entry[0] for entry in found])
    row = np.concatenate([entry[1] for entry in found])
    order = np.lexsort((row, rule))
    return Applications(rule[order], row[order])


def labels_of(rule_set: RuleSet, demonstrations: Demonstrations) -> NDArray[np.int64]:
    """What the expert did, as labels of a rule set.

    Args:
        rule_set: Of the same features and action dimensions.
        demonstrations: N pairs.

    Returns:
        Shape (N, m), one column an action dimension.

    Raises:
        InputError: If the rules are for other features or actions.
    """
    require_same_kind(rule_set, demonstrations)
    return np.stack(
        [
            dimension.labels_of(demonstrations.action_columns[:, index])
            for index, dimension in enumerate(rule_set.actions)
        ],
        axis=1,
    )


def require_same_kind(rule_set: RuleSet, demonstrations: Demonstrations) -> None:
    """Refuse demonstrations that rules cannot be asked about.

    Args:
        rule_set: The rules.
        demonstrations: Of whatever environment.

    Raises:
        InputError: If features or actions are others.
    """
    expected, given = len(rule_set.source.features), demonstrations.observations.shape[1]
    if expected != given:
        raise InputError(
            f"the rules ask about {expected} features and the demonstrations have {given}; "
            "choose demonstrations of the rules' environment"
        )
    dimensions = demonstrations.action_dimensions
    if len(rule_set.actions) != len(dimensions):
        raise InputError(
            f"the rules are for {len(rule_set.actions)} action dimensions and the demonstrations "
            f"have {len(dimensions)}; choose demonstrations of the rules' environment"
        )
    for action, dimension in zip(rule_set.actions, dimensions, strict=True):
        if action.is_interval != (dimension.kind == "interval"):
            raise InputError(
                f"the action {action.name!r} is {_kind(action.is_interval)} in the rules and "
                f"{_kind(dimension.kind == 'interval')} in the demonstrations; choose "
                "demonstrations of the rules' environment"
            )


def _kind(continuous: bool) -> str:
    return "continuous" if continuous else "discrete"


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
