from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from sarl_core import InputError, grow_policy_trees
from tests.mining.oracle import fit
from tests.mining.strategies import labelled_states


@settings(max_examples=40)
@given(labelled_states())
def test_the_arrays_say_what_scikit_learn_says(demonstrations):
    (tree,) = grow_policy_trees(demonstrations)
    learner = fit(demonstrations.observations, demonstrations.actions)
    assert np.array_equal(
        tree.apply(demonstrations.observations), learner.apply(demonstrations.observations)
    )
    assert np.array_equal(tree.samples, learner.tree_.n_node_samples)
    # An argmax of fractions and one of counts agree: ties go to the lower label in both.
    expected = learner.classes_[learner.tree_.value[:, 0, :].argmax(axis=1)]
    assert np.array_equal(tree.label, expected)
    assert tree.depth.max() == learner.get_depth()


@settings(max_examples=40)
@given(labelled_states())
def test_rows_of_a_node_are_those_that_reach_it(demonstrations):
    (tree,) = grow_policy_trees(demonstrations)
    leaves = tree.apply(demonstrations.observations)
    for node in range(tree.n_nodes):
        reach = [row for row, leaf in enumerate(leaves) if node in tree.path(leaf)]
        assert sorted(tree.rows(node).tolist()) == reach
        assert tree.samples[node] == len(reach)
        counts = np.bincount(demonstrations.actions[reach], minlength=tree.dimension.n_labels)
        assert np.array_equal(tree.counts[node], counts)


def test_a_maximum_depth_is_kept(lander_like):
    (tree,) = grow_policy_trees(lander_like, max_depth=3)
    assert tree.depth.max() == 3


def test_arrays_cannot_be_changed(lander_like):
    (tree,) = grow_policy_trees(lander_like)
    with pytest.raises(ValueError, match="read-only"):
        tree.threshold[0] = 1.0


def test_the_same_seed_gives_the_same_tree(lander_like):
    (one,), (two,) = grow_policy_trees(lander_like), grow_policy_trees(lander_like)
    assert np.array_equal(one.threshold, two.threshold)
    assert np.array_equal(one.feature, two.feature)


def test_an_impossible_depth_is_refused(lander_like):
    with pytest.raises(InputError, match="maximum depth is 0"):
        grow_policy_trees(lander_like, max_depth=0)
