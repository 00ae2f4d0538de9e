"""What episodes say of rules that forbid which they were not mined from."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, RuleSet, grow_policy_trees, mine_rules
from sarl_core.mining.never.never_rules import (
    mine_never_rules,
    never_thresholds,
    with_never_rules,
)
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.validation.cross_fitting import cross_fit, judge, judge_pairs
from sarl_core.mining.validation.episode_counts import count_rules, count_together
from sarl_core.mining.validation.holding_out import hold_out, with_held_out
from sarl_core.mining.validation.learning_curve import learning_curve
from sarl_core.mining.validation.stability import rule_stability
from sarl_core.shielding.leeway import leeway_of
from tests.mining.strategies import labelled_states


@settings(max_examples=60)
@given(labelled_states(), st.floats(0.1, 0.9), st.one_of(st.none(), st.floats(0.5, 1.0)))
def test_together_they_are_right_where_a_shield_would_change_nothing(shown, epsilon, conf_min):
    trees = grow_policy_trees(shown)
    rules = mine_never_rules(trees, epsilon=epsilon)
    if conf_min is not None:
        demanding = mine_rules(trees, supp_min=0.05, conf_min=conf_min)
        rules = with_never_rules(demanding, trees, epsilon)
    samples, correct = count_together(rules, shown)
    leeway = leeway_of(rules, shown)
    assert samples.sum() == round(leeway.coverage * len(shown))
    share = correct.sum() / samples.sum() if samples.sum() else np.nan
    assert share == pytest.approx(leeway.fidelity, nan_ok=True)


def test_where_none_overlap_each_counts_as_if_it_were_alone(lander_like: Demonstrations):
    split = hold_out(lander_like, 0.4)
    rules = mine_rules(split.mined, supp_min=0.02, conf_min=0.8)
    together = judge_pairs(rules, split.held_out)
    apart = judge(rules, count_rules(rules, split.held_out))
    for name in ("numbers", "lengths", "decisions", "covered", "correct"):
        np.testing.assert_array_equal(getattr(together, name), getattr(apart, name))


def test_of_each_the_share_of_an_episode_without_what_it_forbids(lander_like: Demonstrations):
    split = hold_out(lander_like, 0.4)
    rules = with_held_out(mine_never_rules(split.mined, epsilon=0.2, supp_min=0.05), split.held_out)
    assert len(rules) > 2
    for rule in rules:
        shares = []
        for episode in np.unique(split.held_out.episodes):
            one = split.held_out.select([episode])
            rows = rule.applies(one.observations)
            if rows.any():
                shares.append(np.mean(~np.isin(one.actions[rows].ravel(), rule.forbids)))
        assert rule.held_out is not None
        assert rule.held_out.episodes == len(shares)
        assert rule.held_out.share == pytest.approx(np.mean(shares))
        assert rule.held_out.low <= rule.held_out.share <= rule.held_out.high


def test_every_episode_is_judged_by_rules_that_forbid_mined_without_it(lander_like):
    mine = partial(mine_never_rules, epsilon=0.2, supp_min=0.05)
    fit = cross_fit(lander_like, folds=4, seed=3)
    found = fit.of(mine)
    assert sorted(found.numbers) == sorted(np.unique(lander_like.episodes))
    for number, covered, correct in zip(found.numbers, found.covered, found.correct, strict=True):
        fold = next(one for one in fit.folds if number in one.leaves[0].numbers)
        others = np.setdiff1d(lander_like.episodes, fold.leaves[0].numbers)
        leeway = leeway_of(mine(lander_like.select(others)), lander_like.select([number]))
        assert covered == round(leeway.coverage * 100)
        assert correct == round(leeway.fidelity * covered)
    assert found.folds == 4
    assert found.fidelity.low < found.fidelity.share < found.fidelity.high


def test_rules_that_demand_are_judged_alike_by_both(lander_like: Demonstrations):
    thresholds = Thresholds(0.02, 0.8)
    fit = cross_fit(lander_like, folds=4)

    def mine(trees) -> RuleSet:
        return mine_rules(trees, supp_min=thresholds.support, conf_min=thresholds.confidence)

    for name in ("numbers", "covered", "correct", "decisions"):
        np.testing.assert_array_equal(
            getattr(fit.of(mine), name), getattr(fit.at(thresholds), name)
        )


def test_a_learning_curve_is_of_rules_that_forbid_where_there_is_an_epsilon(lander_like):
    curve = learning_curve(lander_like, never_thresholds(0.2, 0.05), orders=1, points=3, seed=4)
    order = np.random.default_rng(4).permutation(np.unique(lander_like.episodes))
    for column, size in enumerate(curve.episodes.tolist()):
        some = lander_like.select(order[:size])
        rules = mine_never_rules(grow_policy_trees(some), epsilon=0.2, supp_min=0.05)
        assert curve.rules[0, column] == len(rules)
        assert curve.coverage[0, column] == pytest.approx(leeway_of(rules, some).coverage)
        if size < len(order):
            judged = judge_pairs(rules, lander_like.select(order[size:]))
            share = judged.fidelity.share
            assert curve.fidelity[0, column] == pytest.approx(
                np.nan if share is None else share, nan_ok=True
            )


def test_rules_that_forbid_come_back_as_those_that_forbid_the_same(lander_like: Demonstrations):
    rules = mine_never_rules(lander_like, epsilon=0.2, supp_min=0.05)
    first = next(rule for rule in rules if rule.label < rule.instead[0])
    more, *left = first.instead  # as one made by hand forbids several: none forbids the same
    several = {"forbids": (first.label, more), "instead": tuple(left), "action": left[0]}
    rules = replace(rules, rules=(*rules.rules, replace(first, id="manual.1", **several)))
    stable = rule_stability(rules, lander_like, rounds=2, seed=1)
    rng = np.random.default_rng(1)
    episodes = np.unique(lander_like.episodes)
    overlaps = np.zeros((2, len(rules)))
    for drawn in overlaps:
        places = rng.integers(0, len(episodes), len(episodes))
        rows = np.concatenate([np.flatnonzero(lander_like.episodes == episodes[p]) for p in places])
        again = mine_never_rules(
            Demonstrations(
                lander_like.observations[rows],
                lander_like.actions[rows],
                np.repeat(np.arange(len(places)), 100),
            ),
            epsilon=0.2,
            supp_min=0.05,
        )
        for place, rule in enumerate(rules):
            here = rule.applies(lander_like.observations)
            drawn[place] = max(
                (
                    (here & there).sum() / (here | there).sum()
                    for other in again
                    if other.forbids == rule.forbids
                    for there in [other.applies(lander_like.observations)]
                ),
                default=0.0,
            )
    assert [one.overlap for one in stable.rules] == pytest.approx(np.median(overlaps, axis=0))
    assert max(one.returns for one in stable.rules) == 1.0
