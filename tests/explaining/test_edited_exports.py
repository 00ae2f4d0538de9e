"""Rule sets that a person edited, carried away: their rules overlap, and some are off."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace

import pytest

from sarl_core import PolicyTree, RuleSet, mine_rules
from sarl_core.explaining.exports.export import rules_to_csv
from sarl_core.explaining.exports.markdown import rules_to_markdown
from sarl_core.explaining.exports.rule_matrix_png import matrix_png
from sarl_core.explaining.html.rule_matrix import matrix_document, matrix_html, rule_matrix
from sarl_core.mining.evidence import HeldOut
from sarl_core.mining.rules import Rule


@pytest.fixture(scope="module")
def mined(lander_trees: tuple[PolicyTree, ...]) -> RuleSet:
    return mine_rules(lander_trees, supp_min=0.02, conf_min=0.8)


@pytest.fixture(scope="module")
def edited(mined: RuleSet) -> RuleSet:
    """One rule by hand that applies everywhere, the least general one pinned, another off."""
    by_samples = sorted(mined.rules, key=lambda rule: rule.samples)
    hand = Rule("hand", 0, (), 1, 1.0, 0.25, 1.0, 2000, origin="manual")
    pinned = replace(
        by_samples[0], id="pinned", pinned=True, held_out=HeldOut(40, 31, 6, 0.8, 0.5, 0.9)
    )
    off = replace(by_samples[-1], id="off", enabled=False)
    return replace(mined, rules=(pinned, hand, off, *by_samples[1:-1]))


def test_counts_that_overlap_are_no_share_of_the_states(mined: RuleSet, edited: RuleSet) -> None:
    for write in (rules_to_markdown, RuleSet.to_text):
        assert "of the states and are right in" in write(mined)
        told = write(edited)
        assert "of the states and are right in" not in told
        assert "edited by hand: 1 off, 1 pinned, 1 added" in told
        assert "by hand" not in write(mined)


def test_text_keeps_the_order_of_placed_rules_and_marks_those_off(edited: RuleSet) -> None:
    lines = re.findall(r"^ +R\d+\. .*", edited.to_text(), flags=re.M)
    assert lines[0].endswith("(pinned)")
    assert "Always" in lines[1]
    assert lines[1].endswith("(by hand)")
    assert lines[2].endswith("(off)")
    assert not any(line.endswith(")") for line in lines[3:])


def test_csv_says_what_was_pinned_and_held_out(edited: RuleSet) -> None:
    rows = list(csv.DictReader(io.StringIO(rules_to_csv(edited))))
    held = [f"held_out_{name}" for name in HeldOut._fields]
    assert [rows[0][name] for name in ("id", "pinned", *held)] == (
        ["pinned", "yes", "40", "31", "6", "0.8", "0.5", "0.9"]
    )
    assert [rows[1][name] for name in ("id", "pinned", *held)] == ["hand", "no", *[""] * 6]
    few = replace(edited.rules[0], held_out=HeldOut(4, 3, 2, 0.75, None, None))
    rows = list(csv.DictReader(io.StringIO(rules_to_csv(replace(edited, rules=(few,))))))
    assert [rows[0][name] for name in held] == ["4", "3", "2", "0.75", "", ""]


def test_markdown_counts_held_out_episodes(edited: RuleSet) -> None:
    assert "| 80 % in 6 episodes (50 to 90 %) |" in rules_to_markdown(edited)
    few = replace(edited.rules[0], held_out=HeldOut(4, 3, 2, 0.75, None, None))
    told = rules_to_markdown(replace(edited, rules=(few,)))
    assert "| 75 % in 2 episodes (too few episodes) |" in told


def test_the_matrix_shows_placed_rules_first_with_a_mark(mined: RuleSet, edited: RuleSet) -> None:
    matrix = rule_matrix(edited)
    assert [rule.id for rule in matrix.rules[:2]] == ["pinned", "hand"]
    assert sorted(rule.id for rule in matrix.rules) == sorted(rule.id for rule in edited.rules)
    html = matrix_html(matrix, matrix.rules)
    marked = re.findall(r'title="(R\d+), (pinned|by hand)"', html)
    assert marked == [("R1", "pinned"), ("R2", "by hand")]
    assert html.count("* ") == 3  # with the legend
    assert "Expert agrees" in html
    assert ">Right<" not in html
    assert "* written by hand or pinned" in matrix_document(matrix)
    assert "* written" not in matrix_document(rule_matrix(mined))
    off = replace(edited.rules[0], enabled=False)
    assert matrix_png(matrix, edited.rules[:1]) != matrix_png(matrix, (off,))
    # The mark is drawn: the same rules without it make another picture.
    bare = replace(edited.rules[0], pinned=False)
    assert matrix_png(matrix, edited.rules[:1]) != matrix_png(matrix, (bare,))
