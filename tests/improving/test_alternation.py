"""Queries are chosen anew by what the rest of the tree makes of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations
from sarl_core.improving.alternation import (
    NewQuery,
    ScoredStates,
    alternated,
    exchanges_of,
    label_scores,
    rows_at,
    splits_of,
    without_query,
)
from sarl_core.improving.candidate import structure_of
from sarl_core.mining.budgeted_trees import grow_budgeted_trees
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.tree import LEAF


def shown(seed: int, states: int = 60, labels: int = 3) -> Demonstrations:
    """Small whole numbers, so that many are equal, and labels that hang on two of them."""
    generator = np.random.default_rng(seed)
    observations = generator.integers(0, 6, (states, 3)).astype(np.float32)
    wished = (observations[:, 0] + observations[:, 1] > 5).astype(np.int64)
    actions = np.where(
        generator.random(states) < 0.2, generator.integers(0, labels, states), wished
    )
    return Demonstrations(
        observations=observations, actions=actions, episodes=np.zeros(states, dtype=np.int64)
    )


def achieved(structure: TreeStructure, pairs: Demonstrations, scores: np.ndarray) -> float:
    said = structure.label[structure.apply(pairs.observations)]
    return float(scores[np.arange(len(said)), said].sum())


def states_of(pairs: Demonstrations) -> ScoredStates:
    return ScoredStates(pairs.observations, scores_of(pairs))


def scores_of(pairs: Demonstrations) -> np.ndarray:
    return label_scores(pairs, label_dimensions(pairs, 2)[0], 0)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 6))
def test_a_tree_never_gets_worse_and_never_larger(seed: int, rules: int) -> None:
    pairs = shown(seed)
    (tree,) = grow_budgeted_trees(pairs, max_rules=rules)
    before = structure_of(tree)
    changed = alternated(before, states_of(pairs), max_rules=rules)
    assert (changed.feature == LEAF).sum() <= rules
    assert achieved(changed, pairs, scores_of(pairs)) >= achieved(before, pairs, scores_of(pairs))


def test_what_a_greedy_tree_misses_comes_in_turns() -> None:
    """Of a chessboard, no first query helps; beside the others, each is needed."""
    generator = np.random.default_rng(0)
    observations = generator.random((400, 2), dtype=np.float32)
    actions = (observations > 0.5).sum(axis=1) % 2
    pairs = Demonstrations(
        observations=observations, actions=actions, episodes=np.zeros(400, dtype=np.int64)
    )
    (tree,) = grow_budgeted_trees(pairs, max_rules=4)
    before = structure_of(tree)
    changed = alternated(before, states_of(pairs), max_rules=4)
    assert achieved(before, pairs, scores_of(pairs)) < 0.8 * 400
    assert achieved(changed, pairs, scores_of(pairs)) == 400
    inner = changed.feature != LEAF
    assert changed.threshold[inner] == pytest.approx(0.5, abs=0.02)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_a_query_in_the_place_of_another_gains_what_it_says_and_no_border_gains_more(
    seed: int,
) -> None:
    pairs = shown(seed)
    scores = scores_of(pairs)
    (tree,) = grow_budgeted_trees(pairs, max_rules=5)
    structure = structure_of(tree)
    now = achieved(structure, pairs, scores)
    for node, rows in rows_at(structure, pairs.observations):
        if structure.feature[node] == LEAF:
            continue
        features = np.arange(3)
        for query in exchanges_of(structure, node, rows, features, states_of(pairs)):
            put = achieved(query.put_into(structure), pairs, scores)
            assert put - now == pytest.approx(query.gain)
            values = np.unique(pairs.observations[rows, query.feature])
            others = [
                NewQuery(0.0, node, query.feature, float(border))
                for border in (values[:-1] + values[1:]) / 2
            ]
            most = max(achieved(one.put_into(structure), pairs, scores) for one in others)
            assert put == pytest.approx(most)


def test_a_query_in_the_place_of_a_leaf_gains_what_it_says() -> None:
    pairs = shown(1, states=600)
    scores = scores_of(pairs)
    (tree,) = grow_budgeted_trees(pairs, max_rules=5)
    leaf = np.array([LEAF])
    alone = TreeStructure(leaf, np.zeros(1), leaf, leaf, scores.sum(axis=0).argmax(keepdims=True))
    seen = 0
    for structure in (
        alone,
        alternated(structure_of(tree), states_of(pairs), max_rules=2),
    ):
        now = achieved(structure, pairs, scores)
        for node, rows in rows_at(structure, pairs.observations):
            if structure.feature[node] != LEAF:
                continue
            for query in splits_of(node, rows, np.arange(3), states_of(pairs)):
                grown = query.put_into(structure)
                assert (grown.feature == LEAF).sum() == (structure.feature == LEAF).sum() + 1
                assert achieved(grown, pairs, scores) - now == pytest.approx(query.gain)
                seen += 1
    assert seen >= 2


def test_of_amounts_the_nearest_interval_is_best() -> None:
    generator = np.random.default_rng(0)
    pairs = Demonstrations(
        observations=generator.random((50, 2), dtype=np.float32),
        actions=generator.uniform(-2, 2, 50).astype(np.float32),
        episodes=np.zeros(50, dtype=np.int64),
        action_low=(-2.0,),
        action_high=(2.0,),
        bounds_from="action space",
    )
    (dimension,) = label_dimensions(pairs, 8)
    best = label_scores(pairs, dimension, 0).argmax(axis=1)
    np.testing.assert_array_equal(best, dimension.labels_of(pairs.action_columns[:, 0]))


@pytest.mark.parametrize("alike", [False, True])
def test_queries_that_nobody_meets_go(alike: bool) -> None:
    pairs = shown(3)
    if alike:  # nothing else is to be gained
        pairs = replace(pairs, actions=(pairs.observations[:, 0] > 2.5).astype(np.int64))
    (tree,) = grow_budgeted_trees(pairs, max_rules=2)
    structure = structure_of(tree)
    lone = NewQuery(0.0, 1, 2, 99.0, (0, 1)).put_into(structure)
    changed = alternated(lone, states_of(pairs), max_rules=3)
    assert (np.abs(changed.threshold) < 6).all()


def test_every_node_says_what_is_best_where_it_is_met() -> None:
    pairs = shown(5, states=200)
    (tree,) = grow_budgeted_trees(pairs, max_rules=6)
    before = structure_of(tree)
    changed = alternated(before, states_of(pairs), max_rules=6)
    assert changed.threshold.tolist() != before.threshold.tolist()
    for node, rows in rows_at(changed, pairs.observations):
        good = scores_of(pairs)[rows].sum(axis=0)
        assert good[changed.label[node]] == good.max()


def test_where_one_label_is_best_everywhere_nothing_is_asked() -> None:
    generator = np.random.default_rng(0)
    observations = generator.random((300, 3), dtype=np.float32)
    scores = generator.random((300, 15))
    scores[:, 9] += 2.0
    leaf = np.array([LEAF])
    alone = TreeStructure(leaf, np.zeros(1), leaf, leaf, np.array([9]))
    states = ScoredStates(observations, scores)
    assert not list(splits_of(0, np.arange(300), np.arange(3), states))
    assert len(alternated(alone, states, max_rules=16).feature) == 1


def test_a_child_takes_the_place_of_its_parent() -> None:
    (tree,) = grow_budgeted_trees(shown(2), max_rules=4)
    structure = structure_of(tree)
    left = int(structure.children_left[0])
    below = without_query(structure, 0, left)
    rows = shown(2).observations
    there = rows[rows[:, structure.feature[0]] <= structure.threshold[0]]
    np.testing.assert_array_equal(
        below.label[below.apply(there)], structure.label[structure.apply(there)]
    )
