"""Few rules grown best-first, rule sets of all leaves, and their trees put together again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, RuleSet, Shield
from sarl_core.mining.budgeted_trees import grow_budgeted_trees, leaf_rules, without_idle_queries
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.rule_tree import recount
from sarl_core.mining.tree import LEAF
from sarl_core.progress import CancelledError
from tests.mining.strategies import labelled_states


@settings(max_examples=40)
@given(labelled_states(), st.integers(2, 12))
def test_every_state_has_one_rule_and_the_budget_holds(demonstrations, budget):
    trees = grow_budgeted_trees(demonstrations, max_rules=budget)
    rules = leaf_rules(trees)
    assert 1 <= len(rules) <= budget
    assert rules.cut == "leaves"
    states = np.random.default_rng(0).normal(size=(80, demonstrations.observations.shape[1]))
    states = np.vstack([states.astype(np.float32), demonstrations.observations])
    applying = np.array([rule.applies(states) for rule in rules.rules])
    assert (applying.sum(axis=0) == 1).all()
    assert rules.coverage == pytest.approx(1.0)
    found = Shield(rules).decide_batch(states, np.zeros(len(states), dtype=int)).rules[:, 0]
    assert (found == applying.argmax(axis=0)).all()


def steps(count: int = 400) -> Demonstrations:
    """Label 1 where x > 0; where x > 2, rarely, label 2."""
    x = np.linspace(-3, 2.2, count, dtype=np.float32)
    labels = np.where(x > 2.0, 2, (x > 0).astype(int))
    noise = np.random.default_rng(0).normal(size=count).astype(np.float32)
    return Demonstrations(
        np.stack([x, noise], axis=1),
        labels,
        np.zeros(count, dtype=int),
        label_names=(("a", "b", "c"),),
    )


def test_the_most_helpful_query_comes_first():
    (tree,) = grow_budgeted_trees(steps(), max_rules=2)
    assert tree.feature[0] == 0
    assert abs(tree.threshold[0]) < 0.02
    (tree,) = grow_budgeted_trees(steps(), max_rules=3)
    assert sorted(tree.label[tree.feature == LEAF].tolist()) == [0, 1, 2]


def test_growing_can_be_stopped_between_two_trees():
    both = np.stack([steps().observations[:, 0]] * 2, axis=1)
    demonstrations = Demonstrations(steps().observations, both, steps().episodes)
    calls: list[tuple[int, int]] = []
    with pytest.raises(CancelledError, match="stopped after 1 of 2"):
        grow_budgeted_trees(
            demonstrations, max_rules=2, progress=lambda *done: calls.append(done) or done[0] < 1
        )
    assert calls == [(0, 2), (1, 2)]


def test_a_pair_that_matters_more_is_asked_about_first():
    shown = steps()
    weights = np.where(shown.actions == 2, 1000.0, 1.0)
    (tree,) = grow_budgeted_trees(shown, max_rules=2, weights=weights)
    assert tree.threshold[0] > 1.9
    leaf = rule = leaf_rules([tree]).rules[-1]
    assert (rule.action, leaf.confidence) == (2, 1.0)


def test_scores_are_followed_and_a_leaf_says_the_best_mean():
    shown = steps()
    scores = np.zeros((len(shown), 3))
    scores[:, 2] = np.where(shown.observations[:, 1] > 0, 1.0, -1.0)  # against what was shown
    (tree,) = grow_budgeted_trees(shown, max_rules=2, scores=scores)
    assert tree.feature[0] == 1
    rules = leaf_rules([tree])
    above = next(rule for rule in rules.rules if rule.conditions[0].op == ">")
    assert above.action == 2
    # Confidence stays what it is: how often the expert was seen to do so.
    rows = above.applies(shown.observations)
    assert above.confidence == pytest.approx((shown.actions[rows] == 2).mean())


def test_intervals_follow_the_mean_of_the_values():
    x = np.linspace(-1, 1, 300, dtype=np.float32)[:, None]
    shown = Demonstrations(
        x, x.copy(), np.zeros(300, dtype=int), action_low=(-1.0,), action_high=(1.0,)
    )
    (tree,) = grow_budgeted_trees(shown, max_rules=5, divider=5)
    rules = leaf_rules([tree])
    assert [rule.action for rule in sorted(rules.rules, key=lambda r: r.bounds[0].high)] == [
        0,
        1,
        2,
        3,
        4,
    ]


@pytest.mark.parametrize("budget", [1, 0, -3])
def test_a_budget_without_a_choice_is_refused(budget):
    with pytest.raises(InputError, match=f"the budget is {budget} rules; give 2 or more"):
        grow_budgeted_trees(steps(), max_rules=budget)


def test_queries_that_change_nothing_are_taken_out():
    # 0 asks; 1 and 2 ask again, 1 for nothing.
    structure = TreeStructure(
        feature=np.array([0, 1, 1, LEAF, LEAF, LEAF, LEAF]),
        threshold=np.array([0.0, 0.5, 0.7, 0, 0, 0, 0]),
        children_left=np.array([1, 3, 5, LEAF, LEAF, LEAF, LEAF]),
        children_right=np.array([2, 4, 6, LEAF, LEAF, LEAF, LEAF]),
        label=np.array([0, 0, 0, 1, 1, 2, 0]),
    )
    clean = without_idle_queries(structure)
    assert (clean.feature == LEAF).sum() == 3
    states = np.random.default_rng(1).normal(size=(200, 2)).astype(np.float32)
    assert clean.label is not None
    assert structure.label is not None
    assert (clean.label[clean.apply(states)] == structure.label[structure.apply(states)]).all()
    alike = without_idle_queries(replace(structure, label=np.full(7, 2)))
    assert len(alike.feature) == 1


@settings(max_examples=30)
@given(labelled_states(), st.integers(2, 9))
def test_a_tree_is_put_together_again_under_the_same_numbers(demonstrations, budget):
    trees = grow_budgeted_trees(demonstrations, max_rules=budget)
    (again,) = recount(leaf_rules(trees), demonstrations)
    (tree,) = trees
    leaves = np.flatnonzero(tree.feature == LEAF)
    assert (np.flatnonzero(again.feature == LEAF) == leaves).all()
    assert (again.counts[leaves] == tree.counts[leaves]).all()
    assert (again.label[leaves] == tree.label[leaves]).all()
    assert leaf_rules([again]).rules == leaf_rules(trees).rules


def test_the_file_says_how_the_paths_were_cut(tmp_path):
    rules = leaf_rules(grow_budgeted_trees(steps(), max_rules=3))
    rules.save(tmp_path / "rules.json")
    assert RuleSet.load(tmp_path / "rules.json") == rules
    text = (tmp_path / "rules.json").read_text()
    (tmp_path / "rules.json").write_text(text.replace('"cut": "leaves"', '"cut": "branches"'))
    with pytest.raises(InputError, match="'branches' is neither 'leaves' nor 'thresholds'"):
        RuleSet.load(tmp_path / "rules.json")


def test_rules_of_something_else_cannot_be_counted(lander_like):
    rules = leaf_rules(grow_budgeted_trees(steps(), max_rules=3))
    with pytest.raises(InputError, match="2 features and the demonstrations have 8"):
        recount(rules, lander_like)
    incomplete = replace(rules, rules=rules.rules[:-1])
    with pytest.raises(InputError, match="not all leaves of one tree"):
        recount(incomplete, steps())
