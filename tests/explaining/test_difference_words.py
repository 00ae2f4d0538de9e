"""Edits and differences in words, tables and a table in colour."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from sarl_core import RuleSet, mine_rules
from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.explaining.colours import LAYER_SCALE
from sarl_core.explaining.html.confusion import confusion_html
from sarl_core.explaining.tables.difference import example_rows, rule_rows
from sarl_core.explaining.words.difference import (
    decided_text,
    difference_document,
    kinds_text,
    rows_text,
    said_text,
    what_text,
)
from sarl_core.explaining.words.edits import conflict_text, edit_text, edits_change_text, state_text
from sarl_core.mining.applications import labels_of
from sarl_core.mining.editing.edits import Add, Change, Move, Pin, Remove, Switch, Unpin, apply
from sarl_core.mining.editing.manual_rules import Ask, manual_rule
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_order import fitting
from sarl_core.mining.rules import Condition, Rule, Thresholds
from sarl_core.mining.tree import Source
from sarl_core.shielding.decisions import ground_of
from sarl_core.shielding.disagreement import disagreement
from sarl_core.shielding.effects import change, verdicts

ACTIONS = (LabelledDimension("push", ("left", "right")),)
STATES = np.linspace(0.05, 0.95, 10, dtype=np.float32).reshape(-1, 1)
SHOWN = Demonstrations(
    STATES,
    (STATES[:, 0] > 0.5).astype(int),
    np.zeros(10, dtype=int),
    feature_names=("angle",),
    feature_units=("rad",),
    label_names=(("left", "right"),),
    action_names=("push",),
    env_id="Here-v0",
)
SOURCE = Source("Here-v0", (Feature("angle", "rad"),), SHOWN.digest, 10, 1)
LOW = Rule("0.1", 0, (Condition(0, "<=", 0.5),), 0, 0.5, 1.0, 2.0, 5)
RULES = RuleSet((LOW,), ACTIONS, SOURCE, Thresholds(0.1, 0.9))
HAND = manual_rule(
    RULES, [Ask("angle", ">", 0.3)], rule_id="manual.1", action=1, demonstrations=SHOWN
)


@pytest.mark.parametrize(
    ("edit", "text"),
    [
        (Switch("0.1", False), "switch off R1"),
        (Switch("0.1", True), "switch on R1"),
        (Pin(LOW), "pin R1"),
        (Unpin("0.1"), "unpin R1"),
        (Move("manual.1", True), "move a rule up"),
        (Move("manual.1", False), "move a rule down"),
        (Remove("manual.1"), "remove a rule"),
        (Add(HAND), "add a rule (if the angle is above 0.3 rad, then right)"),
        (Change(HAND), "change a rule (if the angle is above 0.3 rad, then right)"),
    ],
)
def test_an_edit_in_words(edit, text):
    assert edit_text(edit, RULES) == text


def test_what_became_of_a_rule():
    told = [LOW, replace(LOW, pinned=True), HAND, replace(HAND, enabled=False)]
    assert [state_text(rule) for rule in told] == ["mined", "pinned", "manual", "manual, off"]


def test_a_change_and_a_conflict_in_words():
    ground, expert = ground_of(RULES, STATES), labels_of(RULES, SHOWN)
    before = verdicts(ground, RULES, expert)
    after = verdicts(ground, apply(RULES, [Add(HAND)]), expert)
    # Above 0.3 are 7 states: 5 had no rule, 2 (0.35 and 0.45) the other one.
    assert edits_change_text(change(before, after), before, after, states="state") == (
        "7 of 10 states are decided differently (5 had no rule and now have one). Coverage rises "
        "from 50 % to 100 % and fidelity falls from 100 % to 80 %."
    )
    assert edits_change_text(change(before, before), before, before, states="state") == (
        "None of 10 states is decided differently."
    )
    # Shares that look the same in whole percents are told with more digits.
    many = replace(after, labels=np.r_[np.ones((399, 1), int), [[-1]] * 601])
    more = replace(many, labels=np.r_[np.ones((400, 1), int), [[-1]] * 600])
    assert "Coverage rises from 39.9 % to 40.0 %." in edits_change_text(
        change(many, more), many, more, states="state"
    )
    many = replace(after, labels=np.r_[np.ones((39_999, 1), int), [[-1]] * 60_001])
    more = replace(many, labels=np.r_[np.ones((40_000, 1), int), [[-1]] * 60_000])
    assert "Coverage rises by less than 0.01 points, from 40.00 %." in edits_change_text(
        change(many, more), many, more, states="state"
    )
    assert conflict_text(after.conflicts[0], after.rule_set, states="state") == (
        "R2 (right) takes 2 states from R1 (left); the expert did as R2 says in 0 of them, as R1 "
        "says in 2."
    )
    unknown = verdicts(ground, after.rule_set)
    assert conflict_text(unknown.conflicts[0], unknown.rule_set, states="state") == (
        "R2 (right) takes 2 states from R1 (left)."
    )


EDITED = apply(RULES, [Add(HAND), Switch("0.1", False)])
FOUND = disagreement(RULES, EDITED, STATES)


def test_a_difference_in_words():
    assert rows_text(FOUND) == "1 rule added, none removed, 1 rule changed, none the same."
    assert (
        decided_text(FOUND, states="state") == "The two decide 10 of 10 states (100 %) differently."
    )
    assert kinds_text(FOUND, 0, ("A", "B")) == (
        "2 where both have a rule and they say different things, 3 where only A has a rule, 5 "
        "where only B has a rule"
    )
    same = disagreement(RULES, RULES, STATES)
    assert decided_text(same, states="state") == "The two decide none of 10 states differently."
    assert kinds_text(same, 0, ("A", "B")) == "none"
    assert [said_text(label, ACTIONS[0]) for label in (0, 1, 2, -1)] == [
        "left",
        "right",
        "no rule",
        "no rule",
    ]


def test_what_looks_the_same_is_told_in_full():
    near = replace(LOW, conditions=(Condition(0, "<=", 0.50000001),))
    found = disagreement(RULES, replace(RULES, rules=(near,)), STATES)
    assert rule_rows(found)["Change"] == ["was angle <= 0.5"]
    assert what_text(found.difference.changed[0], found) == (
        "angle <= 0.50000001 instead of angle <= 0.5"
    )
    turned = disagreement(RULES, replace(RULES, rules=(replace(LOW, action=1),)), STATES)
    assert rule_rows(turned)["Change"] == ["said left"]
    assert what_text(turned.difference.changed[0], turned) == "right instead of left"


def test_a_document_and_tables():
    document = difference_document(FOUND, names=("a", "b"), states_from="here")
    assert [rule["id"] for rule in document["added"]] == ["manual.1"]
    assert document["changed"][0]["text"] == "switched off"
    assert document["states"] == {"from": "here", "count": 10, "different": 10, "share": 1.0}
    assert document["dimensions"][0]["confusion"] == [[0, 2, 3], [0, 0, 0], [0, 5, 0]]
    rows = rule_rows(FOUND)
    assert rows["What"] == ["changed", "added"]
    assert rows["Rule"] == ["R1", "R2"]
    assert rule_rows(FOUND, ("added",))["When"] == ["angle > 0.3 rad"]
    examples = example_rows(FOUND, 0, STATES, names=("a", "b"), demonstrations=SHOWN, most=4)
    assert examples["Step"] == [0, 3, 6, 9]
    assert examples["A says"] == ["left", "left", "no rule", "no rule"]
    assert examples["B says"] == ["no rule", "right", "right", "right"]
    assert examples["Rule, b"] == ["–", "R2", "R2", "R2"]
    assert examples["Expert did"] == ["left", "left", "right", "right"]
    assert "Expert did" not in example_rows(FOUND, 0, STATES, names=("a", "b"))


def cells(table):
    """What stands in the rows of a table in HTML, and the titles of its cells."""
    document = ElementTree.fromstring(table[table.index("<figure") :])
    rows = document.findall(".//tbody/tr")
    found = [[cell for cell in row if cell.tag == "td"] for row in rows]
    return document, [[cell.text or "" for cell in row] for row in found], found


def test_the_table_shows_every_cell_and_no_markup_of_a_file():
    odd = (LabelledDimension("push", ("<b>left</b>", "right")),)
    found = disagreement(replace(RULES, actions=odd), replace(EDITED, actions=odd), STATES)
    names = ('<i>"a"</i>', "b & c")
    table = confusion_html(found, 0, names=names)
    document, texts, rows = cells(table)
    assert texts == [["", "2", "3"], ["", "", ""], ["", "5", ""]]
    assert rows[0][1].get("title") == '<i>"a"</i>: <b>left</b>; b & c: right; 2 states'
    assert rows[2][1].get("title") == '<i>"a"</i>: no rule; b & c: right; 5 states'
    heads = ["".join(head.itertext()) for head in document.iter("th")]
    assert heads == [
        "b & c says",
        *("<b>left</b>", "right", "no rule"),
        '<i>"a"</i> says',
        *("<b>left</b>", "right", "no rule"),
    ]
    for tag in ("b", "i"):
        assert document.find(f".//{tag}") is None
    told = kinds_text(found, 0, (f"the first ({names[0]})", f"the second ({names[1]})"))
    assert told in "".join(document.find("figcaption").itertext())
    assert document.find(".//table").get("aria-label") == (
        'What <i>"a"</i> says against what b & c says, in numbers of states'
    )


def test_the_table_tells_agreement_from_disagreement_by_colour():
    half = apply(RULES, [Add(HAND)])
    _, texts, rows = cells(confusion_html(disagreement(RULES, half, STATES), 0, names=("a", "b")))
    assert texts == [["3", "2", ""], ["", "", ""], ["", "5", ""]]
    for at, row in enumerate(rows):
        assert [cell.get("class") == "same" for cell in row] == [at == 0, at == 1, at == 2]
        assert row[at].get("style") is None
    few, many = rows[0][1].get("style"), rows[2][1].get("style")
    assert few != many  # the more states, the darker
    assert f"background:{LAYER_SCALE[-1][1]}" in many
    assert rows[1][0].get("style") is None
    same = confusion_html(disagreement(RULES, RULES, STATES), 0, names=("a", "b"))
    assert "Differently" not in same
    assert "Both say the same everywhere. Grey: both say the same." in same
    assert cells(same)[1] == [["5", "", ""], ["", "", ""], ["", "", "5"]]


def test_too_many_choices_for_a_table_are_a_sentence():
    same = disagreement(RULES, RULES, STATES)
    text = confusion_html(replace(same, choices=(((0, 1),) * 13,)), 0, names=("a", "b"))
    assert ">Both say the same everywhere. What the rules leave in these states are 13" in text
    assert "<table" not in text


def test_demonstrations_fit_rules_of_their_features_and_actions():
    mined = mine_rules(SHOWN, supp_min=0.0, conf_min=1.0)
    assert fitting(mined, SHOWN) is SHOWN
    renamed = replace(SOURCE, features=(Feature("tilt", ""),))
    assert fitting(replace(RULES, source=renamed), SHOWN)
    assert fitting(replace(RULES, source=replace(renamed, env_id="")), SHOWN) is None
    assert fitting(replace(RULES, actions=ACTIONS * 2), SHOWN) is None
    torque = (LabelledDimension.of_edges("push", (-1, 0, 1)),)
    assert fitting(replace(RULES, actions=torque), SHOWN) is None
