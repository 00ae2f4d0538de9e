"""Trees grown best-first to a number of rules, and rule sets that cover every state.

The paper's trees are grown fully and cut by thresholds. Where few rules shall do as much as
possible, the number of leaves is what is given, and the queries that help most come first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.algorithm_1 import rules_at
from sarl_core.mining.growing.exact import fitted
from sarl_core.mining.growing.structure import TreeStructure, count_tree
from sarl_core.mining.labels import LabelledDimension, label_dimensions
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import LEAF, PolicyTree, source_of
from sarl_core.progress import Progress, report

MIN_RULES = 2
_LEAST_PAIRS = 5  # a mean of fewer values is no mean


def grow_budgeted_trees(
    demonstrations: Demonstrations,
    *,
    max_rules: int,
    weights: NDArray[np.float64] | None = None,
    scores: NDArray[np.float64] | None = None,
    divider: int = 2,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[PolicyTree, ...]:
    """Grow one tree an action dimension, the most helpful query first, to so many leaves.

    Args:
        demonstrations: N pairs.
        max_rules: Most leaves of each tree, `MIN_RULES` or more.
        weights: How much each pair matters, (N,), 0 or more; None for all alike.
        scores: How good the expert holds each label to be, (N, labels), of the one discrete
            action dimension. The tree then follows the scores (a regression tree) and a leaf
            says the label with the best mean; None to follow the labels shown, or for continuous
            dimensions the values shown: a leaf then says the interval of their mean.
        divider: Number of intervals of continuous dimensions.
        seed: For choosing among equally good queries.
        progress: Called with (trees grown, in all); returning False stops.

    Returns:
        One tree an action dimension; what a node says may differ from its most frequent label
        where weights or scores are given.

    Raises:
        InputError: If the number of rules or the divider is out of range.
        CancelledError: If `progress` returned False.
    """
    if max_rules < MIN_RULES:
        raise InputError(f"the budget is {max_rules} rules; give {MIN_RULES} or more")
    dimensions = label_dimensions(demonstrations, divider)
    if scores is not None and len(dimensions) != 1:
        raise ValueError("scores are for demonstrations of one action dimension")
    trees = []
    for index, dimension in enumerate(dimensions):
        report(progress, index, len(dimensions))
        if scores is not None:
            structure = _by_scores(demonstrations, scores, max_rules, weights, seed)
        elif dimension.is_interval:
            structure = _by_values(demonstrations, index, dimension, max_rules, weights, seed)
        else:
            structure = _by_labels(demonstrations, index, dimension, max_rules, weights, seed)
        trees.append(count_tree(structure, demonstrations, index, divider=divider))
    return tuple(trees)


def _by_labels(
    demonstrations: Demonstrations,
    index: int,
    dimension: LabelledDimension,
    max_rules: int,
    weights: NDArray[np.float64] | None,
    seed: int,
) -> TreeStructure:
    from sklearn.tree import DecisionTreeClassifier

    learner = DecisionTreeClassifier(criterion="gini", max_leaf_nodes=max_rules, random_state=seed)
    labels = dimension.labels_of(demonstrations.action_columns[:, index])
    structure = fitted(learner, demonstrations.observations, labels, weights)
    most_frequent = learner.classes_[learner.tree_.value[:, 0, :].argmax(axis=1)]
    return _saying(structure, most_frequent)


def _by_values(
    demonstrations: Demonstrations,
    index: int,
    dimension: LabelledDimension,
    max_rules: int,
    weights: NDArray[np.float64] | None,
    seed: int,
) -> TreeStructure:
    """Intervals have an order, which a tree that only knows names of labels would not see."""
    from sklearn.tree import DecisionTreeRegressor

    learner = DecisionTreeRegressor(
        max_leaf_nodes=max_rules, min_samples_leaf=_LEAST_PAIRS, random_state=seed
    )
    values = demonstrations.action_columns[:, index].astype(np.float64)
    structure = fitted(learner, demonstrations.observations, values, weights)
    return _saying(structure, dimension.labels_of(learner.tree_.value[:, 0, 0]))


def _by_scores(
    demonstrations: Demonstrations,
    scores: NDArray[np.float64],
    max_rules: int,
    weights: NDArray[np.float64] | None,
    seed: int,
) -> TreeStructure:
    from sklearn.tree import DecisionTreeRegressor

    learner = DecisionTreeRegressor(max_leaf_nodes=max_rules, random_state=seed)
    structure = fitted(learner, demonstrations.observations, scores, weights)
    return _saying(structure, learner.tree_.value[:, :, 0].argmax(axis=1))


def _saying(structure: TreeStructure, label: NDArray[np.int64]) -> TreeStructure:
    return without_idle_queries(replace(structure, label=label.astype(np.int64)))


def without_idle_queries(structure: TreeStructure) -> TreeStructure:
    """Take out the queries after which the same is said on both sides.

    Args:
        structure: With labels.

    Returns:
        A tree that says the same in every state, its nodes numbered anew from the root.
    """
    labels = structure.label
    if labels is None:
        raise ValueError("a tree without labels says nothing yet")
    left, right = structure.children_left, structure.children_right
    above = [0]  # parents before their children
    for node in above:
        if left[node] != LEAF:
            above += [int(left[node]), int(right[node])]
    alike: dict[int, int] = {}  # nodes below which one label is said, and that label
    for node in reversed(above):
        if left[node] == LEAF:
            alike[node] = int(labels[node])
        elif alike.get(int(left[node]), -1) == alike.get(int(right[node]), -2):
            alike[node] = alike[int(left[node])]
    nodes = [0]
    for node in nodes:
        if node not in alike:
            nodes += [int(left[node]), int(right[node])]
    place = {node: number for number, node in enumerate(nodes)}
    ends = np.array([node in alike for node in nodes])
    old = np.array(nodes)

    def child(side: NDArray[np.int64]) -> NDArray[np.int64]:
        return np.array(
            [
                LEAF if end else place[int(side[node])]
                for node, end in zip(nodes, ends, strict=True)
            ],
            dtype=np.int64,
        )

    return TreeStructure(
        feature=np.where(ends, LEAF, structure.feature[old]),
        threshold=structure.threshold[old],
        children_left=child(left),
        children_right=child(right),
        label=np.array([alike.get(node, int(labels[node])) for node in nodes], dtype=np.int64),
    )


def leaf_rules(trees: Sequence[PolicyTree]) -> RuleSet:
    """A rule set of all leaves: in every state one rule of each action dimension applies.

    Args:
        trees: One an action dimension.

    Returns:
        The rules, by action dimension and node; `RuleSet.cut` is "leaves".
    """
    return RuleSet(
        rules=tuple(
            rule for tree in trees for rule in rules_at(tree, np.flatnonzero(tree.feature == LEAF))
        ),
        actions=tuple(tree.dimension for tree in trees),
        source=source_of(trees),
        thresholds=Thresholds(0.0, 0.0),
        divider=trees[0].divider,
        cut="leaves",
    )
