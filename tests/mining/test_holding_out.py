"""Held-out episodes: the split, the counts, the intervals and the landscape's layer."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from sarl_core import Demonstrations, InputError, grow_policy_trees, mine_rules, threshold_landscape
from sarl_core.mining.evidence import HeldOut, wilson, wilson_bounds
from sarl_core.mining.holding_out import (
    count_held_out,
    held_out_interval,
    hold_out,
    lower_bound,
    mined_interval,
    more_episodes,
    pairs_needed,
    verdict,
    with_held_out,
    with_lower_bound,
    with_untried_held_out,
)
from sarl_core.mining.rule_files import rules_from_json, rules_to_json
from sarl_core.mining.rules import Condition, Rule
from tests.mining.strategies import labelled_states


def in_episodes(demonstrations, count):
    """The same pairs, cut into episodes of about the same length."""
    from dataclasses import replace

    episodes = np.arange(len(demonstrations)) * count // len(demonstrations)
    return replace(demonstrations, episodes=episodes, steps=None)


def rule_of(samples, correct, held=None):
    return Rule(
        "0.1", 0, (), 0, 0.1, correct / samples, 1.0, samples, held_out=held and HeldOut(*held)
    )


# --- the split ------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.01, 0.2, 0.5, 0.94])
def test_whole_episodes_are_held_out_and_nothing_is_lost(lander_like, share):
    split = hold_out(lander_like, share, seed=3)
    mined, held = (set(part.episodes.tolist()) for part in split)
    assert mined | held == set(range(20))
    assert not mined & held
    assert len(held) == max(round(20 * share), 1)
    assert len(split.mined) + len(split.held_out) == len(lander_like)
    for part in split:
        rows = np.isin(lander_like.episodes, part.episodes)
        assert np.array_equal(part.observations, lander_like.observations[rows])
        assert np.array_equal(part.actions, lander_like.actions[rows])


def test_the_seed_decides_and_a_larger_share_adds_to_a_smaller_one(lander_like):
    def held(share, seed):
        return set(hold_out(lander_like, share, seed=seed).held_out.episodes.tolist())

    assert held(0.3, 1) == held(0.3, 1)
    assert len({frozenset(held(0.3, seed)) for seed in range(8)}) > 1
    assert held(0.2, 1) < held(0.5, 1)


@pytest.mark.parametrize("share", [0.0, 1.0, -0.1, 1.5, float("nan"), 0.98])
def test_a_share_that_leaves_no_episode_is_one_sentence(lander_like, share):
    with pytest.raises(InputError, match=r"the held-out share|a held-out share") as refused:
        hold_out(lander_like, share)
    assert "\n" not in str(refused.value)


def test_one_episode_cannot_be_parted():
    alone = Demonstrations(np.zeros((4, 1), np.float32), np.array([0, 1, 0, 1]), np.zeros(4, int))
    with pytest.raises(InputError, match="of one episode leaves none to mine from"):
        hold_out(alone, 0.5)


# --- the counts -----------------------------------------------------------------------------------


def counted_by_hand(rule, dimension, held):
    """One state after the other, one condition after the other."""
    samples = correct = 0
    for state, action in zip(
        held.observations, held.action_columns[:, rule.dimension], strict=True
    ):
        if all(
            (float(state[feature]) <= threshold) == (op == "<=")  # not rounded to float32
            for feature, op, threshold in rule.conditions
        ):
            samples += 1
            correct += dimension.label_of(action) == rule.action
    return HeldOut(samples, correct)


@pytest.mark.parametrize("conf_min", [0.6, 0.9, 1.0])
def test_every_rule_is_counted_as_by_hand(lander_like, conf_min):
    split = hold_out(lander_like, 0.2)
    rules = with_held_out(mine_rules(split.mined, supp_min=0.01, conf_min=conf_min), split.held_out)
    assert len(rules)
    for rule in rules.rules:
        assert rule.held_out == counted_by_hand(rule, rules.actions[0], split.held_out)


def test_placed_rules_that_overlap_are_counted_too(lander_like):
    from dataclasses import replace

    split = hold_out(lander_like, 0.2)
    mined = mine_rules(split.mined, supp_min=0.02, conf_min=0.7)
    manual = replace(
        mined.rules[0], id="own", origin="manual", conditions=(Condition(2, ">", 0.1),), action=2
    )
    pinned = replace(mined.rules[1], pinned=True)
    mixed = replace(mined, rules=(manual, pinned, mined.rules[0], *mined.rules[2:]))
    for rule in with_held_out(mixed, split.held_out).rules:
        assert rule.held_out == counted_by_hand(rule, mined.actions[0], split.held_out)


def test_only_rules_that_were_not_tried_are_tried(lander_like):
    split = hold_out(lander_like, 0.4)
    mined = mine_rules(split.mined, supp_min=0.01, conf_min=0.8)
    tried = with_held_out(mined, split.held_out)
    assert with_untried_held_out(tried, split.held_out) is tried
    kept = HeldOut(7, 3)
    mixed = [
        replace(rule, held_out=kept if at % 2 else None) for at, rule in enumerate(mined.rules)
    ]
    found = with_untried_held_out(replace(mined, rules=tuple(mixed)), split.held_out)
    assert [rule.held_out for rule in found.rules] == [
        kept if at % 2 else rule.held_out for at, rule in enumerate(tried.rules)
    ]


def test_continuous_dimensions_are_compared_by_their_intervals():
    rng = np.random.default_rng(0)
    states = rng.normal(size=(400, 2)).astype(np.float32)
    actions = np.clip(states + 0.3 * rng.normal(size=(400, 2)), -1, 1).astype(np.float32)
    both = Demonstrations(
        states, actions, np.repeat(np.arange(8), 50), action_low=(-1, -1), action_high=(1, 1)
    )
    split = hold_out(both, 0.25)
    rules = with_held_out(
        mine_rules(split.mined, supp_min=0.02, conf_min=0.7, divider=4), split.held_out
    )
    assert {rule.dimension for rule in rules.rules} == {0, 1}
    for rule in rules.rules:
        dimension = rules.actions[rule.dimension]
        assert rule.held_out == counted_by_hand(rule, dimension, split.held_out)


def test_demonstrations_of_something_else_are_refused(lander_like):
    rules = mine_rules(lander_like, supp_min=0.02, conf_min=0.7)
    n = 6
    fewer = Demonstrations(np.zeros((n, 3), np.float32), np.zeros(n, int), np.zeros(n, int))
    with pytest.raises(InputError, match="8 features and the demonstrations have 3"):
        with_held_out(rules, fewer)
    states = np.zeros((n, 8), np.float32)
    two = Demonstrations(states, np.zeros((n, 2), int), np.zeros(n, int))
    with pytest.raises(InputError, match="1 action dimensions and the demonstrations have 2"):
        with_held_out(rules, two)
    other = Demonstrations(states, np.zeros((n, 1), np.float32), np.zeros(n, int))
    with pytest.raises(InputError, match="is discrete in the rules and continuous"):
        with_held_out(rules, other)


def test_what_was_counted_survives_the_rule_file(lander_like):
    split = hold_out(lander_like, 0.2)
    rules = with_held_out(mine_rules(split.mined, supp_min=0.01, conf_min=0.9), split.held_out)
    again = rules_from_json(rules_to_json(rules))
    assert again == rules
    assert json.loads(rules_to_json(rules))["rules"][0]["held_out"]["samples"] > 0


# --- the intervals --------------------------------------------------------------------------------


@given(st.integers(1, 5_000), st.floats(0, 1))
def test_wilson_is_scipys(samples, share):
    correct = round(share * samples)
    expected = binomtest(correct, samples).proportion_ci(method="wilson")
    assert wilson(correct, samples) == pytest.approx((expected.low, expected.high), abs=1e-12)


def test_without_a_pair_nothing_is_known_and_arrays_are_as_single_ones():
    assert wilson(0, 0) == (0.0, 1.0)
    correct, samples = np.array([0, 0, 5, 9]), np.array([0, 4, 5, 10])
    low, high = wilson_bounds(correct, samples)
    singly = [wilson(*pair) for pair in zip(correct, samples, strict=True)]
    assert [tuple(pair) for pair in zip(low, high, strict=True)] == singly


def test_the_held_out_interval_counts_where_there_is_one():
    rule = rule_of(100, 98)
    assert held_out_interval(rule) is None
    assert lower_bound(rule) == mined_interval(rule).low
    assert held_out_interval(rule_of(100, 98, (0, 0))) is None
    assert lower_bound(rule_of(100, 98, (0, 0))) == mined_interval(rule).low
    assert lower_bound(rule_of(100, 98, (40, 30))) == wilson(30, 40).low


@pytest.mark.parametrize(
    ("held", "expected"), [((50, 20), "below"), ((50, 47), "open"), ((500, 498), "reached")]
)
def test_a_verdict_is_about_the_whole_interval(held, expected):
    interval = binomtest(held[1], held[0]).proportion_ci(method="wilson")
    sides = {"below": interval.high < 0.95, "reached": interval.low >= 0.95}
    assert sides.get(expected, not any(sides.values()))
    assert verdict(rule_of(1000, 990, held), 0.95) == expected


def test_a_rule_set_is_filtered_by_the_lower_bound(lander_like):
    split = hold_out(lander_like, 0.3)
    rules = with_held_out(mine_rules(split.mined, supp_min=0.01, conf_min=0.8), split.held_out)
    kept = with_lower_bound(rules, 0.7)
    assert 0 < len(kept) < len(rules)
    assert [rule for rule in rules.rules if lower_bound(rule) >= 0.7] == list(kept.rules)
    with pytest.raises(InputError, match="give a share from 0 to 1"):
        with_lower_bound(rules, 1.2)


# --- enough demonstrations ------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(st.floats(0.3, 1.0), st.floats(0.02, 0.98))
def test_pairs_needed_is_where_the_lower_end_passes(confidence, threshold):
    needed = pairs_needed(confidence, threshold)
    if confidence <= threshold:
        assert needed == np.inf
        return
    if needed > 1e9 or needed < 1:
        return
    before, after = wilson_bounds(
        confidence * needed * np.array([0.99, 1.01]), needed * np.array([0.99, 1.01])
    )[0]
    assert before < threshold < after


def test_more_episodes_is_the_first_number_that_does_it():
    rule = rule_of(60, 58)  # 10 episodes gave 60 pairs, 58 of them right
    found = more_episodes(rule, 10, 0.9)
    first = next(
        more
        for more in range(1_000)
        if wilson(58 * (10 + more) / 10, 60 * (10 + more) / 10).low >= 0.9
    )
    assert found == first > 0
    assert more_episodes(rule_of(600, 598), 10, 0.9) == 0
    assert more_episodes(rule_of(60, 50), 10, 0.9) == np.inf
    assert more_episodes(rule_of(60, 60), 10, 1.0) == np.inf


def test_held_out_episodes_are_a_share_of_the_further_ones():
    tried = rule_of(600, 590, (20, 19))  # 20 held-out pairs in 10 episodes, held-out ones included
    first = next(
        more
        for more in range(10_000)
        if wilson(19 * (10 + more) / 10, 20 * (10 + more) / 10).low >= 0.9
    )
    assert more_episodes(tried, 10, 0.9) == first


# --- the landscape --------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(labelled_states(), st.sampled_from([0.0, 1.1]), st.sampled_from([None, 2]))
def test_the_landscapes_layer_is_what_mining_every_cell_counts(demonstrations, lift, depth):
    parted = in_episodes(demonstrations, 3)
    if len(parted) < 6:  # an episode of one step is no demonstration
        return
    split = hold_out(parted, 0.4)
    trees = grow_policy_trees(split.mined)
    supports, confidences = np.array([0.0, 0.02, 0.1, 0.5]), np.array([0.0, 0.4, 0.6, 0.9, 1.0])
    landscape = threshold_landscape(
        trees,
        supports,
        confidences,
        lift_min=lift,
        max_depth=depth,
        held_out=count_held_out(trees, split.held_out),
    )
    plain = threshold_landscape(trees, supports, confidences, lift_min=lift, max_depth=depth)
    assert plain.held_out_fidelity is None
    assert np.array_equal(plain.fidelity, landscape.fidelity, equal_nan=True)
    for i, supp in enumerate(supports):
        for j, conf in enumerate(confidences):
            mined = mine_rules(trees, supp_min=supp, conf_min=conf, lift_min=lift, max_depth=depth)
            counts = [counted_by_hand(r, mined.actions[0], split.held_out) for r in mined.rules]
            covered = sum(count.samples for count in counts)
            correct = sum(count.correct for count in counts)
            found = landscape.held_out_fidelity[i, j]
            assert found == correct / covered if covered else np.isnan(found)


def test_the_layer_is_there_for_each_dimension_and_for_all():
    rng = np.random.default_rng(1)
    states = rng.normal(size=(300, 3)).astype(np.float32)
    actions = np.stack([states[:, 0] > 0, states[:, 1] > rng.normal(size=300) / 3], axis=1)
    split = hold_out(Demonstrations(states, actions.astype(int), np.repeat(np.arange(6), 50)), 0.34)
    trees = grow_policy_trees(split.mined)
    counts = count_held_out(trees, split.held_out)
    landscape = threshold_landscape(trees, [0.0, 0.05], [0.8, 1.0], held_out=counts)
    mined = with_held_out(mine_rules(trees, supp_min=0.05, conf_min=0.8), split.held_out)
    parts = [mined.of_dimension(0), mined.of_dimension(1), mined.rules]
    for rules, part in zip(parts, (*landscape.dimensions, landscape), strict=True):
        samples, correct = np.sum([rule.held_out for rule in rules], axis=0)
        assert part.held_out_fidelity[1, 0] == correct / samples
