from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core.demonstrations.dataset import Feature
from sarl_core.mining.action_words import action_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import (
    condition_text,
    conditions_text,
    limit_text,
    number_text,
    sentence,
    share_text,
    short_condition,
    threshold_text,
)
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import FILTERED, Bounds, Condition, Rule
from sarl_core.mining.tree import Source

INF = math.inf
ANGLE = Feature("pole angle", "rad")
FEATURES = (
    ANGLE,
    Feature("cart velocity", "m/s"),
    Feature("left leg contact"),
    Feature("gear is 2"),
)
PUSH = LabelledDimension("push", ("push left", "push right"))


def rule_of(*conditions: Condition, action: int = 1, samples: int = 412) -> Rule:
    return Rule("0.5", 0, conditions, action, 0.1, 0.97, 1.9, samples)


def set_of(rule: Rule, dimension: LabelledDimension = PUSH) -> RuleSet:
    source = Source("CartPole-v1", FEATURES, "0" * 32, 4120, 10)
    return RuleSet((rule,), (dimension,), source, FILTERED)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (0.020938, "0.0209"),
        (-0.5, "-0.5"),
        (12.0, "12"),
        (1234.5, "1234"),
        (2.5e-7, "2.5e-07"),
        (-1e9, "-1e+09"),
        (100.0, "100"),
    ],
)
def test_numbers_have_three_digits_and_no_more_zeros_than_needed(value: float, text: str) -> None:
    assert number_text(value) == text


def test_two_numbers_that_differ_never_look_the_same() -> None:
    low, high = 0.12345, 0.12349
    assert number_text(low, apart_from=high) != number_text(high, apart_from=low)


@given(st.floats(0, 1))
def test_a_threshold_reads_back_as_it_was(value: float) -> None:
    text = threshold_text(value)
    assert float(text) == value
    assert "e" not in text


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (1.0, "100 %"),
        (0.0, "0 %"),
        (0.97, "97 %"),
        (0.955, "95.5 %"),
        (0.9996, "99.96 %"),
        (0.99999, "> 99.99 %"),
        (0.00001, "< 0.01 %"),
        (0.012, "1.2 %"),
        (0.4, "40 %"),
        (float("nan"), "–"),
    ],
)
def test_shares(share: float, text: str) -> None:
    assert share_text(share) == text


@given(st.floats(0, 1, exclude_min=True, exclude_max=True))
def test_a_share_never_rounds_to_all_or_none(share: float) -> None:
    assert share_text(share) not in ("0 %", "100 %")
    assert share_text(share, decimals=1) not in ("0.0 %", "100.0 %")


@pytest.mark.parametrize(
    ("bounds", "words", "signs"),
    [
        (Bounds(0, 0.0209, INF), "the pole angle is above 0.0209 rad", "pole angle > 0.0209 rad"),
        (Bounds(0, -INF, 2.0), "the pole angle is at most 2 rad", "pole angle ≤ 2 rad"),
        (
            Bounds(0, -0.1, 0.3),
            "the pole angle is between -0.1 and 0.3 rad",
            "-0.1 < pole angle ≤ 0.3 rad",
        ),
        (Bounds(2, 0.5, INF), "there is left leg contact", "left leg contact"),
        (Bounds(2, -INF, 0.5), "there is no left leg contact", "no left leg contact"),
        (Bounds(3, 0.5, INF), "the gear is 2", "gear is 2"),
        (Bounds(3, -INF, 0.5), "the gear is not 2", "gear is not 2"),
        (Bounds(2, 3.0, INF), "the left leg contact is above 3", "left leg contact > 3"),
    ],
)
def test_conditions(bounds: Bounds, words: str, signs: str) -> None:
    assert condition_text(bounds, FEATURES[bounds.feature]) == words
    assert short_condition(bounds, FEATURES[bounds.feature]) == signs


def test_a_sentence_merges_bounds_and_says_what_the_expert_did() -> None:
    rule = rule_of(
        Condition(0, ">", 0.01),
        Condition(1, "<=", 0.5),
        Condition(0, ">", 0.02),
        Condition(2, ">", 0.5),
    )
    assert sentence(rule, set_of(rule)) == (
        "If the pole angle is above 0.02 rad, the cart velocity is at most 0.5 m/s and there is "
        "left leg contact, then push right: so did the expert in 97 % of 412 states."
    )
    assert conditions_text(rule, set_of(rule)) == (
        "pole angle > 0.02 rad and cart velocity ≤ 0.5 m/s and left leg contact"
    )


def test_a_rule_without_conditions_says_always() -> None:
    rule = rule_of(samples=1)
    assert sentence(rule, set_of(rule)) == (
        "Always push right: so did the expert in 97 % of 1 state."
    )
    assert conditions_text(rule, set_of(rule)) == "always"


def test_a_manual_rule_claims_no_evidence() -> None:
    rule = Rule("m1", 0, (Condition(0, ">", 0.0),), 1, 0.0, 0.0, 0.0, 0, origin="manual")
    assert sentence(rule, set_of(rule)) == "If the pole angle is above 0 rad, then push right."


def test_actions_without_names_and_intervals_name_their_dimension() -> None:
    assert action_text(2, LabelledDimension("action", ("0", "1", "2"))) == "action 2"
    edges = np.linspace(-2, 2, 3).tolist()
    assert action_text(0, LabelledDimension.of_edges("torque", edges)) == "torque from -2 to 0"


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.005, "0.005"),
        (0.95, "0.95"),
        (1.0, "1"),
        (0.0046, "0.0046"),
        (2e-05, "0.002 %"),
        (0.00002003, "0.002 %"),
        (0.005166667, "0.517 %"),
        (0.99999, "99.999 %"),
        (0.9234567, "92.3 %"),
    ],
)
def test_a_threshold_is_said_as_it_was_chosen_or_in_percent(share: float, text: str):
    assert limit_text(share) == text
