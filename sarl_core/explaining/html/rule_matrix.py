"""Rules by features: a row a rule, a column a feature, the interval drawn in the cell.

For sets that are too large to read one by one: columns of equal bars show what rules agree on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.explaining.figures.colours import label_colour
from sarl_core.explaining.html.scrolling import WIDE_STYLE, wide_html
from sarl_core.mining.language import (
    action_text,
    counted,
    label_text,
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


class Column(NamedTuple):
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
    columns: tuple[Column, ...]
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
        by_feature = {bounds.feature: bounds for bounds in rule.bounds}
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
    asked = sorted({bounds.feature for rule in rule_set.rules for bounds in rule.bounds})
    features = rule_set.source.features
    if demonstrations is not None and demonstrations.observations.shape[1] != len(features):
        demonstrations = None
    placed = [rule for rule in rule_set.rules if rule.placed]
    others = [rule for rule in rule_set.rules if not rule.placed]
    others.sort(key=lambda rule: (rule.dimension, rule.action, -rule.samples))
    return RuleMatrix(
        rule_set,
        tuple(
            Column(feature, features[feature], *_range(feature, rule_set, demonstrations))
            for feature in asked
        ),
        (*placed, *others),
    )


def matrix_html(matrix: RuleMatrix, rules: Sequence[Rule]) -> str:
    """Some rows as a table.

    Args:
        matrix: What is to be drawn.
        rules: Some of its rules.

    Returns:
        HTML without script, every name escaped; it may be wider than the screen and then scrolls.
    """
    upright = " up" if len(matrix.columns) > _MANY_COLUMNS else ""
    head = "".join(
        f'<th class="f{upright}"><div><b>{escape(column.name.name)}</b>'
        f"<small>{_scale_text(column)}</small></div></th>"
        for column in matrix.columns
    )
    body = "".join(_row(matrix, rule) for rule in rules)
    table = (
        '<table class="sarl-matrix"><thead><tr><th class="a">Action</th><th class="n">States</th>'
        f'<th class="n">Expert agrees</th>{head}</tr></thead><tbody>{body}</tbody></table>'
    )
    return f"{_STYLE}{_key(rules, matrix.rule_set)}{wide_html(table, 'Rules by features')}"


def matrix_document(matrix: RuleMatrix) -> str:
    """All rows as a file that opens without a network and prints on A4, light.

    Args:
        matrix: What is to be drawn.

    Returns:
        An HTML document.
    """
    source = matrix.rule_set.source
    title = f"Rules for {escape(source.env_id) or 'an unnamed environment'}"
    return (
        '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{title}</title>{_DOCUMENT_STYLE}</head><body><h1>{title}</h1>"
        f"<p>{counted(len(matrix.rules), 'rule')}, by action, the most general first. {LEGEND} "
        "The rules were learned from examples and guarantee nothing.</p>"
        f"{matrix_html(matrix, matrix.rules)}</body></html>"
    )


def _key(rules: Sequence[Rule], rule_set: RuleSet) -> str:
    """What the colours and marks of some rows mean."""
    shown = {(rule.dimension, rule.action) for rule in rule_set.rules}
    entries = "".join(
        f'<span><i style="background:{label_colour(label)}"></i>'
        f"{escape(_action(label, rule_set, dimension))}</span>"
        for dimension, label in sorted(shown)
    )
    if any(rule.placed for rule in rules):
        entries += f"<span>{PLACED_LEGEND}</span>"
    if not all(rule.enabled for rule in rules):
        entries += f"<span>{OFF_LEGEND}</span>"
    return f'<div class="sarl-matrix-key">{entries}</div>'


def _action(label: int, rule_set: RuleSet, dimension: int) -> str:
    action = rule_set.actions[dimension]
    several = len(rule_set.actions) > 1 and not action.is_interval
    text = action_text(label, action)
    return f"{action.name}: {label_text(label, action)}" if several else text


def _row(matrix: RuleMatrix, rule: Rule) -> str:
    colour = label_colour(rule.action)
    bars = matrix.bars(rule)
    cells = []
    for column in matrix.columns:
        bar = bars.get(column.feature)
        if bar is None:
            cells.append('<td class="c"></td>')
            continue
        cells.append(
            f'<td class="c" title="{escape(bar.text)}"><i style="left:{bar.left:.1f}%;'
            f'width:{bar.right - bar.left:.1f}%;background:{colour}"></i></td>'
        )
    action = escape(_action(rule.action, matrix.rule_set, rule.dimension))
    name = matrix.rule_set.name_of(rule)
    if rule.placed:
        action = f"{PLACED_MARK}{action}"
        name += ", by hand" if rule.origin == "manual" else ", pinned"
    off = "" if rule.enabled else ' class="off"'
    share = share_text(rule.confidence) if rule.samples else "–"
    return (
        f'<tr{off}><td class="a" title="{name}"><i style="background:{colour}"></i>'
        f'{action}</td><td class="n">{rule.samples:,}</td><td class="n">{share}</td>'
        f"{''.join(cells)}</tr>"
    )


def _scale_text(column: Column) -> str:
    low = number_text(column.low, apart_from=column.high)
    high = number_text(column.high, apart_from=column.low)
    unit = f" {escape(column.name.unit)}" if column.name.unit else ""
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
        asked = [
            threshold
            for rule in rule_set.rules
            for one, _, threshold in rule.conditions
            if one == feature
        ]
        low = min([*(box.least[feature] for box in boxes), *asked])
        high = max([*(box.most[feature] for box in boxes), *asked])
    return (low, high) if low < high else (low - 1.0, high + 1.0)


def _bar(bounds: Bounds, column: Column) -> Bar:
    def place(value: float) -> float:
        if math.isinf(value):
            return _OPEN if value < 0 else 100.0 - _OPEN
        share = (value - column.low) / (column.high - column.low)
        return float(np.clip(_INSET + share * (100.0 - 2 * _INSET), _OPEN, 100.0 - _OPEN))

    return Bar(place(bounds.low), place(bounds.high), short_condition(bounds, column.name))


_STYLE = (
    WIDE_STYLE
    + """<style>
.sarl-matrix { border-collapse: collapse; font-size: 0.8rem; min-width: 100%; }
.sarl-matrix th { text-align: left; vertical-align: bottom; font-weight: 400; padding: 0 6px 4px;
  border: 0; }
.sarl-matrix th b { font-weight: 600; display: block; }
.sarl-matrix th small { opacity: 0.7; white-space: nowrap; display: block; }
.sarl-matrix th.up div { writing-mode: vertical-rl; transform: rotate(180deg); max-height: 11rem; }
.sarl-matrix td { padding: 2px 6px; border: 0; border-top: 1px solid rgba(128,140,150,0.25);
  height: 22px; }
.sarl-matrix td.n, .sarl-matrix th.n { text-align: right; white-space: nowrap;
  font-variant-numeric: tabular-nums; }
.sarl-matrix td.a { white-space: nowrap; max-width: 15rem; overflow: hidden;
  text-overflow: ellipsis; }
.sarl-matrix td.a i { display: inline-block; width: 10px; height: 10px; border-radius: 2px;
  margin-right: 6px; }
.sarl-matrix td.c { position: relative; min-width: 44px; padding: 0;
  border-left: 1px solid rgba(128,140,150,0.25); }
.sarl-matrix td.c i { position: absolute; top: 5px; bottom: 5px; min-width: 2px;
  border-radius: 2px; -webkit-print-color-adjust: exact; print-color-adjust: exact; }
.sarl-matrix td.a i, .sarl-matrix-key i { -webkit-print-color-adjust: exact;
  print-color-adjust: exact; }
.sarl-matrix tr.off { opacity: 0.4; }
.sarl-matrix-key { display: flex; flex-wrap: wrap; gap: 0.2rem 0.9rem; font-size: 0.82rem;
  margin-bottom: 0.5rem; }
.sarl-matrix-key i { display: inline-block; width: 11px; height: 11px; border-radius: 2px;
  margin-right: 0.35rem; vertical-align: -1px; }
@media print { .sarl-matrix thead { display: table-header-group; }
  .sarl-matrix tr { break-inside: avoid; } }
</style>"""
)

_DOCUMENT_STYLE = """<style>
@page { size: A4 landscape; margin: 12mm; }
:root { color-scheme: light; }
body { font: 14px/1.4 system-ui, sans-serif; color: #1d2730; background: #ffffff; margin: 1.5rem; }
h1 { font-size: 1.3rem; margin: 0 0 0.3rem; }
p { max-width: 60rem; margin: 0 0 0.8rem; }
@media print { body { margin: 0; font-size: 11px; } }
</style>"""
