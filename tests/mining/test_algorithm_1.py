"""Mining and the landscape against the oracle: equal rule sets, equal cells."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import (
    Demonstrations,
    grow_policy_trees,
    load_demonstrations,
    mine_rules,
    threshold_landscape,
)
from sarl_core.mining.thresholds.landscape import (
    PAPER_CONFIDENCES,
    PAPER_SUPPORTS,
    next_changes,
    rule_rectangles,
)
from sarl_core.mining.thresholds.pareto import pareto_front
from tests.mining.oracle import algorithm_1, fit, paths_of
from tests.mining.strategies import labelled_states

SHIPPED = ("cartpole", "lunar_lander", "pendulum")
THRESHOLDS = st.one_of(st.sampled_from([0.0, 0.05, 0.25, 0.5, 2 / 3, 0.95, 1.0]), st.floats(0, 1))


def as_set(rules):
    return {(tuple(map(tuple, r.conditions)), r.action, r.samples, r.correct) for r in rules}


def labels_by_hand(demonstrations, divider):
    """Interval indices, by comparing with the edges one after the other (the paper's divider)."""
    if demonstrations.is_discrete:
        return demonstrations.actions.reshape(-1)
    low, high = demonstrations.action_low[0], demonstrations.action_high[0]
    labels = np.zeros(len(demonstrations), dtype=int)
    for k in range(1, divider):
        labels += demonstrations.actions[:, 0].astype(float) >= low + (high - low) * k / divider
    return labels


@cache
def shipped(name, divider=2):
    demonstrations = load_demonstrations(f"data/demonstrations/{name}.parquet")
    labels = labels_by_hand(demonstrations, divider)
    learner = fit(demonstrations.observations, labels)
    paths = paths_of(learner, demonstrations.observations, labels)
    return demonstrations, labels, paths, {}


def expect_cell(landscape, i, j, rules, steps):
    assert landscape.rule_count[i, j] == len(rules)
    lengths = [len(rule[0]) for rule in rules]
    covered, correct = sum(rule[2] for rule in rules), sum(rule[3] for rule in rules)
    assert landscape.mean_length[i, j] == pytest.approx(np.mean(lengths) if rules else 0)
    assert landscape.coverage[i, j] == pytest.approx(covered / steps)
    if covered:
        assert landscape.fidelity[i, j] == pytest.approx(correct / covered)
    else:
        assert np.isnan(landscape.fidelity[i, j])


@settings(max_examples=120)
@given(
    labelled_states(),
    THRESHOLDS,
    THRESHOLDS,
    st.sampled_from([0.0, 0.9, 1.2, 2.0]),
    st.sampled_from([None, 0, 1, 3]),
)
def test_random_trees_give_the_oracles_rules(demonstrations, supp, conf, lift, depth):
    paths = paths_of(
        fit(demonstrations.observations, demonstrations.actions),
        demonstrations.observations,
        demonstrations.actions,
    )
    wanted = algorithm_1(paths, demonstrations.actions, supp, conf, lift, depth)
    mined = mine_rules(demonstrations, supp_min=supp, conf_min=conf, lift_min=lift, max_depth=depth)
    assert as_set(mined.rules) == wanted
    assert len(mined.rules) == len(wanted)


@settings(max_examples=40)
@given(labelled_states(max_steps=30), st.sampled_from([0.0, 1.1]), st.sampled_from([None, 2]))
def test_random_landscapes_are_the_oracle_in_every_cell_edges_included(demonstrations, lift, depth):
    trees = grow_policy_trees(demonstrations)
    tree = trees[0]
    supports = _edges(tree.support)
    confidences = _edges(tree.confidence)
    landscape = threshold_landscape(trees, supports, confidences, lift_min=lift, max_depth=depth)
    labels = demonstrations.actions
    paths = paths_of(fit(demonstrations.observations, labels), demonstrations.observations, labels)
    known = {}
    for i, supp in enumerate(supports):
        for j, conf in enumerate(confidences):
            rules = algorithm_1(paths, labels, supp, conf, lift, depth, known)
            expect_cell(landscape, i, j, rules, len(labels))


def _edges(values):
    """Every value at which something changes, and its two neighbours among the shares."""
    values = np.unique(values)
    around = [np.nextafter(values, -np.inf), values, np.nextafter(values, np.inf), [0.0, 1.0]]
    return np.unique(np.clip(np.concatenate(around), 0.0, 1.0))


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize(("supp", "conf"), [(0, 1), (0.005, 0.95), (0.02, 0.8), (0, 0)])
def test_shipped_data_give_the_oracles_rules(name, supp, conf):
    demonstrations, labels, paths, known = shipped(name)
    mined = mine_rules(demonstrations, supp_min=supp, conf_min=conf)
    assert as_set(mined.rules) == algorithm_1(paths, labels, supp, conf, known=known)


@pytest.mark.parametrize("divider", [3, 5])
def test_shipped_continuous_data_with_other_dividers(divider):
    demonstrations, labels, paths, known = shipped("pendulum", divider)
    mined = mine_rules(demonstrations, supp_min=0.005, conf_min=0.9, divider=divider)
    assert as_set(mined.rules) == algorithm_1(paths, labels, 0.005, 0.9, known=known)
    assert len(mined) > 1


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_landscapes_on_the_papers_grid(name):
    demonstrations, labels, paths, known = shipped(name)
    trees = grow_policy_trees(demonstrations)
    landscape = threshold_landscape(trees, PAPER_SUPPORTS, PAPER_CONFIDENCES)
    assert landscape.rule_count.shape == (11, 21)
    for i, supp in enumerate(PAPER_SUPPORTS):
        for j, conf in enumerate(PAPER_CONFIDENCES):
            rules = algorithm_1(paths, labels, supp, conf, known=known)
            expect_cell(landscape, i, j, rules, len(labels))


@settings(max_examples=60)
@given(labelled_states(), THRESHOLDS, THRESHOLDS)
def test_rules_are_disjoint_and_cover_every_pure_leaf_when_unfiltered(demonstrations, supp, conf):
    rules = mine_rules(demonstrations, supp_min=supp, conf_min=conf).rules
    applying = np.sum([rule.applies(demonstrations.observations) for rule in rules], axis=0)
    assert np.all(applying <= 1)
    tree = grow_policy_trees(demonstrations)[0]
    leaves = np.flatnonzero((tree.children_left < 0) & (tree.confidence == 1.0))
    covered = np.zeros(len(demonstrations), dtype=bool)
    for rule in mine_rules(demonstrations, supp_min=0, conf_min=1).rules:
        covered |= rule.applies(demonstrations.observations)
    for leaf in leaves:
        assert covered[tree.rows(leaf)].all()


@settings(max_examples=60)
@given(labelled_states(), THRESHOLDS, THRESHOLDS)
def test_nothing_changes_before_the_next_change_and_something_at_it(demonstrations, supp, conf):
    trees = grow_policy_trees(demonstrations)

    def rules(s, c):
        return {r.id for r in mine_rules(trees, supp_min=s, conf_min=c).rules}

    here = rules(supp, conf)
    changes = next_changes(trees, supp_min=supp, conf_min=conf)
    for axis, below, above in (
        (0, changes.support_below, changes.support_above),
        (1, changes.confidence_below, changes.confidence_above),
    ):

        def at(value, axis=axis):
            return rules(value, conf) if axis == 0 else rules(supp, value)

        start = (supp, conf)[axis]
        if above is not None:
            assert above > start
            assert at(above) != here
            assert at(np.nextafter(above, 0)) == here
        if below is not None:
            assert below < start
            assert at(below) != here
            assert at(np.nextafter(below, 1)) == here
        if above is None:
            assert at(1.0) == here
        if below is None:
            assert at(0.0) == here


@settings(max_examples=40)
@given(labelled_states(max_steps=25))
def test_the_pareto_front_is_what_trying_everything_finds(demonstrations):
    trees = grow_policy_trees(demonstrations)
    rectangles = rule_rectangles(trees[0])
    tried = set()
    for supp in np.unique(rectangles.support):
        for conf in np.unique(rectangles.confidence):
            rules = mine_rules(trees, supp_min=supp, conf_min=conf)
            if len(rules):
                tried.add((len(rules), rules.coverage, rules.fidelity))
    best = {
        one
        for one in tried
        if not any(
            other != one and other[0] <= one[0] and other[1] >= one[1] and other[2] >= one[2]
            for other in tried
        )
    }
    front = pareto_front(trees)
    assert {(p.rules, p.coverage, p.fidelity) for p in front} == best
    for point in front:
        rules = mine_rules(trees, supp_min=point.support, conf_min=point.confidence)
        assert (len(rules), rules.coverage, rules.fidelity) == point[:3]


def test_several_dimensions_are_summed_and_averaged():
    rng = np.random.default_rng(1)
    observations = rng.normal(size=(400, 3)).astype(np.float32)
    actions = np.column_stack([observations[:, 0] > 0, observations[:, 1] + observations[:, 2] > 0])
    demonstrations = Demonstrations(observations, actions.astype(int), np.zeros(400, dtype=int))
    trees = grow_policy_trees(demonstrations)
    landscape = threshold_landscape(trees, [0.0, 0.02, 0.3], [0.0, 0.9, 1.0])
    one, two = landscape.dimensions
    assert np.array_equal(landscape.rule_count, one.rule_count + two.rule_count)
    assert np.allclose(landscape.coverage, (one.coverage + two.coverage) / 2)
    for i, supp in enumerate(landscape.supports):
        for j, conf in enumerate(landscape.confidences):
            rules = mine_rules(trees, supp_min=supp, conf_min=conf)
            assert landscape.rule_count[i, j] == rules.rule_count
            assert landscape.mean_length[i, j] == pytest.approx(rules.mean_length)
            assert landscape.coverage[i, j] == pytest.approx(rules.coverage)
            assert landscape.fidelity[i, j] == pytest.approx(rules.fidelity, nan_ok=True)
    alone = mine_rules(trees[:1], supp_min=0.02, conf_min=0.9)
    assert one.rule_count[1, 1] == len(alone)


def test_a_root_that_qualifies_is_one_rule_without_condition():
    demonstrations = Demonstrations(
        np.arange(10, dtype=np.float32)[:, None], np.array([1] * 9 + [0]), np.zeros(10, dtype=int)
    )
    rules = mine_rules(demonstrations, supp_min=0.0, conf_min=0.9).rules
    assert len(rules) == 1
    assert (rules[0].conditions, rules[0].action, rules[0].samples) == ((), 1, 10)
    assert rules[0].confidence == 0.9
    assert rules[0].joint_support == pytest.approx(0.9)


def test_a_lift_of_exactly_the_minimum_is_enough() -> None:
    """3 of 5 against 3 of 8 is 1.6; the quotient of the two shares is a float below it."""
    assert (3 / 5) / (3 / 8) < 1.6
    values = np.repeat(np.float32([0, 1]), [5, 3])
    pairs = Demonstrations(values[:, None], np.repeat([1, 0], [3, 5]), np.zeros(8, dtype=np.int64))
    (rule,) = mine_rules(pairs, supp_min=0.5, conf_min=0.6, lift_min=1.6).rules
    assert (rule.samples, rule.correct, rule.lift) == (5, 3, 1.6)
    trees = grow_policy_trees(pairs)
    assert threshold_landscape(trees, [0.5], [0.6], lift_min=1.6).rule_count.tolist() == [[1]]
