"""Several conditions on one column of words: the sentence says the least that is true."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.fields import Indicator
from sarl_core.explaining.exports.export import rules_to_csv
from sarl_core.explaining.exports.markdown import rules_to_markdown
from sarl_core.explaining.html.rule_card import rule_card
from sarl_core.explaining.html.rule_matrix import rule_matrix
from sarl_core.explaining.words.what_if import condition_views
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import conditions_text, least_bounds, merged_length, sentence
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import FILTERED, Condition, Rule
from sarl_core.mining.tree import Source

MODES = ("heavy", "light", "mixed", "none")
FEATURES = (
    *(Feature(f"mode is {word}", "", Indicator("mode", word)) for word in MODES),
    Feature("ground is firm", "", Indicator("ground", "firm", "soft")),
    Feature("wind", "m/s"),
)
WIND = Condition(5, ">", 9.0)


def rules_of(*conditions: Condition, features: tuple[Feature, ...] = FEATURES) -> RuleSet:
    rule = Rule("0.3", 0, conditions, 1, 0.1, 0.97, 1.9, 412)
    source = Source("", features, "d" * 32, 4000, 10)
    return RuleSet((rule,), (LabelledDimension("lift", ("hold", "lower")),), source, FILTERED)


def not_(*words: str) -> tuple[Condition, ...]:
    return tuple(Condition(MODES.index(word), "<=", 0.5) for word in words)


def is_(word: str) -> Condition:
    return Condition(MODES.index(word), ">", 0.5)


@pytest.mark.parametrize(
    ("conditions", "said", "length"),
    [
        (not_("light"), "mode is not light", 1),
        ((*not_("light"), is_("heavy")), "mode is heavy", 1),
        ((is_("heavy"), *not_("light", "mixed")), "mode is heavy", 1),
        (not_("light", "mixed"), "mode is neither light nor mixed", 1),
        (not_("light", "heavy", "mixed"), "mode is none", 1),
        ((*not_("light"), WIND, is_("heavy")), "mode is heavy and wind > 9 m/s", 2),
        ((WIND, *not_("none", "light")), "wind > 9 m/s and mode is neither none nor light", 2),
        ((*not_("light"), Condition(4, "<=", 0.5)), "mode is not light and ground is soft", 2),
        ((is_("heavy"), is_("light")), "mode is heavy and mode is light", 2),  # by hand
        ((), "always", 0),
    ],
)
def test_a_column_of_words_is_said_once(
    conditions: tuple[Condition, ...], said: str, length: int
) -> None:
    rules = rules_of(*conditions)
    assert conditions_text(rules[0], rules) == said
    assert merged_length(rules[0], FEATURES) == length
    assert rules.to_frame()["merged_length"].tolist() == [length]
    in_full = said.replace("mode", "the mode").replace("ground", "the ground")
    in_full = in_full.replace("wind > 9", "the wind is above 9")
    if conditions:
        assert sentence(rules[0], rules, evidence=False) == f"If {in_full}, then lower."
    assert rules[0].conditions == conditions


@given(st.permutations(MODES), st.integers(1, 4), st.booleans())
def test_it_is_true_of_the_same_states(words: list[str], count: int, holds: bool) -> None:
    conditions = [*not_(*words[1 : count + 1 - holds])] + [is_(words[0])] * holds
    rule = rules_of(*conditions)[0]
    said = least_bounds(rule, FEATURES)
    states = np.zeros((len(MODES), len(FEATURES)), dtype=np.float32)
    states[range(len(MODES)), range(len(MODES))] = 1.0
    as_said = np.ones(len(states), dtype=bool)
    for one in said:
        as_said &= (one.low < states[:, one.feature]) & (states[:, one.feature] <= one.high)
    assert as_said.tolist() == rule.applies(states).tolist()


def test_three_words_that_are_left_out_are_a_list() -> None:
    more = (*FEATURES[:4], Feature("mode is odd", "", Indicator("mode", "odd")))
    rules = rules_of(*not_("heavy", "light", "mixed"), features=more)
    assert conditions_text(rules[0], rules) == "mode is neither heavy, light nor mixed"


def test_words_of_a_renamed_column_stay_together_as_long_as_they_name_it() -> None:
    load = tuple(replace(one, name=one.name.replace("mode", "load")) for one in FEATURES[:4])
    rules = rules_of(*not_("light", "mixed"), features=load)
    assert conditions_text(rules[0], rules) == "load is neither light nor mixed"
    laden = (*FEATURES[:1], replace(FEATURES[1], name="bare"), *FEATURES[2:])
    rules = rules_of(*not_("light", "mixed"), features=laden)
    assert conditions_text(rules[0], rules) == "bare is false and mode is not mixed"


def test_tables_and_cards_say_the_same() -> None:
    rules = rules_of(*not_("light", "mixed"), WIND)
    state = (1.0, 0.0, 0.0, 0.0, 1.0, 12.0)
    views = condition_views(rules[0], state, rules)
    assert [(one.condition, one.value) for one in views] == [
        ("mode is neither light nor mixed", "mode is heavy"),
        ("wind > 9 m/s", "12 m/s"),
    ]
    assert "mode is neither light nor mixed and wind &gt; 9 m/s" in rules_to_markdown(rules)
    assert "3 conditions on 2 features" in rule_card(rules[0], rules, threshold=0.9)
    assert "If the mode is neither light nor mixed and the wind is above 9 m/s" in rules_to_csv(
        rules
    )
    heavy = rules_of(*not_("light"), is_("heavy"))
    assert [column.feature for column in rule_matrix(heavy).columns] == [0]
