"""Learners of trees: whatever chooses the queries, what is counted at the nodes is exact."""

from __future__ import annotations

import pickle
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sarl_core import (
    Demonstrations,
    InputError,
    Shield,
    grow_policy_trees,
    load_demonstrations,
    mine_rules,
    threshold_landscape,
)
from sarl_core.mining.editing.regrowing import next_queries, regrown
from sarl_core.mining.growing import growth, histogram
from sarl_core.mining.growing.growth import counted_trees, grow_structures, learner_for
from sarl_core.mining.tree import LEAF
from tests.mining.strategies import labelled_states

TASKS = ("cartpole", "lunar_lander", "pendulum", "lunar_lander_continuous")
FEWER = 16  # bins, to see what many values in a bin do without a million of them


@pytest.fixture
def few_bins(monkeypatch):
    monkeypatch.setattr(histogram, "BINS", FEWER)


def histogram_trees(demonstrations, **options):
    return grow_policy_trees(demonstrations, learner="histogram", **options)


def gini(labels):
    return 1 - sum((np.mean(labels == one)) ** 2 for one in np.unique(labels))


def impurity_left(states, labels, feature, threshold):
    left = states[:, feature] <= threshold
    return np.mean(left) * gini(labels[left]) + np.mean(~left) * gini(labels[~left])


def best_impurity(demonstrations, rows):
    """What the best of all queries leaves; infinite where all states are the same."""
    states, labels = demonstrations.observations[rows], demonstrations.actions[rows]
    return min(
        (
            impurity_left(states, labels, feature, value)
            for feature in range(states.shape[1])
            for value in np.unique(states[:, feature])[:-1]
        ),
        default=np.inf,
    )


def expect_exact_counts(tree, demonstrations):
    """Every pair walked by hand, with the comparison of the shield."""
    reached = {node: [] for node in range(tree.n_nodes)}
    for row, state in enumerate(demonstrations.observations):
        node = 0
        reached[0].append(row)
        while tree.feature[node] != LEAF:
            low = np.float64(state[tree.feature[node]]) <= tree.threshold[node]
            node = int((tree.children_left if low else tree.children_right)[node])
            reached[node].append(row)
    for node, rows in reached.items():
        assert sorted(tree.rows(node).tolist()) == rows
        assert rows  # no node that nothing reaches
        labels = demonstrations.actions[rows]
        counts = np.bincount(labels, minlength=tree.dimension.n_labels)
        assert np.array_equal(tree.counts[node], counts)


@settings(max_examples=80)
@given(labelled_states())
def test_counts_are_those_of_all_pairs_and_no_query_would_part_a_leaf_better(demonstrations):
    (tree,) = histogram_trees(demonstrations)
    expect_exact_counts(tree, demonstrations)
    for leaf in np.flatnonzero((tree.feature == LEAF) & (tree.confidence < 1.0)):
        rows = tree.rows(int(leaf))
        if len(rows) == 2:  # the learner at times leaves two states together
            continue
        assert best_impurity(demonstrations, rows) >= gini(demonstrations.actions[rows]) - 1e-6


@settings(max_examples=60)
@given(labelled_states())
def test_with_fewer_values_than_bins_each_query_is_as_good_as_the_best(demonstrations):
    (tree,) = histogram_trees(demonstrations)
    for node in np.flatnonzero(tree.feature != LEAF)[:6]:
        rows = tree.rows(int(node))
        states, labels = demonstrations.observations[rows], demonstrations.actions[rows]
        best = best_impurity(demonstrations, rows)
        own = impurity_left(states, labels, tree.feature[node], tree.threshold[node])
        assert own == pytest.approx(best, abs=1e-6)


@settings(max_examples=40)
@given(labelled_states(max_steps=200), st.floats(0, 1), st.floats(0, 1))
def test_rules_and_landscape_of_such_trees_agree(demonstrations, supp, conf):
    trees = histogram_trees(demonstrations)
    rules = mine_rules(trees, supp_min=supp, conf_min=conf)
    applying = np.sum([rule.applies(demonstrations.observations) for rule in rules], axis=0)
    assert np.all(applying <= 1)
    for rule in rules:
        here = rule.applies(demonstrations.observations)
        assert here.sum() == rule.samples
        assert (demonstrations.actions[here] == rule.action).sum() == rule.correct
    cell = threshold_landscape(trees, [supp], [conf])
    assert cell.rule_count[0, 0] == len(rules)
    assert cell.coverage[0, 0] == pytest.approx(rules.coverage)


@settings(max_examples=30)
@given(st.integers(0, 10**6))
def test_counts_are_exact_where_bins_hold_many_values(seed):
    rng = np.random.default_rng(seed)
    states = rng.normal(size=(300, 2)).astype(np.float32)
    labels = (rng.random(300) < 1 / (1 + np.exp(-4 * states[:, 0]))).astype(np.int64)
    demonstrations = Demonstrations(states, labels, np.arange(300) // 30)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(histogram, "BINS", FEWER)
        (tree,) = histogram_trees(demonstrations)
    expect_exact_counts(tree, demonstrations)
    for index in range(2):
        borders = np.unique(tree.threshold[tree.feature == index])
        assert len(borders) < FEWER
        # Halfway between two neighbouring values.
        values = np.sort(states[:, index].astype(np.float64))
        place = np.searchsorted(values, borders)
        assert np.array_equal(borders, (values[place - 1] + values[place]) / 2)


def test_a_leaf_that_bins_leave_mixed_is_told_as_it_is(few_bins):
    states = np.arange(160, dtype=np.float32)[:, None]
    labels = np.arange(160) % 2
    demonstrations = Demonstrations(states, labels, np.zeros(160, dtype=int))
    (tree,) = histogram_trees(demonstrations)
    leaves = tree.feature == LEAF
    assert leaves.sum() <= FEWER
    assert (tree.samples[leaves] == 10).all()
    assert (tree.confidence[leaves] == 0.5).all()
    assert len(mine_rules([tree], supp_min=0.0, conf_min=1.0)) == 0


def test_of_a_billion_states_every_query_parts_some():
    """Where squares are no longer exact, a border with nothing on one side is none all the same."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        total = rng.multinomial(1_000_000_000, rng.dirichlet(np.ones(3)))
        counts = np.zeros((3, 3, 8), dtype=np.int64)
        for feature, filled in enumerate((2, 2, 5)):  # and the last bins hold nothing
            for label in range(3):
                shares = rng.dirichlet(np.ones(filled))
                counts[feature, label, :filled] = rng.multinomial(total[label], shares)
        (query,) = histogram.best_queries(counts[None])
        assert query is not None
        assert 0 < query.left.sum() < 1_000_000_000


def test_queries_of_several_nodes_are_the_best_of_all_borders():
    """Each border by hand: of a node with one bin, of nodes where none gains, and of others."""
    rng = np.random.default_rng(0)
    counts = rng.integers(0, 4, (60, 2, 3, 9)) * (rng.random((60, 1, 1, 9)) < 0.7)
    counts[:, 1] = counts[:, 0, :, ::-1]  # the same states
    counts[20:40] = counts[20:40, :, :1]  # no border tells the labels apart
    counts[50, :, :, 1:] = 0
    counts[50, :, :, 0] = 5
    for node, query in zip(counts, histogram.best_queries(counts), strict=True):
        purities = {}
        for feature, border in np.ndindex(2, 8):
            below = node[feature, :, : border + 1].sum(axis=1)
            above = node[feature].sum(axis=1) - below
            if below.sum() and above.sum():
                purities[feature, border] = sum(
                    Fraction(int((side**2).sum()), int(side.sum())) for side in (below, above)
                )
        if query is None:
            assert not purities
            continue
        left = node[query.feature, :, : query.border + 1].sum(axis=1)
        assert np.array_equal(query.left, left)
        assert purities[query.feature, query.border] == max(purities.values())
    assert histogram.best_queries(counts)[50] is None


@pytest.mark.parametrize("min_support", [0.0, 0.01])
def test_nodes_that_choose_their_queries_in_one_go_choose_as_each_alone(monkeypatch, min_support):
    rng = np.random.default_rng(1)
    states = rng.normal(size=(12_000, 5)).astype(np.float32)
    states[:, 4] = states[:, 4] > 0
    labels = (states[:, 0] * states[:, 1] + rng.normal(size=12_000) > 0).astype(int)
    demonstrations = Demonstrations(states, labels, np.arange(12_000) // 100)

    def grown():
        (tree,) = grow_policy_trees(
            demonstrations, learner="histogram", min_support=min_support, max_depth=14
        )
        return tree

    together = grown()
    monkeypatch.setattr(histogram, "_BINS_IN_ONE_GO", 1)
    alone = grown()
    assert together.n_nodes > 50
    assert np.array_equal(together.feature, alone.feature)
    assert np.array_equal(together.threshold, alone.threshold)
    assert np.array_equal(together.counts, alone.counts)


@given(
    hnp.arrays(np.float32, st.integers(0, 60), elements=st.floats(width=32, allow_nan=False)),
)
def test_values_are_put_in_order_whatever_they_are(values):
    order = histogram._ascending_order(values)
    assert sorted(order.tolist()) == list(range(len(values)))
    assert np.array_equal(values[order], np.sort(values))


def test_one_label_alone_and_one_value_alone_are_one_leaf():
    states = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    (tree,) = histogram_trees(Demonstrations(states, np.zeros(50, int), np.zeros(50, int)))
    assert tree.n_nodes == 1
    labels = np.arange(50) % 3
    (tree,) = histogram_trees(Demonstrations(states * 0, labels, np.zeros(50, int)))
    assert tree.n_nodes == 1
    assert tree.counts.tolist() == [[17, 17, 16]]


@pytest.mark.parametrize("scale", [3e-43, 1e-38, 1e-20, 1e-6, 1.0, 1e20, 1e27])
def test_features_of_any_scale_have_the_same_tree(scale):
    rng = np.random.default_rng(3)
    states = rng.integers(-500, 500, (400, 3)).astype(np.float32)
    labels = (states[:, 0] + states[:, 1] > 0).astype(np.int64)
    (usual,) = histogram_trees(Demonstrations(states, labels, np.arange(400) // 40))
    scaled = (states.astype(np.float64) * scale).astype(np.float32)
    (other,) = histogram_trees(Demonstrations(scaled, labels, np.arange(400) // 40))
    assert np.array_equal(usual.feature, other.feature)
    assert np.array_equal(usual.counts, other.counts)
    unfiltered = mine_rules([other], supp_min=0.0, conf_min=1.0)
    decided = Shield(unfiltered).decide_batch(scaled, 1 - labels)
    assert np.array_equal(decided.executed, labels)


@pytest.mark.parametrize("task", TASKS)
def test_it_is_about_as_good_as_the_exact_learner_in_other_episodes(task):
    demonstrations = load_demonstrations(f"data/demonstrations/{task}.parquet")
    numbers = np.unique(demonstrations.episodes)
    mined = demonstrations.select(numbers[numbers % 3 != 0])
    other = demonstrations.select(numbers[numbers % 3 == 0])
    shares, sizes = [], []
    for learner in ("exact", "histogram"):
        trees = grow_policy_trees(mined, learner=learner, divider=4, min_support=0.001)
        assert {tree.learner for tree in trees} == {learner}
        sizes.append(sum(tree.n_nodes for tree in trees))
        right = [
            tree.label[tree.apply(other.observations)]
            == tree.dimension.labels_of(other.action_columns[:, tree.index])
            for tree in trees
        ]
        shares.append(float(np.mean(right)))
    assert shares[1] > shares[0] - 0.01
    assert sizes[1] == pytest.approx(sizes[0], rel=0.15)


def test_a_tree_is_the_same_again_and_knows_its_learner(lander_like):
    (one,), (two,) = histogram_trees(lander_like), histogram_trees(lander_like)
    assert one.digest == two.digest
    assert one.learner == "histogram"
    (exact,) = grow_policy_trees(lander_like)
    assert exact.learner == "exact"
    (shallow,) = histogram_trees(lander_like, max_depth=3)
    assert shallow.depth.max() == 3


@pytest.mark.parametrize("least", [0.005, 0.0101, 0.2, 1.0])
@pytest.mark.parametrize("learner", ["exact", "histogram"])
def test_no_node_below_the_minimum_support_is_split(lander_like, learner, least):
    (tree,) = grow_policy_trees(lander_like, learner=learner, min_support=least)
    assert (tree.support[tree.feature != LEAF] >= least).all()
    (full,) = grow_policy_trees(lander_like, learner=learner)
    assert tree.n_nodes < full.n_nodes
    # And every node with that support is split that can be.
    stopped = (tree.feature == LEAF) & (tree.support >= least) & (tree.confidence < 1.0)
    for node in np.flatnonzero(stopped):
        rows = tree.rows(int(node))
        assert best_impurity(lander_like, rows) >= gini(lander_like.actions[rows]) - 1e-6


@settings(max_examples=60)
@given(labelled_states(max_steps=120), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_rules_at_that_support_are_those_of_the_whole_tree(demonstrations, least, above, conf):
    supp = least + above * (1 - least)
    whole = grow_policy_trees(demonstrations)
    cut = grow_policy_trees(demonstrations, min_support=least)
    wanted = mine_rules(whole, supp_min=supp, conf_min=conf)
    assert mine_rules(cut, supp_min=supp, conf_min=conf).rules == wanted.rules


def test_a_part_is_regrown_by_the_learner_of_the_tree(lander_like, monkeypatch):
    monkeypatch.setattr(growth, "EXACT_UP_TO", 100)
    (tree,) = histogram_trees(lander_like)
    queries = next_queries(tree, 0, lander_like)
    assert queries[0].current
    assert queries[1].gain <= queries[0].gain
    other = queries[1]
    again = regrown(tree, 0, other.feature, other.threshold, lander_like)
    assert again.learner == "histogram"
    assert (again.feature[0], again.threshold[0]) == (other.feature, other.threshold)
    assert again.correct[again.feature == LEAF].sum() == len(lander_like)


def test_auto_takes_the_histogram_learner_for_many_pairs():
    assert learner_for("auto", growth.EXACT_UP_TO) == "exact"
    assert learner_for("auto", growth.EXACT_UP_TO + 1) == "histogram"
    assert learner_for("exact", 10**9) == "exact"


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"learner": "fast"}, "learner is 'fast'; choose one of exact, histogram, auto"),
        ({"learner": 3}, "learner is 3"),
        ({"min_support": 1.5}, "grown is 1.5; give 0 to 1"),
        ({"min_support": float("nan")}, "give 0 to 1"),
        ({"min_support": "all"}, "give 0 to 1"),
    ],
)
def test_what_is_no_learner_or_support_is_refused(lander_like, options, says):
    with pytest.raises(InputError, match=says):
        grow_policy_trees(lander_like, **options)


@pytest.mark.parametrize("learner", ["exact", "histogram"])
@pytest.mark.parametrize("task", ["cartpole", "lunar_lander_continuous"])
def test_trees_of_another_process_are_small_on_the_way_and_the_same_when_counted(task, learner):
    demonstrations = load_demonstrations(f"data/demonstrations/{task}.parquet")
    options = {"learner": learner, "min_support": 0.001, "divider": 5}
    sent = pickle.dumps(grow_structures(demonstrations, **options))
    trees = grow_policy_trees(demonstrations, **options)
    assert len(sent) < len(pickle.dumps(trees)) / 3
    counted = counted_trees(pickle.loads(sent), demonstrations, **options)
    assert [tree.digest for tree in counted] == [tree.digest for tree in trees]


@pytest.mark.parametrize("learner", ["exact", "histogram"])
def test_any_whole_number_is_a_seed(learner):
    steps = load_demonstrations("data/demonstrations/cartpole.parquet").select(range(4))
    small, large = (
        grow_policy_trees(steps, learner=learner, seed=seed)[0] for seed in (3, 2**32 + 3)
    )
    assert small.feature.tolist() == large.feature.tolist()
    assert small.threshold.tolist() == large.threshold.tolist()
