"""What never-rules forbid in a state, and what comes in the place of a forbidden label."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from math import isnan
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE, Numbered
from sarl_core.mining.rules import Rule, take_back_unanswered
from sarl_core.shielding.boxes import Boxes, leaves_out
from sarl_core.shielding.matching import Matcher
from sarl_core.shielding.projection import Replacements, label_replacements


class Ruling(NamedTuple):
    """What never-rules make of one value of an action dimension.

    Attributes:
        rule: Index of the rule that it breaks, else of the first that applies; None for none.
        executed: The value to execute.
        margin: Distance of the state to the nearest threshold on the paths walked.
        outside: Whether the state lies outside the data of the rule that it breaks.
    """

    rule: int | None
    executed: Any
    margin: float
    outside: bool


class Forbidding:
    """The never-rules of one action dimension, by the labels that they forbid."""

    def __init__(
        self,
        rules: Sequence[Numbered],
        every: Sequence[Rule],
        dimension: LabelledDimension,
        boxes: Boxes,
        *,
        abstains: bool,
    ) -> None:
        """Arrange them for finding those that apply.

        Args:
            rules: Never-rules of the dimension, each with its index in the rule set.
            every: All rules of the set.
            dimension: With L labels.
            boxes: The data boxes of the set.
            abstains: Whether a rule forbids nothing outside its data.
        """
        self._rules, self._dimension = every, dimension
        self._boxes, self._abstains = boxes, abstains
        self._replace, self._discrete = label_replacements(dimension, "centre"), True
        by_label = (
            (label, [entry for entry in rules if label in entry[1].forbids])
            for label in range(dimension.n_labels)
        )
        self._matchers = {label: Matcher.of(some) for label, some in by_label if some}
        # Of each rule what comes in the place of what it forbids, the likeliest first, filled up
        # with a label that is always forbidden.
        count = dimension.n_labels
        self._instead = np.full((len(every), count), count, dtype=np.int64)
        self._samples = np.full(len(every) + 1, np.iinfo(np.int64).max)
        for index, rule in rules:
            self._instead[index, : len(rule.instead)] = rule.instead
            self._samples[index] = rule.samples

    def executing(self, replace: Replacements, *, discrete: bool) -> Self:
        """The same for an environment.

        Args:
            replace: What a forbidden value becomes, by the label that comes in its place.
            discrete: Whether values are actions that stand for labels.
        """
        other = copy(self)
        other._replace, other._discrete = replace, discrete
        return other

    def decide(self, state: list[float], value: Any) -> Ruling:
        """Check one value.

        Args:
            state: d + k values that are float32 numbers.
            value: Of the dimension, a valid one.

        Returns:
            What becomes of it.
        """
        forbidden, margin = self.one(state)
        label = self._dimension.label_of(value)
        rule = forbidden.get(label)
        if rule is None:
            return Ruling(min(forbidden.values(), default=None), value, margin, False)
        outside = {one for one in forbidden.values() if self._leaves_out(one, state)}
        if self._abstains:
            forbidden = {key: one for key, one in forbidden.items() if one not in outside}
        wanted = self.replacement(forbidden, rule) if label in forbidden else label
        if wanted == label:
            return Ruling(rule, value, margin, rule in outside)
        executed = (
            self._dimension.actions[wanted] if self._discrete else self._replace.one(wanted, value)
        )
        return Ruling(rule, executed, margin, rule in outside)

    def _leaves_out(self, rule: int, state: list[float]) -> bool:
        sides = self._boxes.sides[rule]
        return sides is not None and leaves_out(sides, state)

    def decide_many(
        self, states: NDArray[np.float32], values: NDArray[Any]
    ) -> tuple[NDArray[np.int64], NDArray[Any], NDArray[np.float64], NDArray[np.bool_]]:
        """Check many values, each exactly as `decide` would.

        Args:
            states: Shape (B, d + k), contiguous.
            values: Shape (B,).

        Returns:
            Rules (-1 for none), what is executed, margins and whether outside, (B,) each.
        """
        forbidden, margins = self.many(states)
        rules, rows = first_of(forbidden), np.arange(len(states))
        labels = self._dimension.labels_of(values)
        # An environment may know labels that the rules do not: nothing forbids those.
        known = (labels >= 0) & (labels < forbidden.shape[1])
        broken = np.where(known, forbidden[rows, np.where(known, labels, 0)], NO_RULE)
        rows = np.flatnonzero(broken >= 0)
        rules[rows] = broken[rows]
        outside = np.zeros(len(states), dtype=np.bool_)
        outside[rows] = self._boxes.leave_out(rules[rows], states[rows])
        if self._abstains:
            forbidden = self._acting(forbidden, states)
            rows = rows[~outside[rows]]
        executed = values
        wanted = self.replacements(forbidden[rows], rules[rows])
        changed = wanted != labels[rows]
        rows, wanted = rows[changed], wanted[changed]
        if len(rows):
            executed = values.copy()
            executed[rows] = (
                np.array(self._dimension.actions)[wanted]
                if self._discrete
                else self._replace.many(wanted, values[rows])
            )
        return rules, executed, margins, outside

    def _acting(
        self, forbidden: NDArray[np.int64], states: NDArray[np.float32]
    ) -> NDArray[np.int64]:
        """What is forbidden by rules whose data reach the states."""
        acting = forbidden.copy()
        rows, labels = np.nonzero(forbidden >= 0)
        beyond = self._boxes.leave_out(forbidden[rows, labels], states[rows])
        acting[rows[beyond], labels[beyond]] = NO_RULE
        return acting

    def freedom(self, states: NDArray[np.float32]) -> NDArray[np.float64]:
        """What is left to choose from.

        Args:
            states: Shape (B, d + k), contiguous.

        Returns:
            log(labels still allowed) / log(labels), of two labels or more, (B,).
        """
        forbidden, _ = self.many(states)
        if self._abstains:
            forbidden = self._acting(forbidden, states)
        count = self._dimension.n_labels
        allowed = np.maximum(count - (forbidden >= 0).sum(axis=1), 1)
        return np.asarray(np.log(allowed) / np.log(count))

    def one(self, state: list[float]) -> tuple[dict[int, int], float]:
        """What is forbidden in one state.

        Args:
            state: d + k values that are float32 numbers.

        Returns:
            The rule by which each forbidden label is, and the distance to the nearest threshold.
        """
        forbidden, nearest = {}, float("inf")
        for label, matcher in self._matchers.items():
            rule, margin = matcher.match(state)
            nearest = min(nearest, margin)
            if rule is not None and not any(
                isnan(state[feature]) for feature, _, _ in self._rules[rule].conditions
            ):
                forbidden[label] = rule
        return forbidden, nearest

    def many(self, states: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The same of many states.

        Args:
            states: Shape (B, d + k), contiguous.

        Returns:
            Index of the rule that forbids each label or -1, (B, L), and the distances, (B,).
        """
        forbidden = np.full((len(states), self._dimension.n_labels), NO_RULE, dtype=np.int64)
        nearest = np.full(len(states), np.inf)
        for label, matcher in self._matchers.items():
            forbidden[:, label], margins = matcher.match_batch(states)
            take_back_unanswered(forbidden[:, label], states, self._rules)
            nearest = np.minimum(nearest, margins)
        return forbidden, nearest

    def replacement(self, forbidden: Mapping[int, int], rule: int) -> int:
        """The label that comes in the place of one that a rule forbids.

        Args:
            forbidden: What is forbidden in the state, and by which rules.
            rule: Of these, the one that was broken.

        Returns:
            The most frequent at the broken rule that is allowed. Where none is, the most frequent
            at the rule of the fewest states: it knows most of this one.
        """
        for label in self._rules[rule].instead:
            if label not in forbidden:
                return label
        closest = min(forbidden.values(), key=lambda one: (self._samples[one], one))
        return int(self._instead[closest, 0])

    def replacements(
        self, forbidden: NDArray[np.int64], rules: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """The same of many states.

        Args:
            forbidden: As of `many`, (B, L).
            rules: The rule that was broken in each, (B,).

        Returns:
            Labels, (B,).
        """
        # One more column, which stands for the label that is always forbidden.
        taken = np.hstack([forbidden >= 0, np.ones((len(forbidden), 1), dtype=np.bool_)])
        instead = self._instead[rules]
        allowed = ~np.take_along_axis(taken, instead, axis=1)
        chosen = instead[np.arange(len(rules)), allowed.argmax(axis=1)]
        nothing = np.flatnonzero(~allowed.any(axis=1))
        # Of equally few states the first rule; -1 takes the last, which is none.
        order = np.lexsort((forbidden[nothing], self._samples[forbidden[nothing]]), axis=1)
        closest = forbidden[nothing, order[:, 0]]
        chosen[nothing] = self._instead[closest, 0]
        return np.asarray(chosen)


def first_of(forbidden: NDArray[np.int64]) -> NDArray[np.int64]:
    """The first of the rules that apply.

    Args:
        forbidden: Index of the rule that forbids each label or -1, (B, L).

    Returns:
        Least index or -1, (B,).
    """
    most = np.iinfo(np.int64).max
    first = np.where(forbidden < 0, most, forbidden).min(axis=1)
    return np.where(first == most, NO_RULE, first)


def never_rules(rule_set: RuleSet) -> list[list[Numbered]]:
    """The never-rules that are switched on, of each action dimension."""
    return [
        [
            (index, rule)
            for index, rule in enumerate(rule_set.rules)
            if rule.dimension == dimension and rule.enabled and rule.forbids
        ]
        for dimension in range(len(rule_set.actions))
    ]
