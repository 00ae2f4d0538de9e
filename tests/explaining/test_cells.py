from __future__ import annotations

import csv
import io
from dataclasses import replace

import pandas as pd
import pytest

from sarl_core import PolicyTree, mine_rules
from sarl_core.explaining.exports.export import rules_to_csv
from sarl_core.explaining.tables.spreadsheet_cells import safe_cell, safe_cells


@pytest.mark.parametrize("text", ["-1", "+2.5", "-1e-05", "-1 to 0.5", "-2 to -1", "push left", ""])
def test_numbers_intervals_and_words_stay(text: str) -> None:
    assert safe_cell(text) == text


@pytest.mark.parametrize(
    "text", ["=1", "-1+cmd|' /C calc'!A0", "+1-2", "@SUM(A1)", "-1 to 2+3", "-", "\t=1", "-1\n"]
)
def test_whatever_else_looks_like_a_formula_is_text(text: str) -> None:
    assert safe_cell(text) == f"'{text}"


def test_a_table_keeps_its_numbers_and_loses_its_formulas() -> None:
    frame = pd.DataFrame({"=head": ["=1", "up"], "low": [-1.0, 2.0], "on": [True, False]})
    found = safe_cells(frame)
    assert list(found.columns) == ["'=head", "low", "on"]
    assert found["'=head"].tolist() == ["'=1", "up"]
    assert found["low"].tolist() == [-1.0, 2.0]
    assert found.to_csv(index=False).splitlines()[1] == "'=1,-1.0,True"
    assert list(frame.columns) == ["=head", "low", "on"]


def test_no_id_of_a_rule_is_a_formula(lander_trees: tuple[PolicyTree, ...]) -> None:
    rules = mine_rules(lander_trees, supp_min=0.1, conf_min=0.5)
    harmful = replace(rules, rules=(replace(rules.rules[0], id="=cmd|' /C calc'!A0"),))
    (row,) = csv.DictReader(io.StringIO(rules_to_csv(harmful)))
    assert row["id"].startswith("'=")


def test_categories_are_cells_too():
    words = pd.Series(["=1+1", "'=1+1", "brake", "=1+1"], dtype="category")
    cells = safe_cells(
        pd.DataFrame({"word": words, "code": pd.Series([3, 1, 3, 1]).astype("category")})
    )
    assert cells["word"].tolist() == ["'=1+1", "'=1+1", "brake", "'=1+1"]
    assert cells["code"].tolist() == [3, 1, 3, 1]
