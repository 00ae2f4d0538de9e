from __future__ import annotations

import csv
import io
import re
from dataclasses import replace

import numpy as np
import pytest

from sarl_core import Demonstrations, PolicyTree, RuleSet, mine_rules
from sarl_core.explaining.exports import export
from sarl_core.explaining.exports.export import CSV_COLUMNS, decisions_changed, rules_to_csv
from sarl_core.mining.rules import Condition


@pytest.fixture(scope="module")
def unfiltered(lander_trees: tuple[PolicyTree, ...]) -> RuleSet:
    return mine_rules(lander_trees, supp_min=0.0, conf_min=1.0)


def rows_of(rule_set: RuleSet) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(rules_to_csv(rule_set))))


def test_csv_holds_every_rule_at_full_precision(
    unfiltered: RuleSet, lander_like: Demonstrations
) -> None:
    rows = rows_of(unfiltered)
    assert len(rows) == unfiltered.rule_count > 100
    names = [feature.name for feature in lander_like.features]
    for row, rule in zip(rows, unfiltered.rules, strict=True):
        assert tuple(row) == CSV_COLUMNS
        read = []
        for part in row["conditions"].split(" and "):
            name, op, threshold = part.rsplit(" ", 2)
            assert op in ("<=", ">")
            read.append((names.index(name), op, float(threshold)))
        assert read == [tuple(condition) for condition in rule.conditions]
        assert float(row["confidence"]) == rule.confidence
        assert int(row["samples"]) == rule.samples


def test_csv_conditions_select_the_rows_of_the_rule(
    unfiltered: RuleSet, lander_like: Demonstrations
) -> None:
    rule = max(unfiltered.rules, key=lambda one: one.samples)
    assert int(np.count_nonzero(rule.applies(lander_like.observations))) == rule.samples


def test_no_cell_is_a_formula(unfiltered: RuleSet) -> None:
    features = tuple(
        replace(feature, name="=cmd()" if index == 0 else feature.name)
        for index, feature in enumerate(unfiltered.source.features)
    )
    first = replace(unfiltered.rules[0], conditions=(Condition(0, ">", 1.0),))
    harmful = replace(
        unfiltered, rules=(first,), source=replace(unfiltered.source, features=features)
    )
    assert rows_of(harmful)[0]["conditions"] == "'=cmd() > 1.0"


def test_text_numbers_every_rule_and_promises_nothing(unfiltered: RuleSet) -> None:
    text = unfiltered.to_text()
    assert f"{unfiltered.rule_count:,} rules" in text
    names = re.findall(r"^ +(R\d+)\. If ", text, flags=re.M)
    assert set(names) == {f"R{place}" for place in range(1, unfiltered.rule_count + 1)}
    assert len(names) == unfiltered.rule_count
    assert "guarantee nothing" in text


def test_an_empty_rule_set_is_a_header_and_a_sentence(
    lander_trees: tuple[PolicyTree, ...],
) -> None:
    empty = mine_rules(lander_trees, supp_min=1.0, conf_min=1.0)
    assert rules_to_csv(empty) == ",".join(CSV_COLUMNS) + "\n"
    assert "0 rules" in empty.to_text()


def test_text_says_divider_lift_and_depth(two_torques: Demonstrations) -> None:
    rules = mine_rules(
        two_torques, supp_min=0.01, conf_min=0.7, lift_min=1.1, max_depth=4, divider=3
    )
    text = rules.to_text()
    assert "lift at least 1.1, at most 4 conditions, divider 3" in text
    assert "\nhip: " in text
    assert "\nknee: " in text


def test_changed_decisions_are_counted_over_all_states_piece_by_piece(
    unfiltered: RuleSet, lander_like: Demonstrations, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = max(unfiltered.rules, key=lambda one: one.samples)
    fewer = replace(
        unfiltered,
        rules=tuple(replace(rule, enabled=rule is not gone) for rule in unfiltered.rules),
    )
    monkeypatch.setattr(export, "_AT_ONCE", len(lander_like) // 3)  # and a few are left
    assert decisions_changed(unfiltered, fewer, lander_like) == gone.samples
    assert decisions_changed(unfiltered, unfiltered, lander_like) == 0
