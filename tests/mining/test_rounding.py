from __future__ import annotations

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, RuleSet, Shield, mine_rules
from sarl_core.mining.editing.rounding import (
    EMPTIED,
    ONE_SIDED,
    SHORTEST,
    digits_of,
    merged_rules,
    rounded_rules,
)
from sarl_core.mining.rule_tree import tree_of
from sarl_core.mining.rules import Condition, Rule


def shortest_by_search(least: float, most: float) -> int:
    """Fewest digits of any number in [least, most), by trying all decimals of each length."""
    if least <= 0 < most:
        return 0
    for digits in range(1, 18):
        for exponent in range(-14, 5):
            step = Decimal(10) ** exponent
            first = (Decimal(least) / step).to_integral_value(rounding="ROUND_CEILING")
            for count in (first, first + 1):
                if abs(count) < 10**digits and least <= float(count * step) < most:
                    return digits
    return 99


def one_rule(threshold: float, n_features: int = 1) -> tuple[Rule, ...]:
    return (Rule("0.1", 0, (Condition(0, "<=", threshold),), 0, 0.5, 1.0, 1.0, 1),)


def pair(below: float, above: float) -> Demonstrations:
    states = np.array([[below], [above]], dtype=np.float32)
    return Demonstrations(states, np.array([0, 1]), np.array([0, 0]))


def with_rules(demonstrations: Demonstrations, rules: tuple[Rule, ...]) -> RuleSet:
    mined = mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)
    return replace(mined, rules=rules)


@pytest.mark.parametrize(
    ("below", "threshold", "above", "short"),
    [
        (0.12, 0.137, 0.19, 0.13),  # 0.14 is as short and nearer: see below
        (123.4, 150.2, 187.0, 150.0),
        (-3.0, 0.0123, 5.0, 0.0),
        (-0.31, -0.2871, -0.26, -0.3),
        (0.96, 0.9712, 2.0, 1.0),
    ],
)
def test_the_nearest_of_the_shortest(
    below: float, threshold: float, above: float, short: float
) -> None:
    demonstrations = pair(below, above)
    rounding = rounded_rules(with_rules(demonstrations, one_rule(threshold)), demonstrations)
    found = rounding.rule_set.rules[0].conditions[0].threshold
    assert digits_of(found) == digits_of(short)
    assert abs(found - threshold) <= abs(short - threshold)
    assert rounding.rounded == 1
    assert rounding.unrounded == ()


@given(st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6), st.floats(0, 1))
@settings(max_examples=30)
def test_no_shorter_number_would_do(one: int, other: int, share: float) -> None:
    below, above = (float(np.float32(count / 997)) for count in sorted((one, other)))
    threshold = below + share * (above - below)
    if not below <= threshold < above:
        return
    demonstrations = pair(below, above)
    rounding = rounded_rules(with_rules(demonstrations, one_rule(threshold)), demonstrations)
    found = rounding.rule_set.rules[0].conditions[0].threshold
    assert below <= found < above
    assert digits_of(found) == min(shortest_by_search(below, above), digits_of(threshold))


@pytest.mark.parametrize("thresholds", [(0.0, 1.0), (0.005, 0.7)])
def test_no_decision_changes_and_rules_stay_one_tree(
    thresholds: tuple[float, float], lander_like: Demonstrations
) -> None:
    rules = mine_rules(lander_like, supp_min=thresholds[0], conf_min=thresholds[1])
    rounding = rounded_rules(rules, lander_like)
    for before, after in zip(rules.rules, rounding.rule_set.rules, strict=True):
        # Each rule applies to the very states it applied to, whatever the others do.
        assert np.array_equal(
            before.applies(lander_like.observations), after.applies(lander_like.observations)
        )
        assert (before.id, before.samples) == (after.id, after.samples)
        assert all(bounds.low < bounds.high for bounds in after.bounds)
    before, after = (
        Shield(one).decide_batch(lander_like.observations, lander_like.actions)
        for one in (rules, rounding.rule_set)
    )
    assert np.array_equal(before.rules, after.rules)
    assert np.array_equal(before.executed, after.executed)
    assert tree_of(list(enumerate(rounding.rule_set.rules))) is not None
    states = np.random.default_rng(0).normal(size=(20_000, 8)).astype(np.float32)
    overlap = sum(rule.applies(states).astype(int) for rule in rounding.rule_set.rules)
    assert overlap.max() == 1

    def digits(rule_set: RuleSet) -> float:
        return float(np.mean([digits_of(c[2]) for rule in rule_set.rules for c in rule.conditions]))

    assert digits(rounding.rule_set) < 4.5 < 14 < digits(rules)


def test_rules_that_share_a_query_count_once_and_go_on_sharing_it() -> None:
    states = np.array([[0.11, 1], [0.12, 2], [0.93, 1.21], [0.94, 1.39]], dtype=np.float32)
    demonstrations = Demonstrations(states, np.array([0, 0, 1, 2]), np.zeros(4, dtype=int))
    rules = mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)
    rounding = rounded_rules(rules, demonstrations)
    nodes = tree_of(list(enumerate(rounding.rule_set.rules)))
    assert nodes is not None
    inner = [node for node in nodes if node.feature >= 0]
    assert rounding.rounded + len(rounding.unrounded) == len(inner) == 2


def test_what_no_state_proves_stays_and_is_listed(lander_like: Demonstrations) -> None:
    rules = with_rules(lander_like, one_rule(1234.5678901))
    rounding = rounded_rules(rules, lander_like)
    assert rounding.rule_set == rules
    assert rounding.rounded == 0
    (kept,) = rounding.unrounded
    assert (kept.feature, kept.threshold, kept.rules, kept.why) == (
        0,
        1234.5678901,
        ("0.1",),
        ONE_SIDED,
    )


def test_what_has_no_shorter_neighbour_stays_and_is_listed() -> None:
    below = np.float32(0.123456)
    above = np.nextafter(below, np.float32(1))
    demonstrations = pair(float(below), float(above))
    rules = with_rules(demonstrations, one_rule(float(below)))
    once = rounded_rules(rules, demonstrations).rule_set
    again = rounded_rules(once, demonstrations)
    assert again.rounded == 0
    assert [kept.why for kept in again.unrounded] == [SHORTEST]
    assert again.rule_set == once


def test_rules_by_hand_pinned_and_switched_off_keep_their_states(
    lander_like: Demonstrations,
) -> None:
    mined = mine_rules(lander_like, supp_min=0.005, conf_min=0.7)
    hand = Rule(
        "hand", 0, (Condition(1, ">", 0.123456789), Condition(2, "<=", 0.98765)), 1, 0, 0, 0, 0,
        origin="manual",
    )  # fmt: skip
    rules = (
        replace(mined.rules[0], enabled=False),
        replace(mined.rules[1], pinned=True),
        *mined.rules[2:],
        hand,
    )
    edited = replace(mined, rules=rules)
    rounded = rounded_rules(edited, lander_like).rule_set
    for before, after in zip(edited.rules, rounded.rules, strict=True):
        assert np.array_equal(
            before.applies(lander_like.observations), after.applies(lander_like.observations)
        )
    assert digits_of(rounded.rules[-1].conditions[0].threshold) < 5


def test_merged_rules_apply_where_they_did(lander_like: Demonstrations) -> None:
    rules = mine_rules(lander_like, supp_min=0.0, conf_min=1.0)
    merged = merged_rules(rules)
    states = np.random.default_rng(1).normal(size=(3_000, 8)).astype(np.float32)
    states[:50] = np.nan
    actions = np.zeros(len(states), dtype=np.int64)
    before, after = (
        Shield(one, on_invalid="pass").decide_batch(states, actions) for one in (rules, merged)
    )
    assert np.array_equal(before.rules, after.rules)
    assert max(rule.length for rule in merged.rules) < max(rule.length for rule in rules.rules)
    assert all(rule.length <= 2 * len(rule.bounds) for rule in merged.rules)


def test_other_features_are_refused(lander_like: Demonstrations) -> None:
    rules = mine_rules(lander_like, supp_min=0.01, conf_min=0.9)
    with pytest.raises(InputError, match="ask about 8 features and the demonstrations have 1"):
        rounded_rules(rules, pair(0, 1))


def test_a_narrow_rule_by_hand_is_not_rounded_away() -> None:
    data = Demonstrations(
        np.float32([[0.1], [0.9]]), np.array([0, 1]), np.array([0, 0]), label_names=(("a", "b"),)
    )
    mined = mine_rules(data, supp_min=0.0, conf_min=1.0)
    path = (Condition(0, ">", 0.4621), Condition(0, "<=", 0.4867))
    hand = Rule("hand", 0, path, 1, 0.0, 0.0, 0.0, 0, origin="manual")
    # Another rule begins with the same query: it goes on sharing it.
    other = replace(hand, id="other", conditions=path[:1])
    found = rounded_rules(replace(mined, rules=(hand, other, *mined.rules)), data)
    assert found.rule_set.rules[0].conditions == path
    assert found.rule_set.rules[1].conditions == path[:1]
    assert hand.applies(np.float32([[0.47]])).all()
    listed = {(one.threshold, one.why) for one in found.unrounded}
    assert (0.4621, EMPTIED) in listed
    assert {threshold for threshold, _ in listed} >= {0.4621, 0.4867}
    for one in found.unrounded:
        if one.why == EMPTIED:
            assert set(one.rules) == {"hand", "other"}
    # Without it the other rule is rounded as ever.
    alone = rounded_rules(replace(mined, rules=(other,)), data).rule_set.rules[0]
    assert alone.conditions[0].threshold == pytest.approx(0.5)
