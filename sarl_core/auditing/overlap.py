"""Where rules that forbid apply: they overlap, so a step has more of them than the recorded one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.forbidding import never_rules


def demanded(rule_set: RuleSet, in_force: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Where a rule that demands an action is in force.

    Args:
        rule_set: R rules.
        in_force: Index of the rule, -1 for none, (N, m).

    Returns:
        Shape (N, m).
    """
    demands = np.array([not rule.forbids for rule in rule_set] + [False])
    return np.asarray(demands[in_force])


def never_applications(
    rule_set: RuleSet, observations: NDArray[np.float32], in_force: NDArray[np.int64]
) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """The steps of each never-rule, beside whatever others.

    Args:
        rule_set: R rules over d features.
        observations: As the rules see them, (N, d).
        in_force: Index of the rule, -1 for none, (N, m).

    Yields:
        Of each that is switched on its place in the set, and the rows to which it applies and in
        which no rule demands an action of its dimension, ascending.
    """
    if not rule_set.forbids:
        return
    first = demanded(rule_set, in_force)
    for dimension, entries in enumerate(never_rules(rule_set)):
        if not entries:
            continue
        rows = np.flatnonzero(~first[:, dimension])
        states = np.asfortranarray(observations[rows])
        for place, rule in entries:
            yield place, rows[rule.applies(states)]


def comparable(rule_set: RuleSet) -> NDArray[np.bool_]:
    """Which rules keep of their demonstrations what the steps of a log can be compared with.

    Args:
        rule_set: R rules.

    Returns:
        Shape (R,).
    """
    demanding = {rule.dimension for rule in rule_set if rule.enabled and not rule.forbids}
    return np.array(
        [
            # Of a never-rule support and data are those of all states to which it applies, and
            # rules that demand an action take some of these away, nobody knows which. Those of a
            # probed one are of the states that were probed, and not of whole episodes.
            not rule.forbids or (rule.dimension not in demanding and rule.origin != "probed")
            for rule in rule_set
        ],
        dtype=np.bool_,
    )
