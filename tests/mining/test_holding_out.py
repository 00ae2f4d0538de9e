"""Held-out episodes: the split, the counts, the intervals and the landscape's layer."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from sarl_core import Demonstrations, InputError, grow_policy_trees, mine_rules, threshold_landscape
from sarl_core.mining.evidence import HeldOut, held_out_of
from sarl_core.mining.rule_set import rules_from_json, rules_to_json
from sarl_core.mining.rules import Condition, Rule, Thresholds
from sarl_core.mining.validation.episode_counts import count_rules
from sarl_core.mining.validation.holding_out import (
    best_lower_bound,
    count_held_out,
    episodes_needed,
    hold_out,
    lower_bound,
    more_episodes,
    shortfall,
    verdict,
    with_held_out,
    with_lower_bound,
    with_untried_held_out,
)
from tests.mining.strategies import labelled_states


def in_episodes(demonstrations, count):
    """The same pairs, cut into episodes of about the same length."""
    from dataclasses import replace

    episodes = np.arange(len(demonstrations)) * count // len(demonstrations)
    return replace(demonstrations, episodes=episodes, steps=None)


def rule_of(samples, correct, shares=None):
    """A rule that was right in such shares of ten states each of held-out episodes."""
    held = None
    if shares is not None:
        held = held_out_of(
            np.full(len(shares), 10), (10 * np.array(shares, dtype=float)).round().astype(int)
        )
    return Rule("0.1", 0, (), 0, 0.1, correct / samples, 1.0, samples, held_out=held)


def t_interval(shares, weight=1.0):
    """Of shares and one pseudo-episode at 0.5, which counts so much."""
    values, weights = np.append(shares, 0.5), np.append(np.ones(len(shares)), weight)
    n = weights.sum()
    mean = (weights * values).sum() / n
    variance = (weights * (values - mean) ** 2).sum() / (n - 1)
    reach = stats.t.ppf(0.975, n - 1) * (variance / n) ** 0.5
    return max(mean - reach, 0.0), min(mean + reach, 1.0)


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
    """One state after the other, one condition after the other; (samples, correct) an episode."""
    found = {}
    for state, action, episode in zip(
        held.observations, held.action_columns[:, rule.dimension], held.episodes, strict=True
    ):
        if all(
            (float(state[feature]) <= threshold) == (op == "<=")  # not rounded to float32
            for feature, op, threshold in rule.conditions
        ):
            samples, correct = found.get(episode, (0, 0))
            right = dimension.label_of(action) == rule.action
            found[episode] = samples + 1, correct + right
    return found


def assert_counted(rule, dimension, held):
    """What a rule carries is what is counted by hand."""
    counts = counted_by_hand(rule, dimension, held)
    told = rule.held_out
    assert told.samples == sum(samples for samples, _ in counts.values())
    assert told.correct == sum(correct for _, correct in counts.values())
    assert told.episodes == len(counts)
    shares = [correct / samples for samples, correct in counts.values()]
    assert told.share == (pytest.approx(np.mean(shares)) if shares else None)
    expected = t_interval(shares) if len(shares) >= 5 else None
    assert told.interval == (expected and pytest.approx(expected))


@pytest.mark.parametrize("conf_min", [0.6, 0.9, 1.0])
def test_every_rule_is_counted_as_by_hand(lander_like, conf_min):
    split = hold_out(lander_like, 0.2)
    rules = with_held_out(mine_rules(split.mined, supp_min=0.01, conf_min=conf_min), split.held_out)
    assert len(rules)
    for rule in rules.rules:
        assert_counted(rule, rules.actions[0], split.held_out)


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
        assert_counted(rule, mined.actions[0], split.held_out)


def test_only_rules_that_were_not_tried_are_tried(lander_like):
    split = hold_out(lander_like, 0.4)
    mined = mine_rules(split.mined, supp_min=0.01, conf_min=0.8)
    tried = with_held_out(mined, split.held_out)
    assert with_untried_held_out(tried, split.held_out) is tried
    kept = HeldOut(7, 3, 2, 0.4, None, None)
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
        assert_counted(rule, dimension, split.held_out)


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


# --- how sure one can be --------------------------------------------------------------------------


@given(st.lists(st.floats(0, 1).map(lambda share: round(share, 1)), min_size=5, max_size=80))
def test_the_interval_is_students_over_episodes_and_one_more(shares):
    assert rule_of(100, 98, shares).held_out.interval == pytest.approx(t_interval(shares))


def test_a_long_episode_counts_once():
    """Twelve episodes of 20 states, in which it is right, and one of 1,000 in which it is not."""
    held = held_out_of([20] * 12 + [1000], [20] * 12 + [300])
    assert held.correct / held.samples < 0.45
    assert held.share == pytest.approx((12 + 0.3) / 13)
    assert held.interval == pytest.approx(t_interval([1.0] * 12 + [0.3]))


def test_nothing_is_said_of_few_episodes_whatever_their_states():
    for shares in ([], [1.0], [1.0] * 4):
        held = held_out_of([5_000] * len(shares), [5_000] * len(shares))
        assert held.interval is None
        assert held.episodes == len(shares)
        assert held.share == (1.0 if shares else None)
    assert rule_of(100, 98, [1.0] * 5).held_out.interval is not None


def test_what_a_rule_was_mined_from_says_nothing_of_it():
    for rule in (rule_of(100_000, 99_999), rule_of(100_000, 99_999, [1.0] * 4)):
        assert lower_bound(rule) == 0.0
        assert verdict(rule, 0.5) == "unknown"
        assert np.isnan(more_episodes([rule], 10, Thresholds(0.0, 0.5))).all()
    shares = [1.0, 0.9, 1.0, 0.8, 0.9, 1.0]
    assert lower_bound(rule_of(100, 98, shares)) == pytest.approx(t_interval(shares)[0])


@pytest.mark.parametrize(
    ("shares", "expected"),
    [([0.3, 0.4] * 6, "below"), ([1.0, 0.9] * 6, "open"), ([1.0] * 60, "reached")],
)
def test_a_verdict_is_about_the_whole_interval(shares, expected):
    low, high = t_interval(shares)
    sides = {"below": high < 0.95, "reached": low >= 0.95}
    assert sides.get(expected, not any(sides.values()))
    assert verdict(rule_of(1000, 990, shares), 0.95) == expected


def test_a_rule_set_is_filtered_by_the_lower_bound(lander_like):
    split = hold_out(lander_like, 0.3)
    rules = with_held_out(mine_rules(split.mined, supp_min=0.01, conf_min=0.8), split.held_out)
    kept = with_lower_bound(rules, 0.7)
    assert 0 < len(kept) < len(rules)
    assert [rule for rule in rules.rules if lower_bound(rule) >= 0.7] == list(kept.rules)
    with pytest.raises(InputError, match="give a share from 0 to 1"):
        with_lower_bound(rules, 1.2)


@given(st.integers(5, 400))
def test_no_rule_shows_more_than_one_that_is_never_wrong(episodes):
    most = best_lower_bound(episodes)
    assert most == pytest.approx(t_interval(np.ones(episodes))[0])
    assert best_lower_bound(episodes + 1) > most
    wrong_once = np.append(np.ones(episodes - 1), 0.9)
    assert lower_bound(rule_of(100, 98, wrong_once)) < most


def test_few_episodes_show_nothing_at_all():
    assert [best_lower_bound(episodes) for episodes in range(5)] == [0.0] * 5


def test_what_is_met_too_rarely_is_told_from_what_is_too_often_wrong():
    sure, wrong = rule_of(100, 98, [1.0] * 20), rule_of(100, 98, [1.0, 0.2] * 10)
    rare, rare_and_wrong = rule_of(100, 98, [1.0] * 12), rule_of(100, 98, [0.1] * 12)
    never = rule_of(100, 98, []), rule_of(100, 98)
    found = shortfall([sure, wrong, rare, rare_and_wrong, *never], 0.9, 20)
    assert (found.reached, found.wrong, found.too_few) == (1, 1, 4)
    assert found.rules == 6
    assert found.best == lower_bound(sure)
    lower = shortfall([sure, wrong, rare, rare_and_wrong, *never], 0.85, 20)
    assert (lower.reached, lower.wrong, lower.too_few) == (2, 2, 2)
    assert shortfall([], 0.9, 20) == (0.9, 20, 0, 0, 0, 0.0)


# --- enough demonstrations ------------------------------------------------------------------------


def low_end(n, share, spread):
    """Of n episodes with such a mean and variance (two values, as far apart as it takes)."""
    mean = (n * share + 0.5) / (n + 1)
    squares = (n - 1) * spread + n * (share - mean) ** 2 + (0.5 - mean) ** 2
    return mean - stats.t.ppf(0.975, n) * (squares / n / (n + 1)) ** 0.5


@settings(max_examples=60)
@given(st.floats(0.3, 1.0), st.floats(0.0, 0.2), st.floats(0.02, 0.98))
def test_episodes_needed_is_the_first_number_whose_lower_end_passes(share, spread, threshold):
    needed = float(episodes_needed(np.array([share]), np.array([spread]), threshold)[0])
    if share < threshold:
        assert needed == np.inf
        return
    if np.isinf(needed) or needed > 1e6:
        assert share - threshold < 0.01
        return
    assert low_end(needed, share, spread) >= threshold - 1e-9
    assert needed == 5 or low_end(needed - 1, share, spread) < threshold + 1e-9


def test_more_episodes_go_on_as_those_before():
    shares = [1.0, 0.9, 1.0, 1.0, 0.9, 1.0]  # in 6 of 30 episodes
    needed = next(
        n for n in range(6, 10_000) if low_end(n, np.mean(shares), np.var(shares, ddof=1)) >= 0.9
    )
    rules = [rule_of(60, 58, some) for some in (shares, [1.0] * 40, [0.8] * 40)]
    found, enough, never = more_episodes(rules, 30, Thresholds(0.0, 0.9))
    assert found == np.ceil((needed - 6) * 30 / 6)
    assert enough == 0
    assert never == np.inf
    # Of both kinds each has to reach its own: those that forbid all but epsilon.
    both = Thresholds(0.0, 1.0, never=0.1)
    forbidding = [replace(rule, forbids=(1,)) for rule in rules]
    assert more_episodes([*rules, *forbidding], 30, both) == (
        *more_episodes(rules, 30, Thresholds(0.0, 1.0)),
        *(found, enough, never),
    )


def test_where_both_ends_are_cut_off_the_most_uneven_is_assumed():
    rule = replace(rule_of(60, 58), held_out=HeldOut(50, 30, 5, 0.6, 0.0, 1.0))
    needed = next(n for n in range(5, 10_000) if low_end(n, 0.6, 0.3) >= 0.5)
    assert more_episodes([rule], 5, Thresholds(0.0, 0.5)) == (needed - 5,)


# --- the landscape --------------------------------------------------------------------------------


@settings(max_examples=30)
@given(labelled_states(), st.sampled_from([0.0, 1.1]), st.sampled_from([None, 2]))
def test_the_landscapes_layer_is_what_mining_every_cell_counts(demonstrations, lift, depth):
    parted = in_episodes(demonstrations, 13)
    if len(parted) < 40:  # an episode of one step is no demonstration
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
            sums = {}
            for rule in mined.rules:
                by_hand = counted_by_hand(rule, mined.actions[0], split.held_out)
                for episode, count in by_hand.items():
                    sums[episode] = np.add(sums.get(episode, (0, 0)), count)
            shares = [correct / samples for samples, correct in sums.values()]
            found = landscape.held_out_fidelity[i, j]
            assert found == pytest.approx(np.mean(shares)) if shares else np.isnan(found)
            ends = landscape.held_out_low[i, j], landscape.held_out_high[i, j]
            few = len(shares) < 5
            pairs = sum(samples for samples, _ in sums.values())
            expected = (np.nan, np.nan) if few else t_interval(shares, len(shares) / pairs)
            assert ends == pytest.approx(expected, nan_ok=True, abs=1e-9)


def test_the_layer_is_there_for_each_dimension_and_for_all():
    rng = np.random.default_rng(1)
    states = rng.normal(size=(300, 3)).astype(np.float32)
    actions = np.stack([states[:, 0] > 0, states[:, 1] > rng.normal(size=300) / 3], axis=1)
    split = hold_out(Demonstrations(states, actions.astype(int), np.repeat(np.arange(6), 50)), 0.34)
    trees = grow_policy_trees(split.mined)
    counts = count_held_out(trees, split.held_out)
    landscape = threshold_landscape(trees, [0.0, 0.05], [0.8, 1.0], held_out=counts)
    mined = mine_rules(trees, supp_min=0.05, conf_min=0.8)
    parts = [mined.of_dimension(0), mined.of_dimension(1), mined.rules]
    for rules, part in zip(parts, (*landscape.dimensions, landscape), strict=True):
        together = count_rules(replace(mined, rules=tuple(rules)), split.held_out)
        samples, correct = together.together(np.ones(len(rules), dtype=bool))
        assert part.held_out_fidelity[1, 0] == pytest.approx(np.mean(correct / samples))


def test_many_episodes_are_taken_a_few_at_a_time(lander_like, monkeypatch):
    split = hold_out(lander_like, 0.5)
    trees = grow_policy_trees(split.mined)
    counts = count_held_out(trees, split.held_out)
    axes = np.linspace(0, 0.2, 7), np.linspace(0, 1, 9)
    whole = threshold_landscape(trees, *axes, held_out=counts)
    monkeypatch.setattr("sarl_core.mining.thresholds.landscape._CELLS_AT_ONCE", 150)
    parted = threshold_landscape(trees, *axes, held_out=counts)
    for name in ("held_out_fidelity", "held_out_low", "held_out_high"):
        np.testing.assert_allclose(getattr(parted, name), getattr(whole, name), rtol=1e-12)
