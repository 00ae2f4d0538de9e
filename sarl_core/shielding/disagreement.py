"""On which states two rule sets decide differently."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.derived import Combination, Extension
from sarl_core.demonstrations.words import columns_of_words
from sarl_core.mining.editing.difference import Difference, comparable, rule_difference
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE
from sarl_core.mining.rules import Rule
from sarl_core.shielding.decisions import Ground, deciding, ground_of, labels_at, regions
from sarl_core.shielding.leeway import labels_left_of_each
from sarl_core.shielding.shield import Shield

Choices = tuple[tuple[int, ...], ...]

SAMPLED_STATES = 10_000
_MARGIN = 0.1  # of the thresholds' range, on either side


class Kinds(NamedTuple):
    """In what way two rule sets decide states of one action dimension differently.

    Attributes:
        contradicting: Both have a rule, and the two say different things.
        only_first: Only the first has a rule.
        only_second: Only the second has one.
    """

    contradicting: int
    only_first: int
    only_second: int


@dataclass(frozen=True, eq=False)
class Disagreement:
    """Two rule sets on the same B states, m action dimensions.

    Attributes:
        first: A rule set.
        second: Another.
        rules: Index of the rule in force in each set, -1 for none, two of (B, m).
        labels: What each set says, -1 where no rule applies, two of (B, m). Rules that forbid say
            the label that alone is left, or where several are a number past the last label.
        difference: Rules added, removed and changed.
        choices: Of each action dimension the labels that are left where several are, in the order
            of these numbers.
    """

    first: RuleSet
    second: RuleSet
    rules: tuple[NDArray[np.int64], NDArray[np.int64]]
    labels: tuple[NDArray[np.int64], NDArray[np.int64]]
    difference: Difference
    choices: tuple[Choices, ...]

    @property
    def states(self) -> int:
        """Number B of states."""
        return len(self.labels[0])

    @cached_property
    def differs(self) -> NDArray[np.bool_]:
        """Where they decide differently, a rule and no rule included, (B, m).

        Alike are two that leave the same labels, whether by what they demand or what they forbid.
        """
        return np.asarray(self.labels[0] != self.labels[1])

    @cached_property
    def rows(self) -> NDArray[np.int64]:
        """States that some action dimension decides differently, ascending."""
        return np.flatnonzero(self.differs.any(axis=1))

    @property
    def different(self) -> int:
        """Number of states that some action dimension decides differently."""
        return len(self.rows)

    @property
    def share(self) -> float:
        """The same as a share; NaN without states."""
        return self.different / self.states if self.states else float("nan")

    def kinds(self, dimension: int) -> Kinds:
        """In what way they decide differently.

        Args:
            dimension: Action dimension.

        Returns:
            Counts of states.
        """
        first, second = (labels[:, dimension] >= 0 for labels in self.labels)
        differs = self.differs[:, dimension]
        return Kinds(
            int((differs & first & second).sum()),
            int((first & ~second).sum()),
            int((second & ~first).sum()),
        )

    def confusion(self, dimension: int) -> NDArray[np.int64]:
        """How many states the first set says one thing of and the second another.

        Args:
            dimension: Action dimension.

        Returns:
            Shape (labels + choices + 1, the same), what the first set says by what the second does;
            the last row and column are for no rule.
        """
        size = self.first.actions[dimension].n_labels + len(self.choices[dimension]) + 1
        ours, theirs = (labels[:, dimension] % size for labels in self.labels)
        counts = np.bincount(ours * size + theirs, minlength=size * size)
        return counts.reshape(size, size).astype(np.int64)


def disagreement(
    first: RuleSet | Ground, second: RuleSet | Ground, states: NDArray[np.float32] | None = None
) -> Disagreement:
    """Compare two rule sets: their rules, and what they decide on the same states.

    Args:
        first: A rule set, or one that was walked with the states already.
        second: Another, likewise.
        states: Shape (B, d), float32; not needed where both were walked.

    Returns:
        Rules added, removed and changed on the way from the first to the second, and the
        decisions.

    Raises:
        InputError: If the two are for different features or actions, or the states are.
        ValueError: If there are no states, or the two were walked with different ones.
    """
    ordered = comparable(_rules_of(first), _rules_of(second)).rule_set
    if ordered is not _rules_of(second):
        # What was walked in another order is walked again, with the states of the first.
        states = first.states if isinstance(first, Ground) else states
        second = ordered
    grounds = [_walked(each, states) for each in (first, second)]
    if len(grounds[0].states) != len(grounds[1].states):
        raise ValueError("the two rule sets were walked with different states")
    rule_sets = [ground.rule_set for ground in grounds]
    rules = [_in_force(ground) for ground in grounds]
    labels, choices = _said(grounds, rules)
    return Disagreement(
        rule_sets[0],
        rule_sets[1],
        (rules[0], rules[1]),
        (labels[0], labels[1]),
        rule_difference(
            rule_sets[0],
            rule_sets[1],
            (regions(grounds[0]), regions(grounds[1])),
            states=len(grounds[0].states),
        ),
        choices,
    )


def _in_force(ground: Ground) -> NDArray[np.int64]:
    """The rule that decides each state; of several that forbid the first, (B, m)."""
    if not ground.rule_set.forbids:
        return deciding(ground).first
    return Shield(ground.rule_set, on_invalid="pass").rules_in_force(_observed(ground))


def _observed(ground: Ground) -> NDArray[np.float32]:
    width = Extension.of(ground.rule_set.source.features).width
    return np.ascontiguousarray(ground.states[:, :width])


def _said(
    grounds: Sequence[Ground], rules: Sequence[NDArray[np.int64]]
) -> tuple[list[NDArray[np.int64]], tuple[Choices, ...]]:
    """What each set says of the states, and the choices that rules which forbid leave."""
    labels = [
        labels_at(ground.rule_set, in_force)
        for ground, in_force in zip(grounds, rules, strict=True)
    ]
    left = {
        place: labels_left_of_each(Shield(ground.rule_set, on_invalid="pass"), _observed(ground))
        for place, ground in enumerate(grounds)
        if ground.rule_set.forbids
    }
    choices: list[Choices] = []
    for dimension, action in enumerate(grounds[0].rule_set.actions):
        there = {
            place: np.unique(each[dimension], axis=0, return_inverse=True)
            for place, each in left.items()
        }
        known: set[tuple[int, ...]] = set()
        for kinds, _ in there.values():
            known.update(tuple(np.flatnonzero(kind).tolist()) for kind in kinds)
        several = [one for one in known if 1 < len(one) < action.n_labels]
        choices.append(tuple(sorted(several, key=lambda one: (-len(one), one[::-1]))))
        for place, (kinds, of_each) in there.items():
            codes = [_code(np.flatnonzero(kind).tolist(), action, choices[-1]) for kind in kinds]
            said = np.array(codes, dtype=np.int64)[of_each.reshape(-1)]
            labels[place][:, dimension] = np.where(rules[place][:, dimension] < 0, NO_RULE, said)
    return labels, tuple(choices)


def _code(left: list[int], action: LabelledDimension, choices: Choices) -> int:
    """A number for labels that are left: the only one, or a place behind the last label."""
    if len(left) == 1:
        return left[0]
    if len(left) == action.n_labels:
        return NO_RULE
    return action.n_labels + choices.index(tuple(left))


def _rules_of(each: RuleSet | Ground) -> RuleSet:
    return each.rule_set if isinstance(each, Ground) else each


def _walked(each: RuleSet | Ground, states: NDArray[np.float32] | None) -> Ground:
    if isinstance(each, Ground):
        return each
    if states is None:
        raise ValueError("there are no states to compare the rule sets on")
    return ground_of(each, states)


def sampled_states(
    rule_sets: Sequence[RuleSet], *, count: int = SAMPLED_STATES, seed: int = 0
) -> NDArray[np.float32]:
    """States spread evenly over the range of the thresholds, where there are no demonstrations.

    They say where rule sets differ at all, not how often: an agent does not come by evenly.

    Args:
        rule_sets: Of the same d features, one or more.
        count: How many states.
        seed: The same seed gives the same states.

    Returns:
        Shape (count, d + k), float32: each feature uniform from a little below its least threshold
        to a little above its largest; 0 where nothing asks about it. A column of words holds each
        of them as often. What is derived is worked out from the others, which reach as far as its
        thresholds need them to.
    """
    extension = Extension.of(rule_sets[0].source.features)
    width = extension.width
    low, high = np.full(width, np.inf), np.full(width, -np.inf)
    for rule_set in rule_sets:
        for rule in rule_set.rules:
            for feature, threshold in _observed_thresholds(rule, extension):
                low[feature] = min(low[feature], threshold)
                high[feature] = max(high[feature], threshold)
    bounded = np.isfinite(low)
    low, high = np.where(bounded, low, 0.0), np.where(bounded, high, 0.0)
    # Around a single threshold as much room as it is far from 0, or 1 where it is 0.
    alone = np.where(low == 0.0, 1.0, np.abs(low))
    margin = np.where(bounded, np.where(high > low, _MARGIN * (high - low), alone), 0.0)
    largest = float(np.finfo(np.float32).max)
    low, high = np.clip(low - margin, -largest, largest), np.clip(high + margin, -largest, largest)
    generator = np.random.default_rng(seed)
    drawn = generator.random((count, width))
    states = np.asarray(low * (1.0 - drawn) + high * drawn, dtype=np.float32)
    indicators = [one.indicator for one in rule_sets[0].source.features]
    for places in columns_of_words(indicators).values():
        several = max(len(places), 2)  # of two words one feature is enough
        words = np.eye(several, dtype=np.float32)[generator.integers(several, size=count)]
        states[:, places] = words[:, : len(places)]
    return extension.many(states)


def _observed_thresholds(rule: Rule, extension: Extension) -> Iterator[tuple[int, float]]:
    """What a rule asks of features; of those that something is derived from, how far they count."""
    for feature, _, threshold in rule.conditions:
        if feature < extension.width:
            yield feature, threshold
            continue
        definition = extension.definitions[feature - extension.width]
        weights = [1.0] * len(definition.features)
        if isinstance(definition, Combination):
            weights[1] = definition.ratio
        for one, weight in zip(definition.features, weights, strict=True):
            reach = (abs(threshold) or 1.0) / abs(weight)
            yield one, reach
            yield one, -reach
