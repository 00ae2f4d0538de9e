"""Rules by features: a row a rule, a column a feature, the interval drawn in the cell.

For sets that are too large to read one by one: columns of equal bars show what rules agree on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.templates import render, style_sheet
from sarl_core.mining.action_words import says_label, says_text
from sarl_core.mining.language import (
    counted,
    least_bounds,
    number_text,
    share_text,
    short_condition,
)
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Bounds, Rule

PAGE_ROWS = 50
LEGEND = (
    "A bar is the interval that a rule asks for, on the scale of the feature; one that reaches the "
    "side of its cell is open there. Expert agrees: how often it did what the rule says."
)
PLACED_LEGEND = "* written by hand or pinned: tried first, in this order."
PLACED_MARK = "* "
OFF_LEGEND = "Pale: switched off."
_MANY_COLUMNS = 8  # from here on their names stand upright
_INSET = 8.0  # percent of a cell beyond the range of the data, where open intervals go on
_OPEN = 1.5  # to here, so that bars of neighbours do not run into each other


class MatrixColumn(NamedTuple):
    """A feature that some rule asks about.

    Attributes:
        feature: Its index.
        name: Its name and unit.
        low: Left end of the scale: the least value there is.
        high: Right end.
    """

    feature: int
    name: Feature
    low: float
    high: float


class Bar(NamedTuple):
    """An interval in a cell.

    Attributes:
        left: Where it begins, 0 to 100 percent of the cell.
        right: Where it ends.
        text: The interval in words.
    """

    left: float
    right: float
    text: str


@dataclass(frozen=True)
class RuleMatrix:
    """What is to be drawn.

    Attributes:
        rule_set: Knows the names.
        columns: Features that rules ask about.
        rules: Those that a person placed, in their order; then by action dimension and action,
            the most support first.
    """

    rule_set: RuleSet
    columns: tuple[MatrixColumn, ...]
    rules: tuple[Rule, ...]

    @property
    def pages(self) -> int:
        """Number of pages of `PAGE_ROWS` rules, at least one."""
        return max(math.ceil(len(self.rules) / PAGE_ROWS), 1)

    def page(self, number: int) -> tuple[Rule, ...]:
        """The rules of a page.

        Args:
            number: From 1.

        Returns:
            At most `PAGE_ROWS`.
        """
        return self.rules[(number - 1) * PAGE_ROWS : number * PAGE_ROWS]

    def bars(self, rule: Rule) -> dict[int, Bar]:
        """The intervals of a rule, by feature.

        Args:
            rule: One of them.

        Returns:
            One a feature that it asks about.
        """
        bounds_of_rule = least_bounds(rule, self.rule_set.source.features)
        by_feature = {bounds.feature: bounds for bounds in bounds_of_rule}
        return {
            column.feature: _bar(by_feature[column.feature], column)
            for column in self.columns
            if column.feature in by_feature
        }


def rule_matrix(rule_set: RuleSet, demonstrations: Demonstrations | None = None) -> RuleMatrix:
    """Arrange rules and features.

    Args:
        rule_set: Any number of rules.
        demonstrations: Their least and largest values are the ends of the scales; where not given
            or of other features, those of the rules' data boxes, or else of their thresholds.

    Returns:
        Columns in the order of the features.
    """
    features = rule_set.source.features
    queried = sorted(
        {one.feature for rule in rule_set.rules for one in least_bounds(rule, features)}
    )
    if demonstrations is not None and demonstrations.observations.shape[1] != len(features):
        demonstrations = None
    placed = [rule for rule in rule_set.rules if rule.placed]
    others = [rule for rule in rule_set.rules if not rule.placed]
    others.sort(key=lambda rule: (rule.dimension, rule.label, rule.kind, -rule.samples))
    return RuleMatrix(
        rule_set,
        tuple(
            MatrixColumn(feature, features[feature], *_range(feature, rule_set, demonstrations))
            for feature in queried
        ),
        (*placed, *others),
    )


def matrix_html(matrix: RuleMatrix, rules: Sequence[Rule]) -> Markup:
    """Some rows as a table.

    Args:
        matrix: What is to be drawn.
        rules: Some of its rules.

    Returns:
        HTML; it may be wider than the screen and then scrolls.
    """
    return render(
        "rules/rule_matrix",
        key=_key(rules, matrix.rule_set),
        columns=[(column.name.name, _scale_text(column)) for column in matrix.columns],
        upright=len(matrix.columns) > _MANY_COLUMNS,
        rows=[_row(matrix, rule) for rule in rules],
    )


def matrix_document(matrix: RuleMatrix) -> Markup:
    """All rows as a file that opens without a network and prints on A4, light.

    Args:
        matrix: What is to be drawn.

    Returns:
        An HTML document.
    """
    return render(
        "documents/rule_matrix_document",
        title=f"Rules for {matrix.rule_set.source.env_id or 'an unnamed environment'}",
        about=f"{counted(len(matrix.rules), 'rule')}, by action, the most general first. {LEGEND} "
        "The rules were learned from examples and guarantee nothing.",
        matrix=matrix_html(matrix, matrix.rules),
        style_sheet=style_sheet(),
    )


def _key(rules: Sequence[Rule], rule_set: RuleSet) -> list[tuple[str, str]]:
    """What the colours and marks of some rows mean; a mark has no colour."""
    actions = {
        (rule.dimension, rule.label, rule.kind, _action(rule, rule_set)) for rule in rule_set.rules
    }
    entries = [(text, label_colour(label)) for _, label, _, text in sorted(actions)]
    if any(rule.placed for rule in rules):
        entries.append((PLACED_LEGEND, ""))
    if not all(rule.enabled for rule in rules):
        entries.append((OFF_LEGEND, ""))
    return entries


def _action(rule: Rule, rule_set: RuleSet) -> str:
    action = rule_set.actions[rule.dimension]
    several = len(rule_set.actions) > 1 and not action.is_interval
    return f"{action.name}: {says_label(rule, action)}" if several else says_text(rule, action)


class _MatrixRow(NamedTuple):
    """A rule, as the template draws it: a cell is its text and its style."""

    name: str
    action: str
    colour: str
    samples: str
    share: str
    off: bool
    cells: list[tuple[str, str]]


def _row(matrix: RuleMatrix, rule: Rule) -> _MatrixRow:
    bars, colour = matrix.bars(rule), label_colour(rule.label)
    cells = [("", "")] * len(matrix.columns)
    for place, column in enumerate(matrix.columns):
        if bar := bars.get(column.feature):
            width = bar.right - bar.left
            cells[place] = bar.text, f"left:{bar.left:.1f}%;width:{width:.1f}%;background:{colour}"
    action = _action(rule, matrix.rule_set)
    name = matrix.rule_set.name_of(rule)
    if rule.placed:
        action = f"{PLACED_MARK}{action}"
        name += ", by hand" if rule.origin == "manual" else ", pinned"
    return _MatrixRow(
        name,
        action,
        colour,
        f"{rule.samples:,}",
        share_text(rule.confidence) if rule.samples else "–",
        not rule.enabled,
        cells,
    )


def _scale_text(column: MatrixColumn) -> str:
    low = number_text(column.low, apart_from=column.high)
    high = number_text(column.high, apart_from=column.low)
    unit = f" {column.name.unit}" if column.name.unit else ""
    return f"{low} to {high}{unit}"


def _range(
    feature: int, rule_set: RuleSet, demonstrations: Demonstrations | None
) -> tuple[float, float]:
    """The ends of a feature's scale."""
    if demonstrations is not None:
        values = demonstrations.observations[:, feature]
        low, high = float(values.min()), float(values.max())
    else:
        boxes = [rule.box for rule in rule_set.rules if rule.box is not None]
        thresholds = [
            threshold
            for rule in rule_set.rules
            for one, _, threshold in rule.conditions
            if one == feature
        ]
        low = min([*(box.least[feature] for box in boxes), *thresholds])
        high = max([*(box.most[feature] for box in boxes), *thresholds])
    return (low, high) if low < high else (low - 1.0, high + 1.0)


def _bar(bounds: Bounds, column: MatrixColumn) -> Bar:
    def place(value: float) -> float:
        if math.isinf(value):
            return _OPEN if value < 0 else 100.0 - _OPEN
        share = (value - column.low) / (column.high - column.low)
        return float(np.clip(_INSET + share * (100.0 - 2 * _INSET), _OPEN, 100.0 - _OPEN))

    return Bar(place(bounds.low), place(bounds.high), short_condition(bounds, column.name))
