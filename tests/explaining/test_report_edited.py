"""Reports of rule sets that a person edited: what they say is true of these sets."""

from __future__ import annotations

import dataclasses
import html
import re
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, RuleSet, load_demonstrations, mine_rules
from sarl_core.explaining.report.certificates import certificates_part
from sarl_core.explaining.report.decisions import decisions
from sarl_core.explaining.report.gaps import Doubt, UncoveredSummary
from sarl_core.explaining.report.report import make_report
from sarl_core.explaining.report.rule_set_card import ReportedEpisodes
from sarl_core.explaining.report.slides import slides_document
from sarl_core.explaining.report.tally import tally
from sarl_core.mining.rules import Condition, Rule
from sarl_core.mining.validation.holding_out import hold_out, with_held_out

DATA = Path(__file__).parents[2] / "data"
PLAIN = {"frames": 0}


@pytest.fixture(scope="module")
def cart() -> Demonstrations:
    return load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")


@pytest.fixture(scope="module")
def rules(cart: Demonstrations) -> RuleSet:
    return mine_rules(cart, supp_min=0.005, conf_min=0.95)


def edited(rules: RuleSet) -> RuleSet:
    """The most general rule off, one by hand that takes half of the states from the others."""
    off = max(rules.rules, key=lambda rule: rule.samples)
    hand = Rule("hand", 0, (Condition(3, ">", 0.0),), 1, 0.0, 0.0, 0.0, 0, origin="manual")
    others = [dataclasses.replace(rule, enabled=rule is not off) for rule in rules.rules]
    return dataclasses.replace(rules, rules=(hand, *others))


def words_of(text: str) -> str:
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]*>", " ", text)))


def test_a_plain_set_is_told_as_ever(cart: Demonstrations, rules: RuleSet) -> None:
    told = words_of(make_report(rules, cart, **PLAIN).html)
    assert "at most one rule for each action applies" in told
    assert "were then" not in told
    assert "it decides" not in told
    assert f"{len(rules)} rules" in told


def test_an_edited_set_is_told_as_it_is(cart: Demonstrations, rules: RuleSet) -> None:
    changed = edited(rules)
    told = words_of(make_report(changed, cart, **PLAIN).html)
    assert "at most one rule for each action" not in told
    assert "Several may apply; the first, in this order, decides" in told
    assert "1 rule was then switched off, 1 written by hand." in told
    assert re.search(rf"\b{len(rules)} rules ", told)  # one off, one added
    assert "before the changes by hand" in told


def test_each_rule_says_how_many_states_it_decides(cart: Demonstrations, rules: RuleSet) -> None:
    changed = edited(rules)
    told = words_of(make_report(changed, cart, **PLAIN).html)
    column = cart.observations[:, 3]
    taken = column > 0
    assert f"({int(taken.sum()):,})" in told
    for rule in changed.rules[1:]:
        holds = np.ones(len(cart), dtype=bool)
        for feature, op, threshold in rule.conditions:
            below = cart.observations[:, feature].astype(np.float64) <= threshold
            holds &= below if op == "<=" else ~below
        left = int((holds & ~taken).sum()) if rule.enabled else 0
        if left != rule.samples:
            amount = f"{left:,}" if left else "none"
            assert f"({rule.samples:,} states); it decides {amount} of them." in told
    right = int((cart.actions.reshape(-1)[taken] == 1).sum())
    assert f"{right:,} of {int(taken.sum()):,} states" in told


def test_the_states_of_a_rule_that_decides_none_are_shown(
    cart: Demonstrations, rules: RuleSet
) -> None:
    def bars(rule_set: RuleSet) -> list[list[str]]:
        cards = re.findall(
            r"<article.*?</article>", make_report(rule_set, cart, **PLAIN).html, flags=re.S
        )
        return [re.findall(r'<td class="wide">.*?</td>', card) for card in cards]

    off = tuple(dataclasses.replace(rule, enabled=False) for rule in rules.rules)
    assert bars(dataclasses.replace(rules, rules=off)) == bars(rules) != []


def test_the_headline_counts_rules_that_are_on(cart: Demonstrations, rules: RuleSet) -> None:
    only = tuple(
        dataclasses.replace(rule, enabled=index == 0) for index, rule in enumerate(rules.rules)
    )
    off = dataclasses.replace(rules, rules=only)
    told = words_of(make_report(off, cart, **PLAIN).html)
    merged = len({condition.feature for condition in only[0].conditions})
    assert re.search(rf"\b1 rule {merged}\.0 conditions a rule", told)
    assert "A rule that is switched off decides nothing." in told
    assert f"{len(only) - 1} rules were then switched off." in told


def test_where_every_rule_is_off_that_is_what_is_said(cart: Demonstrations, rules: RuleSet) -> None:
    off = tuple(dataclasses.replace(rule, enabled=False) for rule in rules.rules)
    told = words_of(make_report(dataclasses.replace(rules, rules=off), cart, **PLAIN).html)
    assert "None of these is in force, so every action passes." in told
    assert "All 5 rules are switched off." in told
    assert "Is it right that no rule is in force?" in told
    for text in ("no rule looks at", "leave the other states alone", "they are right in"):
        assert text not in told


def test_a_question_counts_every_rule_that_deserves_a_second_look(
    cart: Demonstrations, rules: RuleSet
) -> None:
    doubt = Doubt("30 rules are in doubt.", tuple(f"R{place}" for place in range(1, 25)), 6)
    questions = decisions(
        (),
        ReportedEpisodes(),
        certified=certificates_part(rules, (), None),
        gaps=UncoveredSummary((), "", (doubt,), (), with_boxes=False),
        counts=tally(rules, cart),
        sign_off=None,
    )
    assert "30 rules are in doubt (R1, R2, R3, R4 and 26 others)." in [
        one.reason for one in questions
    ]


def test_rules_tried_on_episodes_kept_aside_stay_so_when_edited(cart: Demonstrations) -> None:
    split = hold_out(cart, 0.3, seed=1)
    found = with_held_out(mine_rules(split.mined, supp_min=0.005, conf_min=0.95), split.held_out)
    assert tally(edited(found), cart).split
    told = words_of(make_report(edited(found), cart, **PLAIN).html)
    assert "made from other data" not in told


def test_what_an_interval_counts_is_said(cart: Demonstrations, rules: RuleSet) -> None:
    told = words_of(make_report(rules, cart, **PLAIN).html)
    assert "each of them counts once, however long it is" in told
    assert "Wilson" not in told


def test_the_first_page_begins_with_what_applies_most_often_whoever_placed_it(
    cart: Demonstrations, rules: RuleSet
) -> None:
    seldom = min(rules.rules, key=lambda rule: rule.support)
    pinned = dataclasses.replace(seldom, pinned=True)
    others = (rule for rule in edited(rules).rules if rule.id != seldom.id)
    placed = dataclasses.replace(rules, rules=(pinned, *others))
    report = make_report(placed, cart, in_full=2, **PLAIN)
    names = [rule.name for rule in report.parts["rules"].first]
    hand, *by_support = sorted(
        (rule for rule in placed.rules if rule.enabled),
        key=lambda rule: rule.samples or len(cart),
        reverse=True,
    )
    assert hand.origin == "manual"  # it is counted on half of the states
    assert names[: len(by_support) + 1] == [placed.name_of(one) for one in (hand, *by_support)]
    assert placed.name_of(seldom) == names[-2]
    told = words_of(report.html)
    assert "2 are shown in full, first those that a person placed and then" in told
    assert "apply most often in the states" in told


@pytest.mark.parametrize("in_full", [0, 1, 60])
def test_slides_list_the_rules_whatever_is_shown_in_full(
    cart: Demonstrations, rules: RuleSet, in_full: int
) -> None:
    report = make_report(rules, cart, in_full=in_full, **PLAIN)
    slide = words_of(report.slides.split("<section")[3])
    assert "There is none" not in slide
    assert "other" not in slide
    assert all(f" {rules.name_of(rule)} " in slide for rule in rules.rules)
    many = dataclasses.replace(rules, rules=rules.rules * 2)
    parts = report.parts | {"rules": dataclasses.replace(report.parts["rules"], count=len(many))}
    slide = words_of(slides_document(parts).split("<section")[3])
    assert f"The other {len(many) - len(rules)} rules stand in the report." in slide
    assert ("1 rule follows on a slide of its own." in slide) == (in_full == 1)
