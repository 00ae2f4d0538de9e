"""What edits change at once: coverage, fidelity, decisions, and the rules that are overruled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.decisions import Ground, deciding, labels_at


class Conflict(NamedTuple):
    """A placed rule that takes states from another rule, which says something else.

    Attributes:
        rule: Index of the placed rule.
        other: Index of the rule that would decide without it.
        states: How many states.
        example: Row of the first of them.
        right: On how many the expert did as the placed rule says; None without an expert.
        other_right: On how many it did as the other one says.
    """

    rule: int
    other: int
    states: int
    example: int
    right: int | None
    other_right: int | None


@dataclass(frozen=True, eq=False)
class Verdicts:
    """What a rule set says of B states in m action dimensions.

    Attributes:
        rule_set: With n rules.
        labels: What it says, -1 where no rule applies, (B, m).
        decided: Number of states that each rule decides, (n,).
        right: On how many of them the expert did as it says, (n,); None without an expert.
        conflicts: Placed rules that overrule others, the most states first.
    """

    rule_set: RuleSet
    labels: NDArray[np.int64]
    decided: NDArray[np.int64]
    right: NDArray[np.int64] | None
    conflicts: tuple[Conflict, ...]

    @property
    def coverage(self) -> float:
        """Share of states in which some rule applies, averaged over action dimensions."""
        return float((self.labels >= 0).mean()) if self.labels.size else float("nan")

    @property
    def fidelity(self) -> float:
        """Share of the covered states in which the expert did as the rules say; NaN if unknown."""
        covered = int(self.decided.sum())
        if self.right is None or not covered:
            return float("nan")
        return int(self.right.sum()) / covered


def verdicts(
    ground: Ground, rule_set: RuleSet, expert: NDArray[np.int64] | None = None
) -> Verdicts:
    """What an edited rule set says of states.

    Args:
        ground: B states, walked with the set that was edited.
        rule_set: The edited set, or that set itself.
        expert: Labels of the expert's actions, (B, m), where known.

    Returns:
        Labels, counts and conflicts.
    """
    first, second = deciding(ground, rule_set)
    labels, behind = labels_at(rule_set, first), labels_at(rule_set, second)
    n = len(rule_set.rules)
    right = None
    if expert is not None:
        right = _counts(first[(first >= 0) & (labels == expert)], n)
    return Verdicts(
        rule_set,
        labels,
        _counts(first[first >= 0], n),
        right,
        _conflicts(rule_set, first, second, labels, behind, expert),
    )


def _counts(rules: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    return np.bincount(rules, minlength=n).astype(np.int64)


def _conflicts(
    rule_set: RuleSet,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    labels: NDArray[np.int64],
    behind: NDArray[np.int64],
    expert: NDArray[np.int64] | None,
) -> tuple[Conflict, ...]:
    placed = np.array([rule.placed for rule in rule_set.rules] + [False])
    rows, dimensions = np.nonzero(placed[first] & (second >= 0) & (labels != behind))
    pairs = np.stack([first[rows, dimensions], second[rows, dimensions]], axis=1)
    unique, examples, inverse, counts = np.unique(
        pairs, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    right = other_right = None
    if expert is not None:
        did = expert[rows, dimensions]
        inverse = inverse.reshape(-1)
        right = _counts(inverse[labels[rows, dimensions] == did], len(unique)).tolist()
        other_right = _counts(inverse[behind[rows, dimensions] == did], len(unique)).tolist()
    conflicts = [
        Conflict(
            rule,
            other,
            int(counts[at]),
            int(rows[examples[at]]),
            None if right is None else right[at],
            None if other_right is None else other_right[at],
        )
        for at, (rule, other) in enumerate(unique.tolist())
    ]
    return tuple(sorted(conflicts, key=lambda conflict: -conflict.states))


class EditEffect(NamedTuple):
    """What differs between two verdicts on the same B states.

    Attributes:
        states: B.
        different: In how many some action dimension is decided differently.
        by_dimension: In how many each one is, (m,).
        newly_covered: In how many some dimension has a rule that had none.
        newly_uncovered: In how many some dimension has none that had one.
    """

    states: int
    different: int
    by_dimension: tuple[int, ...]
    newly_covered: int
    newly_uncovered: int


def change(before: Verdicts, after: Verdicts) -> EditEffect:
    """Compare two verdicts on the same states.

    Args:
        before: Of one rule set.
        after: Of another, with the same labels.

    Returns:
        Counts of states.
    """
    differs = before.labels != after.labels
    return EditEffect(
        len(differs),
        int(differs.any(axis=1).sum()),
        tuple(differs.sum(axis=0).tolist()),
        int(((before.labels < 0) & (after.labels >= 0)).any(axis=1).sum()),
        int(((before.labels >= 0) & (after.labels < 0)).any(axis=1).sum()),
    )
