from __future__ import annotations

import io
import re
from dataclasses import replace

import numpy as np
from PIL import Image

from sarl_core import Demonstrations, PolicyTree, RuleSet, mine_rules
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.exports.markdown import rules_to_markdown
from sarl_core.explaining.exports.rule_matrix_png import matrix_png
from sarl_core.explaining.html.rule_matrix import (
    OFF_LEGEND,
    PAGE_ROWS,
    PLACED_LEGEND,
    matrix_document,
    matrix_html,
    rule_matrix,
)
from sarl_core.explaining.words.markdown import markdown_text
from sarl_core.mining.rules import Condition

HOSTILE = '<img src=x onerror="alert(1)">|`*_\n# & "\'</td>'


def rules_of(trees: tuple[PolicyTree, ...]) -> RuleSet:
    return mine_rules(trees, supp_min=0.0, conf_min=1.0)


def hostile(rules: RuleSet) -> RuleSet:
    features = tuple(
        replace(feature, name=f"{HOSTILE}{index}", unit=HOSTILE)
        for index, feature in enumerate(rules.source.features)
    )
    names = tuple(f"{HOSTILE}{index}" for index in range(rules.actions[0].n_labels))
    return replace(
        rules,
        actions=(replace(rules.actions[0], name=HOSTILE, label_names=names),),
        source=replace(rules.source, env_id=HOSTILE, features=features),
        rules=tuple(replace(rule, id=f"{HOSTILE}{rule.id}") for rule in rules.rules),
    )


def test_every_rule_is_on_one_page_sorted_by_action_then_support(
    lander_trees: tuple[PolicyTree, ...],
) -> None:
    rules = rules_of(lander_trees)
    matrix = rule_matrix(rules)
    shown = [rule for page in range(1, matrix.pages + 1) for rule in matrix.page(page)]
    assert sorted(rule.id for rule in shown) == sorted(rule.id for rule in rules.rules)
    keys = [(rule.action, -rule.samples) for rule in shown]
    assert keys == sorted(keys)
    assert all(len(matrix.page(page)) == PAGE_ROWS for page in range(1, matrix.pages))


def test_bars_lie_where_the_intervals_do(
    lander_trees: tuple[PolicyTree, ...], lander_like: Demonstrations
) -> None:
    base = rules_of(lander_trees)
    values = lander_like.observations[:, 2]
    low, high = float(values.min()), float(values.max())
    middle = (low + high) / 2
    rule = replace(base.rules[0], conditions=(Condition(2, ">", middle), Condition(0, "<=", 0.0)))
    matrix = rule_matrix(replace(base, rules=(rule,)), lander_like)
    assert [column.feature for column in matrix.columns] == [0, 2]
    assert (matrix.columns[1].low, matrix.columns[1].high) == (low, high)
    bars = matrix.bars(rule)
    assert abs(bars[2].left - 50.0) < 1e-6
    assert bars[2].right > 98
    assert bars[0].left < 2
    text = matrix_html(matrix, matrix.rules)
    assert text.count('<td class="c"') == 2
    assert text.count(f"background:{label_colour(rule.action)}") >= 3


def test_without_data_the_thresholds_are_the_scale(lander_trees: tuple[PolicyTree, ...]) -> None:
    rules = rules_of(lander_trees)
    for column in rule_matrix(rules).columns:
        asked = [t for r in rules.rules for f, _, t in r.conditions if f == column.feature]
        assert (column.low, column.high) == (min(asked), max(asked))


def test_names_are_escaped_in_the_table_and_the_file(
    lander_trees: tuple[PolicyTree, ...],
) -> None:
    matrix = rule_matrix(hostile(rules_of(lander_trees)))
    for text in (matrix_html(matrix, matrix.page(1)), matrix_document(matrix)):
        assert "<img" not in text
        assert "&lt;img" in text
        assert not re.search(r'title="[^"]*"alert', text)
        assert "://" not in text  # nothing from a network
    assert "@page" in matrix_document(matrix)


def test_the_picture_shows_a_row_a_rule(lander_trees: tuple[PolicyTree, ...]) -> None:
    matrix = rule_matrix(hostile(rules_of(lander_trees)))
    few, many = (
        Image.open(io.BytesIO(matrix_png(matrix, matrix.rules[:count]))) for count in (5, 10)
    )
    assert few.format == "PNG"
    assert few.width == many.width
    assert many.height - few.height == 5 * 40
    first = tuple(int(label_colour(matrix.rules[0].action)[at : at + 2], 16) for at in (1, 3, 5))
    pixels = np.asarray(few.convert("RGB")).reshape(-1, 3)
    assert (pixels == first).all(axis=1).any()


def test_marks_are_explained_where_they_are_seen(lander_trees: tuple[PolicyTree, ...]) -> None:
    rules = rules_of(lander_trees)
    first, second, *others = rules.rules
    pinned, off = replace(first, pinned=True), replace(second, enabled=False)
    matrix = rule_matrix(replace(rules, rules=(pinned, off, *others)))
    plain = tuple(rule for rule in matrix.rules if rule.enabled and not rule.placed)
    for shown, legends in (
        ((pinned, off), {PLACED_LEGEND, OFF_LEGEND}),
        ((pinned, *plain), {PLACED_LEGEND}),
        (plain, set()),
    ):
        text = matrix_html(matrix, shown)
        assert {legend for legend in (PLACED_LEGEND, OFF_LEGEND) if legend in text} == legends
    marked, unmarked = (
        Image.open(io.BytesIO(matrix_png(matrix, shown))) for shown in ((pinned, off), plain[:2])
    )
    assert marked.height > unmarked.height  # by a line that says what the mark means


def test_markdown_holds_every_rule(lander_trees: tuple[PolicyTree, ...]) -> None:
    rules = rules_of(lander_trees)
    text = rules_to_markdown(rules)
    rows = [line for line in text.splitlines() if re.match(r"\| R\d", line)]
    assert len(rows) == len(rules)
    widest = max(rules.rules, key=lambda rule: rule.samples)
    assert rows[0].startswith(f"| {rules.name_of(widest)} | ")
    assert all(rules.source.features[one.feature].name in rows[0] for one in widest.bounds)


def test_markdown_escapes_names(lander_trees: tuple[PolicyTree, ...]) -> None:
    text = rules_to_markdown(hostile(rules_of(lander_trees)))
    columns = {
        len(re.findall(r"(?<!\\)\|", line)) for line in text.splitlines() if line.startswith("|")
    }
    assert columns == {6}
    assert "<img" not in text
    assert not re.search(r"(?<!\\)`", text)
    assert not re.search(":material/[a-z]+:", markdown_text(":material/home: x"))  # no icon
    # And what needs no escape has none.
    for plain in ("plain words 2.5 m/s", "pole angle (rad)"):
        assert markdown_text(plain) == plain
