"""A rule set in the form that code is written from: what is asked in which order, and what follows.

It does what a `Shield` does that acts everywhere (``outside="act"``), with float32 states and,
where actions are continuous, float32 actions: those that environments give and take. What it
does with a state or an action that is none is the choice that the program was made for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import Literal, NamedTuple

import numpy as np

from sarl_core.demonstrations.dataset import Feature, observed_features
from sarl_core.environments.formulas import Formula
from sarl_core.errors import InputError, require
from sarl_core.explaining.words.sign_off import SignOff, sign_off_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import one_line
from sarl_core.mining.rule_order import without_idle
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE, NOTHING, Numbered, RuleNode, tree_of
from sarl_core.mining.tree import LEAF
from sarl_core.shielding.forbidding import never_rules
from sarl_core.shielding.projection import (
    Projection,
    Replacements,
    label_replacements,
    replacements,
)
from sarl_core.shielding.shield import OnInvalid

# Nested deeper than this, code goes on in a function of its own: Python ends at a hundred levels.
_MOST_LEVELS = 20
_COMMENT = 88  # signs of a line in a comment


class Replacement(NamedTuple):
    """What a rule makes of a proposed action.

    An action carries the rule's label if it is neither below `low` nor above `high`; it is left.

    Attributes:
        value: What any other action becomes, a whole number or a float32 one; None for the
            nearest in [low, high].
        low: Least action that carries the rule's label.
        high: Largest such action.
        open_low: Whether all actions below carry it too.
        open_high: Whether all actions above carry it too.
    """

    value: float | None
    low: float
    high: float
    open_low: bool
    open_high: bool


class DimensionProgram(NamedTuple):
    """How the rule of one action dimension is found.

    Attributes:
        dimension: The action dimension.
        scanned: Rules that are tried one by one, first; each with its index.
        nodes: The tree that is walked where none of them applies, root first.
        label: That which the rules forbid; None for rules that demand one.
    """

    dimension: LabelledDimension
    scanned: tuple[Numbered, ...]
    nodes: tuple[RuleNode, ...]
    label: int | None = None

    @property
    def asks(self) -> bool:
        """Whether anything is asked of the state."""
        return len(self.nodes) > 1 or any(rule.conditions for _, rule in self.scanned)


@dataclass(frozen=True)
class Program:
    """All that code needs to know.

    Attributes:
        rule_set: Where it comes from, without derived features that no rule asks about.
        projection: What a continuous action that breaks a rule becomes.
        on_invalid: What becomes of a step whose state is no state, or whose action is none.
        orders: One an action dimension, of the rules that demand an action.
        outcomes: One a rule, in the order of the rule set; nothing of a never-rule.
        never: Of each action dimension one for each label that never-rules forbid somewhere, which
            are asked where no other rule applies.
        allowed: Of each action dimension what a forbidden action becomes, by the label in its
            place.
    """

    rule_set: RuleSet
    projection: Projection
    on_invalid: OnInvalid
    orders: tuple[DimensionProgram, ...]
    outcomes: tuple[Replacement, ...]
    never: tuple[tuple[DimensionProgram, ...], ...]
    allowed: tuple[tuple[Replacement, ...], ...]

    @property
    def width(self) -> int:
        """Number of features of the state; derived ones follow them."""
        return len(observed_features(self.rule_set.source.features))

    @property
    def derives(self) -> bool:
        """Whether something is worked out from the state."""
        return self.width < len(self.rule_set.source.features)

    @property
    def formulas(self) -> frozenset[int]:
        """Which features are formulas, and may have no value."""
        return frozenset(
            place
            for place, feature in enumerate(self.rule_set.source.features)
            if isinstance(feature.derived, Formula)
        )

    @property
    def forbids(self) -> bool:
        """Whether a never-rule is among its rules."""
        return any(self.never)

    @property
    def most_labels(self) -> int:
        """Number of labels of the action dimension that has most."""
        return max(map(len, self.allowed))

    @property
    def searches(self) -> tuple[DimensionProgram, ...]:
        """All that may be asked of a state."""
        return (*self.orders, *(each for labels in self.never for each in labels))

    @property
    def continuous(self) -> bool:
        """Whether the actions are numbers from intervals."""
        return self.orders[0].dimension.is_interval

    @property
    def labels(self) -> tuple[tuple[int, int], ...]:
        """Of each discrete action the first and the last there is; () for numbers of intervals."""
        dimensions = [order.dimension for order in self.orders if not self.continuous]
        return tuple((each.actions[0], each.actions[-1]) for each in dimensions)


class CodeLine(NamedTuple):
    """One line of nested code.

    Attributes:
        level: How deep it is nested.
        kind: A query, its other side, its end, the rule that applies, or the part that goes on.
        feature: Of a query.
        threshold: Of a query.
        target: Index of the rule or `NO_RULE`; number of the part.
    """

    level: int
    kind: Literal["if", "else", "end", "rule", "part"]
    feature: int = LEAF
    threshold: float = 0.0
    target: int = NO_RULE


def state_lines(features: Sequence[Feature]) -> list[str]:
    """What the numbers of a state are, for a comment.

    Args:
        features: The d features.

    Returns:
        As "  0  gap (m)" and "  1  mode is heavy (1 if so, else 0)".
    """
    return [
        f"{index:>3}  {one_line(feature.name)}"
        + (f" ({one_line(feature.unit)})" if feature.unit else "")
        + ("" if feature.indicator is None else " (1 if so, else 0)")
        for index, feature in enumerate(observed_features(features))
    ]


def action_lines(dimensions: Sequence[LabelledDimension]) -> list[str]:
    """What the numbers of an action are, for a comment.

    Args:
        dimensions: The m action dimensions.

    Returns:
        As "  0  pedal", and where its labels have names "       0  brake" for each.
    """
    lines = []
    for index, dimension in enumerate(dimensions):
        lines.append(f"{index:>3}  {one_line(dimension.name)}")
        if not dimension.is_interval and dimension.label_names != tuple(
            map(str, dimension.actions)
        ):
            labels = zip(dimension.actions, dimension.label_names, strict=True)
            lines += [f"     {action:>3}  {one_line(name)}" for action, name in labels]
    return lines


def sign_off_lines(sign_off: SignOff | None) -> list[str]:
    """Who approved the rules, for a comment; [] where nothing is to be said of it."""
    return [one_line(line) for line in wrap(sign_off_text(sign_off), _COMMENT)]


def query_name(feature: Feature) -> str:
    """What a query whether a feature is at most a threshold is about, for a comment."""
    return one_line(feature.name if feature.indicator is None else feature.statement(False))


def require_rules(rule_set: RuleSet) -> None:
    """Refuse what is no rule set, or one without rules.

    Args:
        rule_set: To export.

    Raises:
        InputError: If there is nothing in it.
    """
    require(rule_set, RuleSet, "what is exported must be a RuleSet", "load one: load_rules(path)")
    if not rule_set.rules:
        raise InputError(
            "the rule set has no rules, so there is nothing to export; lower the minimum support "
            "or confidence, or choose other rules"
        )


def program_of(
    rule_set: RuleSet, projection: Projection = "centre", on_invalid: OnInvalid = "raise"
) -> Program:
    """Arrange rules for writing code.

    Args:
        rule_set: The rules; those switched off are left out, and keep their index.
        projection: What a continuous action that breaks a rule becomes.
        on_invalid: What becomes of a step whose state is no state, or whose action is none.

    Returns:
        Placed rules first, the others as a tree.

    Raises:
        InputError: If no rule is there or switched on, or ``expert`` is asked of rules without
            demonstrated values.
    """
    require_rules(rule_set)
    if not any(rule.enabled for rule in rule_set.rules):
        raise InputError(
            "every rule of the rule set is switched off, so there is nothing to export; switch "
            "one on"
        )
    rule_set = without_idle(rule_set)
    return Program(
        rule_set,
        projection,
        on_invalid,
        tuple(_order(rule_set, index) for index in range(len(rule_set.actions))),
        _outcomes(rule_set, projection),
        tuple(
            tuple(
                _arranged(dimension, [entry for entry in rules if label in entry[1].forbids], label)
                for label in sorted({label for _, rule in rules for label in rule.forbids})
            )
            for dimension, rules in zip(rule_set.actions, never_rules(rule_set), strict=True)
        ),
        tuple(_allowed(dimension, projection) for dimension in rule_set.actions),
    )


def parts_of(nodes: tuple[RuleNode, ...]) -> list[list[CodeLine]]:
    """A tree as nested queries, in parts that are not nested too deep.

    Args:
        nodes: Root first.

    Returns:
        The part with the root first; a part goes on only in parts after it.
    """
    roots, parts = [0], []
    for root in roots:  # grows on the way
        steps: list[CodeLine] = []
        waiting: list[tuple[Literal["node", "else", "end"], int, int]] = [("node", root, 0)]
        while waiting:
            kind, place, level = waiting.pop()
            if kind != "node":
                steps.append(CodeLine(level, kind))
                continue
            node = nodes[place]
            if node.feature == LEAF:
                steps.append(CodeLine(level, "rule", target=node.rule))
            elif level == _MOST_LEVELS:
                steps.append(CodeLine(level, "part", target=len(roots)))
                roots.append(place)
            else:
                steps.append(CodeLine(level, "if", node.feature, node.threshold))
                waiting += [
                    ("end", place, level),
                    ("node", node.right, level + 1),
                    ("else", place, level),
                    ("node", node.left, level + 1),
                ]
        parts.append(steps)
    return parts


def largest_float32(number: float) -> np.float32:
    """The largest float32 number that is at most a number.

    It divides float32 values exactly as the number does: all that are at most the one are at most
    the other.

    Args:
        number: A threshold.

    Returns:
        -inf below all finite ones.
    """
    with np.errstate(over="ignore"):
        nearest = np.float32(number)
    lower = np.float32(-np.inf)
    return np.nextafter(nearest, lower) if float(nearest) > number else nearest


def _order(rule_set: RuleSet, index: int) -> DimensionProgram:
    """How the rules that demand an action are found in one dimension."""
    rules = [
        (place, rule)
        for place, rule in enumerate(rule_set.rules)
        if rule.dimension == index and rule.enabled and not rule.forbids
    ]
    return _arranged(rule_set.actions[index], rules)


def _arranged(
    dimension: LabelledDimension, rules: Sequence[Numbered], label: int | None = None
) -> DimensionProgram:
    """As the shield arranges them: placed rules in their order, then the tree of the others."""
    placed = [entry for entry in rules if entry[1].placed]
    others = [entry for entry in rules if not entry[1].placed]
    nodes = tree_of(others)
    if nodes is None:
        placed, nodes = [*placed, *others], [NOTHING]
    return DimensionProgram(dimension, tuple(placed), tuple(nodes), label)


def _outcomes(rule_set: RuleSet, projection: Projection) -> tuple[Replacement, ...]:
    actions = replacements(rule_set, projection)
    nothing = Replacement(None if projection == "clip" else 0, 0, 0, False, False)
    return tuple(
        nothing if rule.forbids else _outcome(rule.action, rule_set.actions[rule.dimension], *entry)
        for rule, entry in zip(rule_set.rules, _settled(actions), strict=True)
    )


def _allowed(dimension: LabelledDimension, projection: Projection) -> tuple[Replacement, ...]:
    actions = label_replacements(dimension, projection)
    return tuple(
        _outcome(label, dimension, *entry) for label, entry in enumerate(_settled(actions))
    )


def _settled(actions: Replacements) -> Iterator[tuple[float, float, float]]:
    """Of each rule or label what an action becomes (NaN: the nearest), least and largest."""
    settled = np.clip(actions.target, actions.low, actions.high)
    return zip(settled.tolist(), actions.low.tolist(), actions.high.tolist(), strict=True)


def _outcome(
    label: int, dimension: LabelledDimension, value: float, low: float, high: float
) -> Replacement:
    if not dimension.is_interval:
        action = dimension.actions[label]  # not through floating point: it may be large
        return Replacement(action, action, action, open_low=False, open_high=False)
    return Replacement(
        None if np.isnan(value) else float(np.float32(value)),
        low,
        high,
        open_low=label == 0,
        open_high=label == dimension.n_labels - 1,
    )
