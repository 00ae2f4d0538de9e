"""What edits change at once: coverage, fidelity, decisions, and the rules that are overruled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.derived import Extension
from sarl_core.mining.applications import applications
from sarl_core.mining.rule_set import RuleSet, obeying_labels
from sarl_core.mining.rule_tree import NO_RULE
from sarl_core.shielding.decisions import Ground, deciding, labels_at
from sarl_core.shielding.leeway import labels_left_of_each, left_codes
from sarl_core.shielding.shield import Shield


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
        labels: What it says, -1 where no rule applies, (B, m). Rules that forbid say the label
            that alone is left, or where several are a number past the last label, the same for the
            same ones.
        decided: Number of states that each rule decides, (n,); of one that forbids, in which it
            has a say.
        right: On how many of them the expert did as it says, (n,); None without an expert.
        conflicts: Placed rules that overrule others, the most states first; none among rules that
            forbid, which add up.
        covered: Number of states with a rule, over the action dimensions.
        obeyed: In how many of them the expert did as all say that apply; None without an expert.
        freedom: What is left to choose from, in the mean of the states.
    """

    rule_set: RuleSet
    labels: NDArray[np.int64]
    decided: NDArray[np.int64]
    right: NDArray[np.int64] | None
    conflicts: tuple[Conflict, ...]
    covered: int
    obeyed: int | None
    freedom: float

    @property
    def coverage(self) -> float:
        """Share of states in which some rule applies, averaged over action dimensions."""
        return float((self.labels >= 0).mean()) if self.labels.size else float("nan")

    @property
    def fidelity(self) -> float:
        """Share of the covered states in which the expert did as the rules say; NaN if unknown."""
        if self.obeyed is None or not self.covered:
            return float("nan")
        return self.obeyed / self.covered


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
    if rule_set.forbids:
        return _of_forbidding(ground, rule_set, expert)
    first, second = deciding(ground, rule_set)
    labels, behind = labels_at(rule_set, first), labels_at(rule_set, second)
    n = len(rule_set.rules)
    right = None
    if expert is not None:
        right = _counts(first[(first >= 0) & (labels == expert)], n)
    covered = int((first >= 0).sum())
    return Verdicts(
        rule_set,
        labels,
        _counts(first[first >= 0], n),
        right,
        _conflicts(rule_set, first, second, labels, behind, expert),
        covered=covered,
        obeyed=None if right is None else int(right.sum()),
        freedom=1.0 - covered / first.size if first.size else float("nan"),
    )


def _of_forbidding(ground: Ground, rule_set: RuleSet, expert: NDArray[np.int64] | None) -> Verdicts:
    """The same where some rules forbid: any number of those has a say in a state."""
    shield = Shield(rule_set, on_invalid="pass")
    width = Extension.of(rule_set.source.features).width
    states = np.ascontiguousarray(ground.states[:, :width])
    first = shield.rules_in_force(states)
    left = labels_left_of_each(shield, states)
    labels = np.stack([left_codes(each) for each in left], axis=1)
    labels[first < 0] = NO_RULE
    demands = np.array([not rule.forbids for rule in rule_set.rules] + [False])[first]
    enabled = np.array([rule.enabled for rule in rule_set.rules])
    forbids = np.array([bool(rule.forbids) for rule in rule_set.rules])
    dimension = np.array([rule.dimension for rule in rule_set.rules], dtype=np.int64)
    applied = applications(rule_set, ground.states)
    rule, row = applied.rule, applied.row
    says = enabled[rule] & forbids[rule] & ~demands[row, dimension[rule]]
    rows, columns = np.nonzero(demands)
    rule, row = np.append(rule[says], first[rows, columns]), np.append(row[says], rows)
    n, right, obeyed = len(rule_set.rules), None, None
    if expert is not None:
        as_it_says = obeying_labels(rule_set)[rule, expert[row, dimension[rule]]]
        right = _counts(rule[as_it_says], n)
        broken = np.zeros(first.shape, dtype=np.bool_)
        broken[row[~as_it_says], dimension[rule[~as_it_says]]] = True
        obeyed = int(((first >= 0) & ~broken).sum())
    return Verdicts(
        rule_set,
        labels,
        _counts(rule, n),
        right,
        (),
        covered=int((first >= 0).sum()),
        obeyed=obeyed,
        freedom=float(shield.freedom(states, first).mean()) if len(states) else float("nan"),
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
