"""Features of any scale are split, and a usual scale changes nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sarl_core import Demonstrations, Shield, grow_policy_trees, mine_rules
from sarl_core.mining.budgeted_trees import grow_budgeted_trees
from sarl_core.mining.tree import PolicyTree

N = 200


def states(seed: int) -> NDArray[np.float32]:
    return np.random.default_rng(seed).uniform(-1, 1, (N, 2)).astype(np.float32)


def demonstrations(observations: NDArray[np.float32], labels: NDArray[np.int64]) -> Demonstrations:
    return Demonstrations(observations, labels, np.arange(N) // 20)


def tree_of(observations: NDArray[np.float32], labels: NDArray[np.int64]) -> PolicyTree:
    return grow_policy_trees(demonstrations(observations, labels))[0]


@settings(max_examples=40)
@given(seed=st.integers(0, 10**6), exponent=st.integers(-100, 60), offset=st.floats(-3, 3))
def test_a_multiple_by_a_power_of_two_has_the_same_tree(
    seed: int, exponent: int, offset: float
) -> None:
    # Twelve binary digits, so that nothing is closer than scikit-learn tells apart by itself.
    observations = np.float32(np.round((states(seed) + offset) * 4096) / 4096)
    labels = (observations[:, 0] + observations[:, 1] > 2 * offset).astype(np.int64)
    usual = tree_of(observations, labels)
    other = tree_of(np.ldexp(observations, exponent), labels)
    assert np.array_equal(other.feature, usual.feature)
    asked = usual.feature >= 0
    assert np.array_equal(other.threshold[asked], np.ldexp(usual.threshold[asked], exponent))
    assert np.array_equal(other.counts, usual.counts)


@pytest.mark.parametrize("scale", [1e-4, 1e-6, 1e-9, 1e-20, 1e-38, 3e-43])
def test_tiny_features_are_mined_and_the_shield_acts_on_them(scale: float) -> None:
    observations = (states(0) * scale).astype(np.float32)
    border = np.median(observations[:, 0])
    labels = (observations[:, 0] > border).astype(np.int64)
    rules = mine_rules(demonstrations(observations, labels), supp_min=0.005, conf_min=0.95)
    assert rules.coverage == 1
    assert len(rules) == 2
    decided = Shield(rules).decide_batch(observations, 1 - labels)
    assert np.array_equal(decided.executed, labels)


@pytest.mark.parametrize("outlier", [1.0, -40.0])
def test_an_outlier_hides_nothing(outlier: float) -> None:
    observations = (states(0) * 1e-9).astype(np.float32)
    labels = (observations[:, 0] > 0).astype(np.int64)
    observations[7, 0], labels[7] = outlier, int(outlier > 0)
    tree = tree_of(observations, labels)
    assert tree.n_nodes == 3
    assert abs(tree.threshold[0]) < 1e-9


def test_tiny_values_far_from_zero() -> None:
    observations = np.float32(2.0**-12) + np.ldexp(np.round(states(0) * 64), -34)
    labels = (observations[:, 1] > np.median(observations[:, 1])).astype(np.int64)
    assert tree_of(observations.astype(np.float32), labels).n_nodes == 3


def test_trees_of_a_given_size_split_tiny_features_too() -> None:
    observations = (states(0) * 1e-9).astype(np.float32)
    labels = (observations[:, 0] > 0).astype(np.int64)
    (tree,) = grow_budgeted_trees(demonstrations(observations, labels), max_rules=2)
    assert tree.n_nodes == 3
    (tree,) = grow_budgeted_trees(
        Demonstrations(observations, np.float32(labels)[:, None], np.arange(N) // 20), max_rules=2
    )
    assert tree.n_nodes == 3
