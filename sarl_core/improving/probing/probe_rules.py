"""Never-rules of outcomes: what the expert could not recover from is forbidden."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations, derived_features
from sarl_core.improving.probing.outcomes import Outcomes
from sarl_core.mining.algorithm_1 import conditions_to
from sarl_core.mining.combining.queries import trees_over_used
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.growing.exact import fitted
from sarl_core.mining.growing.structure import count_tree
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.tree import LEAF, PolicyTree, source_of

_LEAST_STATES = 15  # of a leaf: a share of fewer is none


def probe_rules(
    pairs: Demonstrations, outcomes: Outcomes, *, leaves: int, risk: float, divider: int, seed: int
) -> RuleSet:
    """Rules that forbid what the expert does not recover from.

    Args:
        pairs: The probed states with the expert's actions, and what may be derived of them.
        outcomes: Of the same N states.
        leaves: Most of each tree.
        risk: A label is forbidden at a leaf where the expert failed after it in more than this
            share of the states.
        divider: Number of intervals of continuous dimensions.
        seed: For choosing among equally good queries.

    Returns:
        The rules. What all leaves below a node forbid is one rule there.
    """
    from sklearn.tree import DecisionTreeRegressor

    trees = []
    for index, failed in enumerate(outcomes.failed):
        learner = DecisionTreeRegressor(
            max_leaf_nodes=leaves, min_samples_leaf=_LEAST_STATES, random_state=seed
        )
        structure = fitted(learner, pairs.observations, failed.astype(np.float64))
        trees.append(count_tree(structure, pairs, index, divider=divider))
    used = trees_over_used(trees, pairs)
    queried = pairs.deriving(derived_features(used[0].source.features))
    rules = [
        rule
        for tree, failed in zip(used, outcomes.failed, strict=True)
        for rule in _rules_of(tree, _counts(tree, queried, failed), risk)
    ]
    return with_boxes(
        RuleSet(
            rules=tuple(rules),
            actions=tuple(tree.dimension for tree in used),
            source=source_of(used),
            thresholds=Thresholds(0.0, risk),
            divider=divider,
        ),
        queried,
    )


def _counts(
    tree: PolicyTree, pairs: Demonstrations, failed: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """In how many states of each node the expert failed after each label, (n, L)."""
    counts = np.zeros((tree.n_nodes, failed.shape[1]), dtype=np.int64)
    np.add.at(counts, tree.apply(pairs.observations), failed)
    for node in _upwards(tree):
        counts[tree.parent[node]] += counts[node]
    return counts


def _upwards(tree: PolicyTree) -> Sequence[int]:
    """All nodes but the root, the deepest first."""
    order: list[int] = np.argsort(-tree.depth, kind="stable").tolist()
    return order[:-1]


def _rules_of(tree: PolicyTree, counts: NDArray[np.int64], risk: float) -> list[Rule]:
    samples = tree.samples
    forbids = counts > risk * samples[:, None]
    # What the expert does most often there is left, whatever it costs: something must be.
    forbids[np.arange(tree.n_nodes), tree.counts.argmax(axis=1)] = False
    below = np.where((tree.feature == LEAF)[:, None], forbids, True)
    for node in _upwards(tree):
        below[tree.parent[node]] &= below[node]
    first = below.copy()
    first[1:] &= ~below[tree.parent[1:]]
    labels, nodes = np.nonzero(first.T)
    share = counts / samples[:, None]
    rules = []
    for label, node, conditions in zip(
        labels.tolist(), nodes.tolist(), conditions_to(tree, nodes), strict=True
    ):
        counts_there = tree.counts[node]
        order = tuple(int(one) for one in np.argsort(-counts_there, kind="stable") if one != label)
        confidence, everywhere = float(share[node, label]), float(share[0, label])
        rules.append(
            Rule(
                id=f"{tree.index}n{label}.{tree.number[node]}",
                dimension=tree.index,
                conditions=conditions,
                action=order[0],
                support=float(tree.support[node]),
                confidence=confidence,
                lift=confidence / everywhere if everywhere else 1.0,
                samples=int(samples[node]),
                origin="probed",
                forbids=(label,),
                instead=order,
            )
        )
    return rules
