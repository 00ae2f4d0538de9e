"""What each rule did in shielded episodes, and in which of them it made a difference at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.rollouts.episodes import Episodes
from sarl_core.shielding.shield import Shield


@dataclass(frozen=True, eq=False)
class RuleUse:
    """What R rules did in E episodes; arrays are read-only.

    Attributes:
        matched: Steps at which each rule was in force, (R, E) int64.
        changed: Steps at which it changed the action, (R, E) int64.
        matters: Whether without it a different action would have been executed at some step of
            the episode, (R, E) bool.
    """

    matched: NDArray[np.int64]
    changed: NDArray[np.int64]
    matters: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        make_read_only(self)

    def part(self, start: int, stop: int) -> RuleUse:
        """Some of the episodes.

        Args:
            start: Index of the first one.
            stop: Index after the last one.

        Returns:
            What the rules did in them.
        """
        return RuleUse(*(getattr(self, column.name)[:, start:stop] for column in fields(self)))


def join_use(pieces: Sequence[RuleUse]) -> RuleUse:
    """Put what the same rules did in different episodes behind each other.

    Args:
        pieces: At least one.

    Returns:
        What they did in all.
    """
    return RuleUse(
        *(
            np.concatenate([getattr(piece, column.name) for piece in pieces], axis=1)
            for column in fields(RuleUse)
        )
    )


def rule_use(episodes: Episodes, shield: Shield) -> RuleUse:
    """What each rule of a shield did in the episodes that it shielded.

    An episode in which the shield would have executed the same actions without a rule is, step
    for step, the episode without that rule: the same states follow from the same actions. So
    where a rule does not matter, nothing has to be run to know what its removal would do.

    Args:
        episodes: E of them, with their steps.
        shield: That was in force.

    Returns:
        One row a rule, in the rule set's order.

    Raises:
        ValueError: If the steps were not kept.
    """
    steps = episodes.steps
    if steps is None:
        raise ValueError("the steps of the episodes were not kept")
    shape = (len(shield.rule_set.rules), len(episodes))
    matched, changed = np.zeros(shape, dtype=np.int64), np.zeros(shape, dtype=np.int64)
    for dimension in range(steps.rules.shape[1]):
        rules = steps.rules[:, dimension]
        in_force = rules >= 0
        differs = in_force & (steps.proposed[:, dimension] != steps.executed[:, dimension])
        for counts, rows in ((matched, in_force), (changed, differs)):
            cells = rules[rows] * shape[1] + steps.episode[rows]
            counts += np.bincount(cells, minlength=counts.size).reshape(shape)
    matters = changed > 0
    for index in shield.scanned:
        matters[index] = _decides_otherwise(episodes, shield, index)
    return RuleUse(matched, changed, matters)


def without_rule(shield: Shield, index: int) -> Shield:
    """A shield with one of its rules taken out.

    Args:
        shield: In force.
        index: Of the rule in its rule set.

    Returns:
        The other rules, with the same numbers.
    """
    rules = list(shield.rule_set.rules)
    rules[index] = replace(rules[index], enabled=False)
    rule_set = replace(shield.rule_set, rules=tuple(rules))
    return shield.with_rules(rule_set)


def _decides_otherwise(episodes: Episodes, shield: Shield, index: int) -> NDArray[np.bool_]:
    """In which episodes other actions would be executed without a rule, (E,) bool."""
    otherwise = np.zeros(len(episodes), dtype=np.bool_)
    steps = episodes.steps
    assert steps is not None
    rules = shield.rule_set.rules
    # A rule that forbids also has a say in what comes in the place of what another one forbids.
    forbids = np.array([bool(rules[index].forbids and rule.forbids) for rule in rules] + [False])
    in_force = steps.rules[:, rules[index].dimension]
    rows = np.flatnonzero((in_force == index) | forbids[in_force])
    if len(rows):
        others = without_rule(shield, index)
        decided = others.decide_batch(steps.observation[rows], steps.proposed[rows])
        other = decided.executed.reshape(len(rows), -1) != steps.executed[rows]
        otherwise[steps.episode[rows[other.any(axis=1)]]] = True
    return otherwise
