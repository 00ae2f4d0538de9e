"""Near misses and the least changes, against trying every value where anything can change."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import InputError, RuleSet, Shield, mine_rules
from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.fields import Indicator
from sarl_core.explaining.words.what_if import near_miss_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import FILTERED, Condition, Rule
from sarl_core.mining.tree import Source
from sarl_core.shielding.neighbourhood import (
    Neighbourhood,
    after,
    at_least,
    at_most,
    decision_changes,
    feature_spreads,
)
from tests.shielding.test_envelope import DISCRETE, JOINTS, VALUES, D, random_rules, states_of

UP, DOWN = np.float32(np.inf), np.float32(-np.inf)
# Wherever a condition or a box can turn, and one float32 step to either side.
TURNS = np.unique(np.concatenate([VALUES, np.nextafter(VALUES, UP), np.nextafter(VALUES, DOWN)]))


def holds(rule, state):
    return bool(rule.applies(state[None])[0])


def moved(state, *changes):
    other = state.copy()
    for feature, value in changes:
        other[feature] = value
    return other


def a_state(seed):
    return next(state for state in states_of(seed) if np.isfinite(state).all())


@settings(max_examples=40)
@given(st.integers(0, 10_000))
def test_near_misses_are_all_rules_that_one_change_lets_apply(seed):
    rules = random_rules(seed, DISCRETE)
    shield, state = Shield(rules), a_state(seed)
    spreads = np.array([0.5, 1.0, 2.0])
    found = Neighbourhood(shield).near_misses(state, spreads, most=99)
    wanted = {
        number
        for number, rule in enumerate(rules.rules)
        if rule.enabled
        and not holds(rule, state)
        and any(
            holds(rule, moved(state, (feature, turn))) for feature in range(D) for turn in TURNS
        )
    }
    assert {miss.rule for miss in found} == wanted
    assert [miss.distance for miss in found] == sorted(miss.distance for miss in found)
    for miss in found:
        ((feature, before, value),) = miss.changes
        rule = rules.rules[miss.rule]
        assert before == state[feature]
        assert np.float32(value) == value
        assert holds(rule, moved(state, (feature, value)))
        less = np.nextafter(np.float32(value), np.float32(before))
        assert not holds(rule, moved(state, (feature, less)))
        assert miss.distance == pytest.approx(abs(value - before) / spreads[feature])
        assert miss.changes[0].by == value - before
        now = shield.decide(moved(state, (feature, value)), 4).rules
        assert miss.in_force == (miss.rule in now)


@settings(max_examples=25)
@given(st.integers(0, 10_000))
def test_two_features_where_one_is_not_enough(seed):
    rules = random_rules(seed, JOINTS, count=8)
    shield, state = Shield(rules), a_state(seed)
    near = Neighbourhood(shield)
    one = {miss.rule for miss in near.near_misses(state, np.ones(D), most=99)}
    found = near.near_misses(state, np.ones(D), features=2, most=99)
    wanted = set()
    for number, rule in enumerate(rules.rules):
        if not rule.enabled or holds(rule, state) or number in one:
            continue
        for first, second in combinations(range(D), 2):
            states = np.array([moved(state, (first, a), (second, b)) for a in TURNS for b in TURNS])
            if rule.applies(states).any():
                wanted.add(number)
    assert {miss.rule for miss in found} == wanted
    for miss in found:
        rule = rules.rules[miss.rule]
        pairs = [(change.feature, change.after) for change in miss.changes]
        assert holds(rule, moved(state, *pairs))
        for place, (feature, value) in enumerate(pairs):
            less = np.nextafter(np.float32(value), state[feature])
            nearly = [*pairs[:place], (feature, less), *pairs[place + 1 :]]
            assert not holds(rule, moved(state, *nearly))


@settings(max_examples=40)
@given(
    st.integers(0, 10_000), st.sampled_from([DISCRETE, JOINTS]), st.sampled_from(["act", "abstain"])
)
def test_the_least_change_is_that_of_trying_every_value(seed, actions, outside):
    shield = Shield(random_rules(seed, actions), outside=outside)
    state = a_state(seed)
    rng = np.random.default_rng(seed)
    action = (
        int(rng.integers(4, 7)) if actions is DISCRETE else rng.uniform(-1, 1, 2).astype(np.float32)
    )

    def executed(feature, value):
        return np.asarray(shield.decide(moved(state, (feature, value)), action).executed).tolist()

    for line in Neighbourhood(shield).lines(state, action):
        feature = line.feature
        now, value = executed(feature, state[feature]), state[feature]
        down, up = decision_changes(line, float(value), 0.5)
        above = [turn for turn in TURNS if turn > value and executed(feature, turn) != now]
        below = [turn for turn in TURNS if turn < value and executed(feature, turn) != now]
        assert (up is None) == (not above)
        assert (down is None) == (not below)
        for found, turn in ((up, above[:1]), (down, below[-1:])):
            if found is not None:
                assert found.change == (feature, value, turn[0])
                assert (
                    found.executed.tolist()
                    == np.asarray(executed(feature, turn[0])).reshape(-1).tolist()
                )
                assert found.distance == abs(float(turn[0]) - float(value)) / 0.5
        # Within a stretch the shield does the same from the first value to the last.
        ends = [*line.starts[1:].tolist(), np.inf]
        for stretch, (start, end) in enumerate(zip(line.starts.tolist(), ends, strict=True)):
            does = line.decisions.executed[stretch].tolist()
            for turn in TURNS[(start <= TURNS) & (end > TURNS)]:
                one = shield.decide(moved(state, (feature, turn)), action)
                assert np.asarray(one.executed).reshape(-1).tolist() == does
                assert one.outside == line.decisions.outside[stretch]
                assert one.rules == tuple(
                    None if rule < 0 else rule for rule in line.decisions.rules[stretch].tolist()
                )


def test_thresholds_that_are_no_float32_numbers(lander_like):
    """Mined thresholds lie between two float32 numbers, or on one."""
    rules = mine_rules(lander_like, supp_min=0.0, conf_min=0.9)
    near = Neighbourhood(Shield(rules))
    state = np.zeros(8, dtype=np.float32)
    found = near.near_misses(state, feature_spreads(lander_like.observations), most=50)
    assert len(found) > 3
    for miss in found:
        ((feature, before, value),) = miss.changes
        assert holds(rules.rules[miss.rule], moved(state, (feature, value)))
        less = np.nextafter(np.float32(value), np.float32(before))
        assert not holds(rules.rules[miss.rule], moved(state, (feature, less)))


def test_the_float32_numbers_beside_any_number():
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(size=500), VALUES, [0.1, 1 / 3, 1e30, -1e30]])
    for value, above, below, up in zip(
        values, after(values), at_most(values), at_least(values), strict=True
    ):
        assert below <= value < above
        assert np.nextafter(above, DOWN) == below
        assert up == (below if below == value else above)
    infinite = np.array([-np.inf, np.inf])
    assert after(infinite).tolist() == at_most(infinite).tolist() == [-np.inf, np.inf]


def test_a_feature_is_measured_by_the_middle_half_of_its_values():
    values = np.array([[0, 5, 0], [1, 5, 0], [2, 5, 0], [3, 5, 0], [4, 5, 7]], dtype=np.float32)
    assert feature_spreads(values).tolist() == [2.0, 1.0, 7.0]
    infinite = np.full((2, 3), np.inf, dtype=np.float32)
    assert feature_spreads(np.concatenate([values, infinite])).tolist() == [2.0, 1.0, 7.0]
    assert feature_spreads(infinite).tolist() == [1.0, 1.0, 1.0]
    assert after(np.array([np.finfo(np.float32).max])).tolist() == [np.inf]


def test_a_state_that_is_none_is_refused():
    near = Neighbourhood(Shield(random_rules(0, DISCRETE)))
    for state in (np.zeros(2), np.array([0.0, np.nan, 0.0])):
        with pytest.raises(InputError, match="3 finite numbers"):
            near.near_misses(state, np.ones(D))
        with pytest.raises(InputError, match="3 finite numbers"):
            near.lines(state, 4)


MODES = ("heavy", "light", "mixed", "odd")


def rules_about_modes() -> RuleSet:
    """Lower where the mode is heavy, hold where it is neither light nor heavy, above 9 m/s."""
    features = (
        *(Feature(f"mode is {word}", "", Indicator("mode", word)) for word in MODES),
        Feature("wind", "m/s"),
    )
    asked = (
        ((0, ">", 0.5),),
        ((0, "<=", 0.5), (1, "<=", 0.5), (4, ">", 9.0)),
        ((0, "<=", 0.5), (1, "<=", 0.5), (2, "<=", 0.5), (4, "<=", 9.0)),
    )
    rules = tuple(
        Rule(f"0.{place}", 0, tuple(Condition(*one) for one in each), place, 0.2, 0.97, 1.9, 90)
        for place, each in enumerate(asked)
    )
    actions = (LabelledDimension("lift", ("lower", "hold", "raise")),)
    return RuleSet(rules, actions, Source("", features, "d" * 32, 400, 10), FILTERED)


def of_mode(word: str, wind: float) -> np.ndarray:
    return np.array([*(word == one for one in MODES), wind], dtype=np.float32)


def test_another_word_is_one_change_of_the_whole_column() -> None:
    rules = rules_about_modes()
    near, state, spreads = Neighbourhood(Shield(rules)), of_mode("light", 12.0), np.ones(5)
    misses = near.near_misses(state, spreads)
    assert [
        (miss.rule, near_miss_text(miss.changes, rules.source.features), miss.distance)
        for miss in misses
    ] == [(0, "mode were heavy", 1.0), (1, "mode were mixed", 1.0)]
    two = near.near_misses(state, spreads, features=2)
    assert [near_miss_text(one.changes, rules.source.features) for one in two] == [
        "mode were odd and wind were 3 m/s less"
    ]
    # A word that is too much, where each of the others will do.
    heavy = near.near_misses(of_mode("heavy", 3.0), spreads)
    assert [near_miss_text(one.changes, rules.source.features) for one in heavy] == [
        "mode were odd"
    ]


def test_along_a_column_of_words_the_shield_is_asked_for_each_of_them() -> None:
    rules = rules_about_modes()
    shield = Shield(rules)
    state = of_mode("light", 12.0)
    lines = Neighbourhood(shield).lines(state, 2)
    for place, word in enumerate(MODES):
        expected = shield.decide(of_mode(word, 12.0), 2)
        assert lines[place].decisions.executed[-1].tolist() == [expected.executed]
        assert lines[place].decisions.executed[0].tolist() == [2]  # as it is
    changes = [
        change
        for line in lines[:4]
        for change in decision_changes(line, float(state[line.feature]), 1.0)
        if change is not None
    ]
    assert [(one.change.feature, one.executed.tolist()) for one in changes] == [
        (0, [0]),
        (2, [1]),
        (3, [1]),
    ]


def test_a_rule_that_leaves_out_the_present_word_alone_says_so() -> None:
    rules = rules_about_modes()
    one = replace(rules[1], conditions=rules[1].conditions[:1])
    near = Neighbourhood(Shield(replace(rules, rules=(one,))))
    (miss,) = near.near_misses(of_mode("heavy", 3.0), np.ones(5))
    assert near_miss_text(miss.changes, rules.source.features) == "mode were not heavy"
