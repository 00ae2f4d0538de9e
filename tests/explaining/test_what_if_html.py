"""What the page What if says of a state, as HTML."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from markupsafe import Markup

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.fields import Indicator
from sarl_core.explaining.html.what_if import changes_html, decision_html, misses_html, way_html
from sarl_core.explaining.html.what_if_bars import lines_html
from sarl_core.explaining.templates import style_sheet
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Condition, Rule, Thresholds
from sarl_core.mining.tree import Source
from sarl_core.shielding.neighbourhood import Neighbourhood, decision_changes
from sarl_core.shielding.sampling import Span
from sarl_core.shielding.shield import Shield

PLAIN = "sarl-plain"  # the ground that is none

FEATURES = (Feature("<b>angle", "rad"), Feature("speed", ""))
PUSH = LabelledDimension("push", ("left", "<i>right"))
BOX = DataBox((0.2, -1.0), (0.0, 0.0), (0.0, 0.0), (0.4, 1.0))


def rule(name, conditions, action, **kwargs):
    found = tuple(Condition(*one) for one in conditions)
    return Rule(name, 0, found, action, 0.1, 1.0, 1.0, 5, **kwargs)


RULES = RuleSet(
    (
        rule("0.1<", [(0, ">", 0.125), (0, "<=", 0.5)], 1, box=BOX),
        rule("0.2", [(0, "<=", -0.25), (1, ">", 0.5)], 0),
    ),
    (PUSH,),
    Source("", FEATURES, "none", 100, 1),
    Thresholds(0.0, 0.0),
)
SPANS = (Span(-0.1, 0.0, 1.0), Span(-1.0, 0.0, 1.0))
SPREADS = np.array([0.5, 1.0])


def element(found):
    """The HTML as elements; a name that was not escaped would break it, or be one."""
    root = ElementTree.fromstring(f"<root>{found}</root>")
    assert not {"i", "script"} & {one.tag for one in root.iter()}
    return root


def words(found):
    return " ".join("".join(element(found).find("div").itertext()).split())


def table(found):
    return [["".join(cell.itertext()) for cell in row] for row in element(found).iter("tr")]


def decided(state, action, outside="act", rule_set=RULES):
    values = np.array(state, dtype=np.float32)
    decision = Shield(rule_set, outside=outside).decide(values, action)
    at = decision.rules[0]
    found = None if at is None else rule_set.rules[at]
    return decision_html(decision, found, values, rule_set, outside)


@pytest.mark.parametrize(
    ("state", "action", "outside", "badges", "heading"),
    [
        (
            (0.25, 0.0),
            0,
            "act",
            ["Changed by the rules"],
            "The agent wants left; executed is <i>right",
        ),
        (
            (0.25, 0.0),
            1,
            "act",
            ["Allowed by the rules"],
            "<i>right is executed, as the agent wants",
        ),
        ((0.0, 0.0), 0, "act", ["No rule applies"], "Left is executed, as the agent wants"),
        (
            (0.45, 0.0),
            0,
            "act",
            ["Changed by the rules", "Outside the data"],
            "The agent wants left; executed is <i>right",
        ),
        (
            (0.45, 0.0),
            0,
            "abstain",
            ["Rule abstains", "Outside the data"],
            "Left is executed, as the agent wants",
        ),
    ],
)
def test_how_the_rules_met_the_action_and_what_is_executed(state, action, outside, badges, heading):
    root = element(decided(state, action, outside))
    shown = [one for one in root.iter("span") if "badge" in one.get("class")]
    assert [one.text for one in shown] == badges
    # Each ground is told apart: what the style sheet does not describe looks like plain text.
    looks = style_sheet()
    for one in shown:
        assert all(f".{name} {{" in looks for name in one.get("class").split() if name != PLAIN)
    (title,) = root.iter("h2")
    assert title.text == heading


def test_the_rule_stands_with_its_conditions_and_its_data():
    found = decided((0.25, 0.0), 0)
    assert table(found) == [
        ["Condition", "The state has", "Room to move"],
        ["0.125 < <b>angle ≤ 0.5 rad", "0.25 rad", "0.125 rad"],
    ]
    assert "R1. If the <b>angle is between 0.125 and 0.5 rad, then <i>right" in words(found)
    assert "The state lies inside this rule's data" in words(found)


def test_a_state_beyond_the_data_of_its_rule_says_where():
    assert (
        "Outside this rule's data: <b>angle 0.45 rad is above 0.4 rad, the largest that was seen; "
        "speed 7 is above 1, the largest that was seen." in words(decided((0.45, 7.0), 0))
    )
    assert "not kept where the data of this rule lay" in words(decided((-0.5, 1.0), 0))


def test_of_many_features_beyond_the_data_three_are_named():
    features = tuple(Feature(f"speed {index}", "") for index in range(5))
    box = DataBox((0.0,) * 5, (0.0,) * 5, (0.0,) * 5, (1.0,) * 5)
    many = RuleSet(
        (rule("0.1", [(0, ">", 0.5)], 1, box=box),),
        (PUSH,),
        Source("", features, "none", 100, 1),
        Thresholds(0.0, 0.0),
    )
    found = words(decided((2.0,) * 5, 0, rule_set=many))
    assert "speed 2 2 is above 1, the largest that was seen; and 2 features more." in found
    assert "speed 3" not in found


def test_without_a_rule_there_is_no_table():
    found = decided((0.0, 0.0), 0)
    assert not table(found)
    assert "the agent's action is passed on as it is" in words(found)


def changes_of(state):
    lines = Neighbourhood(Shield(RULES)).lines(np.array(state, dtype=np.float32), 0)
    return [
        change
        for line in lines
        for change in decision_changes(line, state[line.feature], SPREADS[line.feature])
        if change is not None
    ]


def test_the_least_change_is_a_sentence_and_a_row():
    found = changes_html(changes_of((0.0, 0.0)), SPANS, RULES)
    assert table(found) == [
        ["If", "Executed", "Rule", "In spreads", "From exactly", "Demonstrated"],
        ["<b>angle were 0.125 rad more", "<i>right", "R1", "0.25", "0.12500001 rad", "yes"],
    ]
    assert "Executed would be <i>right if <b>angle were 0.125 rad more." in words(found)
    helped = {one.text for one in element(found).iter("th") if one.get("title")}
    assert helped == {"In spreads", "From exactly", "Demonstrated"}
    short = (Span(-0.1, 0.0, 0.1), SPANS[1])
    assert table(changes_html(changes_of((0.0, 0.0)), short, RULES))[1][-1] == "no"


def test_where_no_change_does_anything_it_is_said():
    found = changes_html((), SPANS, RULES)
    assert not table(found)
    assert "No change of a single feature changes what is executed." in words(found)


def test_rules_that_nearly_apply_say_what_they_lack():
    near = Neighbourhood(Shield(RULES))
    state = np.zeros(2, dtype=np.float32)
    misses = [*near.near_misses(state, SPREADS), *near.near_misses(state, SPREADS, features=2)]
    found = misses_html(misses, RULES)
    assert table(found) == [
        ["Rule", "Says", "Would apply if", "In spreads", "In force", "From exactly"],
        ["R1", "<i>right", "<b>angle were 0.125 rad more", "0.25", "yes", "0.12500001 rad"],
        [
            "R2",
            "left",
            "<b>angle were 0.25 rad less and speed were 0.5 more",
            "1",
            "yes",
            "-0.25 rad, 0.50000006",
        ],
    ]
    none = misses_html([], RULES)
    assert not table(none)
    assert "No rule was found that would apply if one or two features were different." in words(
        none
    )


def test_a_miss_that_another_rule_would_still_come_before_is_not_in_force():
    first = rule("placed", [], 1, pinned=True)
    both = replace(RULES, rules=(first, RULES.rules[0]))
    misses = Neighbourhood(Shield(both)).near_misses(np.zeros(2, dtype=np.float32), SPREADS)
    assert [row[4] for row in table(misses_html(misses, both))] == ["In force", "no"]


def test_the_way_says_when_a_person_gave_the_rule_its_place():
    placed = "A person gave this rule its place"
    assert placed not in words(way_html(Markup("<p>queries</p>"), RULES.rules[0]))
    found = words(way_html(Markup("<p>queries</p>"), replace(RULES.rules[0], pinned=True)))
    assert placed in found
    assert "queries" in found
    assert placed not in words(way_html("", None))


def test_a_column_of_words_has_one_bar_with_a_part_for_each_word():
    features = (
        *(Feature(f"mode is {word}", "", Indicator("mode", word)) for word in ("a", "b", "c")),
        Feature("ground is firm", "", Indicator("ground", "firm", "soft")),
    )
    rule_set = replace(
        RULES,
        rules=(rule("0.1", [(1, ">", 0.5)], 1), rule("0.2", [(3, "<=", 0.5), (0, ">", 0.5)], 0)),
        source=replace(RULES.source, features=features),
    )
    state = (1.0, 0.0, 0.0, 1.0)
    lines = Neighbourhood(Shield(rule_set)).lines(np.array(state, dtype=np.float32), 1)
    picture = lines_html(lines, [(0.0, 1.0)] * 4, state, features, 0, rule_set)
    rows = ElementTree.fromstring(f"<root>{picture}</root>").findall(".//div[@class='row']")
    assert [row.find("div[@class='name']").text for row in rows] == ["mode", "ground"]
    said = [[part.get("title") for part in row.findall(".//span[@title]")] for row in rows]
    right, left = "<i>right", "left"
    assert said == [
        [
            f"mode is a: {right}, as the agent wants",
            f"mode is b: {right}, by a rule",
            f"mode is c: {right}, as the agent wants",
        ],
        [f"ground is soft: {left}, by a rule", f"ground is firm: {right}, as the agent wants"],
    ]
    assert rows[0].get("aria-label").startswith(f"mode is a: {right}")
    ends = [[one.text for one in row.findall("div/div/span")][-3:] for row in rows]
    assert ends[0] == ["a", "b", "c"]
    assert ends[1][-2:] == ["soft", "firm"]
