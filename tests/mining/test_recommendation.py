"""The thresholds that are recommended, against every pair of steps tried one by one."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from sarl_core import Demonstrations, grow_policy_trees, mine_rules
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.validation import cross_fitting
from sarl_core.mining.validation import recommendation as module
from sarl_core.mining.validation.cross_fitting import CrossFit, Fold, cross_fit
from sarl_core.mining.validation.recommendation import (
    COVERAGE,
    NEAR,
    enough_episodes,
    episode_count,
    recommended,
)

SUPPORTS, CONFIDENCES = (0.0, 0.002, 0.01, 0.03, 0.1), (0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


@pytest.fixture
def few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SUPPORT_STEPS", SUPPORTS)
    monkeypatch.setattr(module, "CONFIDENCE_STEPS", CONFIDENCES)


@pytest.fixture(scope="module")
def two_actions() -> Demonstrations:
    rng = np.random.default_rng(0)
    states = rng.normal(size=(900, 2)).astype(np.float32)
    actions = np.clip(states * [1, 3] + 0.3 * rng.normal(size=(900, 2)), -1, 1)
    return Demonstrations(
        states,
        actions.astype(np.float32),
        np.repeat(np.arange(9), 100),
        action_low=(-1, -1),
        action_high=(1, 1),
    )


def tried(trees, fit: CrossFit, *, lift=0.0, depth=None, without=None):
    """Rules, coverage and fidelity elsewhere at every pair; of all episodes but some."""
    found = {}
    for pair in product(SUPPORTS, CONFIDENCES):
        at = Thresholds(*pair, lift, depth)
        rules = mine_rules(
            trees, supp_min=at.support, conf_min=at.confidence, lift_min=lift, max_depth=depth
        )
        judged = fit.at(at)
        these = ~np.isin(judged.numbers, without or [])
        counts = (judged.covered > 0) & these
        if counts.any():
            shares = judged.correct[counts] / judged.covered[counts]
            coverage = (judged.covered[these] / judged.decisions[these]).mean()
            found[at] = (rules.rule_count, coverage, shares.mean())
    return found


def chosen_pair(found, nearness=NEAR):
    enough = {at: row for at, row in found.items() if row[1] >= COVERAGE}
    best = max(row[2] for row in enough.values())
    near = {at: row for at, row in enough.items() if row[2] >= best - nearness}
    fewest = min(row[0] for row in near.values())
    few = [at for at, row in near.items() if row[0] == fewest]
    return max(few, key=lambda at: near[at][2]), best


@pytest.mark.parametrize(("lift", "depth"), [(0.0, None), (1.2, 5)])
@pytest.mark.parametrize("nearness", [NEAR, 0.5])
@pytest.mark.usefixtures("few_steps")
def test_it_is_the_fewest_rules_near_the_best_of_all_pairs(
    lander_like, lift, depth, nearness, monkeypatch
):
    monkeypatch.setattr(module, "NEAR", nearness)
    trees, fit = grow_policy_trees(lander_like), cross_fit(lander_like, folds=4)
    found = recommended(trees, fit, lift_min=lift, max_depth=depth)
    rows = tried(trees, fit, lift=lift, depth=depth)
    at, best = chosen_pair(rows, nearness)
    rules, coverage, fidelity = rows[at]
    assert (found.rules, found.fidelity) == (rules, pytest.approx(fidelity))
    assert rows[found.thresholds] == rows[at]
    assert found.coverage == pytest.approx(coverage)
    assert found.best == pytest.approx(best)
    assert found.fidelity >= found.best - nearness
    assert found.best_rules == min(
        count for count, reach, right in rows.values() if right == best and reach >= COVERAGE
    )
    assert nearness == NEAR or found.rules < found.best_rules
    # Fidelity alone would rather have rules for fewer states.
    assert max(row[2] for row in rows.values()) > found.best


@pytest.mark.usefixtures("few_steps")
def test_what_it_is_worth_comes_from_episodes_that_did_not_choose_it(lander_like):
    trees, fit = grow_policy_trees(lander_like), cross_fit(lander_like, folds=4, seed=2)
    shares = []
    for fold in fit.folds:
        own = fold.leaves[0].numbers
        at, _ = chosen_pair(tried(trees, fit, without=own.tolist()))
        judged = fit.at(at)
        here = np.isin(judged.numbers, own) & (judged.covered > 0)
        shares += (judged.correct[here] / judged.covered[here]).tolist()
    assert len(shares) == 20
    assert recommended(trees, fit).unseen == pytest.approx(np.mean(shares))


@pytest.mark.usefixtures("few_steps")
def test_episodes_that_are_counted_some_after_others_recommend_the_same(lander_like, monkeypatch):
    trees, fit = grow_policy_trees(lander_like), cross_fit(lander_like, folds=4)
    whole, (every,) = recommended(trees, fit), next(fit.folds[0].counts())
    monkeypatch.setattr(cross_fitting, "_STEPS_AT_ONCE", -(-int(every.lengths.sum()) // 2))
    first, second = (some for (some,) in fit.folds[0].counts())
    assert [*first.numbers, *second.numbers] == every.numbers.tolist()
    assert first.samples.sum() + second.samples.sum() == every.samples.sum()
    parted = recommended(trees, fit)
    assert (parted.thresholds, parted.rules) == (whole.thresholds, whole.rules)
    for name in ("coverage", "fidelity", "best", "unseen"):
        assert getattr(parted, name) == pytest.approx(getattr(whole, name), abs=1e-12)


def test_nothing_is_recommended_of_which_nothing_is_known(lander_like):
    trees = grow_policy_trees(lander_like)
    free = recommended(trees, cross_fit(lander_like, folds=4))
    least = 1.5 * free.thresholds.support
    bound = recommended(trees, cross_fit(lander_like, folds=4, min_support=least))
    assert bound.thresholds.support >= least > free.thresholds.support > 0.0


@pytest.mark.usefixtures("few_steps")
def test_one_action_dimension_is_recommended_for_alone(two_actions):
    trees, fit = grow_policy_trees(two_actions, divider=2), cross_fit(two_actions, divider=2)
    found = [recommended(trees, fit, dimension=dimension) for dimension in (None, 0, 1)]
    for dimension in (0, 1):
        one, at = found[1 + dimension], found[1 + dimension].thresholds
        alone = mine_rules((trees[dimension],), supp_min=at.support, conf_min=at.confidence)
        assert one.rules == alone.rule_count
        only = CrossFit(
            tuple(Fold((fold.trees[dimension],), (fold.leaves[dimension],)) for fold in fit.folds),
            True,
            fit.parted,
        )
        assert one.fidelity == pytest.approx(only.at(at).fidelity.share)
        assert one.coverage == pytest.approx(only.at(at).coverage.share)
    together = mine_rules(
        trees, supp_min=found[0].thresholds.support, conf_min=found[0].thresholds.confidence
    )
    assert found[0].rules == together.rule_count
    assert found[0].fidelity == pytest.approx(fit.at(found[0].thresholds).fidelity.share)
    assert found[0].coverage == pytest.approx(fit.at(found[0].thresholds).coverage.share)
    assert found[2].fidelity > found[1].fidelity  # the second action is the clearer one


def test_too_few_episodes_recommend_nothing(lander_like):
    few = lander_like.select([3, 7, 11, 12])
    fit = cross_fit(few)
    assert not enough_episodes(fit)
    assert episode_count(fit) == 4
    assert recommended(grow_policy_trees(few), fit) is None
    enough = lander_like.select([3, 7, 11, 12, 15])
    assert recommended(grow_policy_trees(enough), cross_fit(enough)) is not None


def test_stretches_of_one_episode_recommend_nothing(lander_like):
    alone = lander_like.select([3])
    fit = cross_fit(alone, folds=8)
    assert episode_count(fit) == 1
    assert recommended(grow_policy_trees(alone), fit) is None


def test_where_no_rules_cover_enough_nothing_is_recommended(lander_like):
    trees, fit = grow_policy_trees(lander_like), cross_fit(lander_like, folds=4)
    assert recommended(trees, fit, lift_min=20.0) is None
