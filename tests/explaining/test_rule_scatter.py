from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from sarl_core import Demonstrations, PolicyTree, RuleSet, grow_policy_trees, mine_rules
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.figures.rules.measures import MEASURES, RuleMeasure, measures_of
from sarl_core.explaining.figures.rules.scatter import (
    RuleDot,
    colour_entries,
    dot_text,
    largest_dots,
    rule_dots,
    rule_scatter,
)
from sarl_core.mining.action_words import action_text
from sarl_core.mining.evidence import HeldOut
from sarl_core.mining.language import merged_length, sentence
from sarl_core.mining.rules import Rule

BY_TITLE = {measure.title: measure for measure in MEASURES}
SUPPORT, CONFIDENCE, LENGTH = (BY_TITLE[title] for title in ("Support", "Confidence", "Length"))


@pytest.fixture(scope="module")
def rules(lander_trees: tuple[PolicyTree, ...]) -> RuleSet:
    return mine_rules(lander_trees, supp_min=0.002, conf_min=0.9)


def dots_of(
    some: Sequence[Rule], rules: RuleSet, x: RuleMeasure, y: RuleMeasure
) -> tuple[RuleDot, ...]:
    features = rules.source.features
    across, upwards = ([measure.read(rule, features) for rule in some] for measure in (x, y))
    return rule_dots(some, across, upwards)


def plain_text(text: str) -> str:
    return text.replace("<br>", " ").replace("<b>", "").replace("</b>", "").replace("&lt;", "<")


def test_every_rule_stands_at_its_two_numbers(rules: RuleSet) -> None:
    for dot in dots_of(rules.rules, rules, SUPPORT, CONFIDENCE):
        assert {(rule.support, rule.confidence) for rule in dot.rules} == {(dot.x, dot.y)}
    dots = dots_of(rules.rules, rules, SUPPORT, CONFIDENCE)
    ids = [rule.id for dot in dots for rule in dot.rules]
    assert sorted(ids) == sorted(rule.id for rule in rules.rules)
    assert len({(dot.x, dot.y) for dot in dots}) == len(dots) < len(ids)


def test_equal_rules_are_one_dot_that_says_how_many_they_are(rules: RuleSet) -> None:
    dots = dots_of(rules.rules, rules, SUPPORT, CONFIDENCE)
    sizes = [len(dot.rules) for dot in dots]
    assert sizes == sorted(sizes, reverse=True)  # the small ones are drawn over the large ones
    assert sizes[0] > 1
    text = plain_text(dot_text(dots[0], rules))
    assert f"{sizes[0]} rules with these two numbers" in text
    for label in range(4):
        count = sum(rule.action == label for rule in dots[0].rules)
        if count:
            assert f"{count} {action_text(label, rules.actions[0])}" in text
    marks = rule_scatter(dots, rules, SUPPORT, CONFIDENCE).data[0]
    widest = {
        key: max(
            size
            for (id_,), size in zip(marks.customdata, marks.marker.size, strict=True)
            if id_ == key
        )
        for key in {id_ for (id_,) in marks.customdata}
    }
    assert widest[dots[0].rules[0].id] > widest[dots[-1].rules[0].id] >= 7


def test_a_dot_of_several_actions_has_a_ring_of_each(rules: RuleSet) -> None:
    dots = dots_of(rules.rules, rules, LENGTH, LENGTH)
    marks = rule_scatter(dots, rules, LENGTH, LENGTH).data[0]
    for dot in dots:
        mine = [at for at, (id_,) in enumerate(marks.customdata) if id_ == dot.rules[0].id]
        labels = sorted({rule.action for rule in dot.rules})
        assert [marks.marker.color[at] for at in mine] == [label_colour(one) for one in labels]
        sizes = [marks.marker.size[at] for at in mine]
        assert sizes == sorted(sizes, reverse=True)
        assert len(set(sizes)) == len(sizes)
        assert len({marks.hovertext[at] for at in mine}) == 1
    assert max(len({rule.action for rule in dot.rules}) for dot in dots) > 1


def test_clicks_go_through_the_rules_of_a_dot(rules: RuleSet) -> None:
    dot = RuleDot(0.0, 0.0, rules.rules[:3])
    ids = [rule.id for rule in dot.rules]
    assert dot.after("elsewhere").id == ids[0]
    assert [dot.after(one).id for one in ids] == [ids[1], ids[2], ids[0]]


def test_a_tooltip_has_the_sentence_and_all_numbers(rules: RuleSet) -> None:
    rule = rules.rules[0]
    text = dot_text(RuleDot(0.0, 0.0, (rule,)), rules)
    assert f"{rules.name_of(rule)}: {sentence(rule, rules)}" in plain_text(text)
    assert f"states {rule.samples:,}" in plain_text(text)
    merged = merged_length(rule, rules.source.features)
    assert f"length {rule.length} · merged length {merged}" in plain_text(text)
    assert max(map(len, text.split("<br>"))) < 60
    odd = replace(rules, actions=(replace(rules.actions[0], label_names=("<b>", *"bcd")),))
    assert "&lt;b&gt;" in dot_text(RuleDot(0.0, 0.0, (replace(rule, action=0),)), odd)


def test_the_chosen_rule_is_marked_wherever_it_stands_in_its_dot(rules: RuleSet) -> None:
    dots = dots_of(rules.rules, rules, SUPPORT, CONFIDENCE)
    last = dots[0].rules[-1]
    figure = rule_scatter(dots, rules, SUPPORT, CONFIDENCE, chosen=last.id)
    assert (figure.data[1].x[0], figure.data[1].y[0]) == (last.support, last.confidence)
    assert len(rule_scatter(dots, rules, SUPPORT, CONFIDENCE, chosen="none").data) == 1
    json.loads(figure.to_json())


def test_the_actions_of_several_dimensions_have_their_colours_and_forms(
    two_torques: Demonstrations,
) -> None:
    rules = mine_rules(two_torques, divider=3, supp_min=0.02, conf_min=0.7)
    dots = dots_of(rules.rules, rules, SUPPORT, CONFIDENCE)
    entries = colour_entries(dots, rules)
    assert [{colour for _, colour in some} for some in entries] == [
        {label_colour(rule.action) for rule in rules.of_dimension(number)} for number in (0, 1)
    ]
    assert [{name.split()[0] for name, _ in some} for some in entries] == [{"hip"}, {"knee"}]
    marks = rule_scatter(dots, rules, SUPPORT, CONFIDENCE).data[0]
    symbols = {
        (symbol, colour)
        for symbol, colour in zip(marks.marker.symbol, marks.marker.color, strict=True)
    }
    forms = ("circle", "diamond")
    assert symbols == {(forms[one.dimension], label_colour(one.action)) for one in rules.rules}


def test_measures_that_no_rule_has_are_not_offered_and_their_rules_not_drawn(
    rules: RuleSet,
) -> None:
    features = rules.source.features
    titles = [measure.title for measure in measures_of(rules.rules, features)]
    assert titles == [
        "Support",
        "Confidence",
        "Lift",
        "Joint support",
        "States",
        "Length",
        "Merged length",
    ]
    tried = replace(rules.rules[0], held_out=HeldOut(10, 9, 6, 0.91, 0.6, 0.98))
    few = replace(rules.rules[1], held_out=HeldOut(3, 3, 2, 1.0, None, None))
    unreached = replace(rules.rules[2], samples=0)
    some = (tried, few, unreached)
    assert [one.title for one in measures_of(some, features)] == list(BY_TITLE)
    held_out, low = BY_TITLE["Held out"], BY_TITLE["Lower bound"]
    assert [dot.rules for dot in dots_of(some, rules, held_out, low)] == [(tried,)]
    assert {dot.rules for dot in dots_of(some, rules, held_out, SUPPORT)} == {(tried,), (few,)}
    assert math.isnan(CONFIDENCE.read(unreached, features))
    assert CONFIDENCE.text(math.nan) == "–"


def ticks(rules: RuleSet, x: RuleMeasure, values: list[float]) -> tuple[str | None, list[str]]:
    dots = [RuleDot(value, 1.0, rules.rules[:1]) for value in values]
    axis = rule_scatter(dots, rules, x, CONFIDENCE).layout.xaxis
    assert len(axis.tickvals) == len(axis.ticktext)
    return axis.type, list(axis.ticktext)


def test_axes_have_round_ticks_by_powers_of_ten_where_numbers_lie_far_apart(
    rules: RuleSet,
) -> None:
    assert ticks(rules, SUPPORT, [0.0001, 0.27]) == ("log", ["0.01 %", "0.1 %", "1 %", "10 %"])
    assert ticks(rules, SUPPORT, [0.008, 0.3]) == ("log", ["1 %", "3 %", "10 %", "30 %"])
    assert ticks(rules, SUPPORT, [0.0, 0.3])[0] is None  # nothing is no power of ten
    assert ticks(rules, SUPPORT, [0.1, 0.3]) == (
        None,
        ["10 %", "15 %", "20 %", "25 %", "30 %"],
    )
    assert ticks(rules, BY_TITLE["States"], [7.0, 9000.0])[1] == ["10", "100", "1,000"]
    # What is nearly always right, and nearly never, is no matter of powers.
    assert ticks(rules, BY_TITLE["Lower bound"], [0.01, 0.9])[0] is None
    assert ticks(rules, LENGTH, [2.0, 4.0]) == (None, ["2", "3", "4"])
    assert ticks(rules, CONFIDENCE, [1.0, 1.0]) == (None, ["100 %"])


def test_of_too_many_dots_those_of_the_most_states_are_drawn(rules: RuleSet) -> None:
    dots = dots_of(rules.rules, rules, SUPPORT, CONFIDENCE)
    assert largest_dots(dots) == dots
    some = largest_dots(dots, 5)
    most = sorted((dot.rules[0].samples for dot in dots), reverse=True)[:5]
    assert sorted((dot.rules[0].samples for dot in some), reverse=True) == most
    assert [dot for dot in dots if dot in some] == list(some)


def test_one_rule_and_none_are_drawn(lander_like: Demonstrations) -> None:
    always = mine_rules(grow_policy_trees(lander_like), supp_min=0.5, conf_min=0.1)
    dots = dots_of(always.rules, always, SUPPORT, CONFIDENCE)
    figure = rule_scatter(dots, always, SUPPORT, CONFIDENCE, chosen=always.rules[0].id)
    assert len(figure.data) == 2
    assert not rule_scatter([], always, SUPPORT, CONFIDENCE).data[0].x
