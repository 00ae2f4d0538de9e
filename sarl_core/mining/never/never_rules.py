"""Never-rules: where the expert was seen often enough, what it does not do there is forbidden.

A node forbids a label when it has the support, and the upper 95 % bound of the label's share among
its pairs is at most epsilon. On every path the first such node is the rule for the label, as
Algorithm 1 cuts a path at its first node that qualifies. Rules for different labels may overlap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from numbers import Real

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import require
from sarl_core.mining.algorithm_1 import conditions_to, mine_rules, mined_set, mined_trees
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.tree import PolicyTree

_CERTAINTY = 0.95  # one-sided: that the share is not larger


def upper_bound(count: NDArray[np.int64], of: NDArray[np.int64]) -> NDArray[np.float64]:
    """How large a share may be that was seen in a sample (Clopper and Pearson, 95 %, one-sided).

    Args:
        count: How many of the sample had it, any shape.
        of: Size of the sample, of a shape that fits.

    Returns:
        0 to 1; 1 where all had it, or nothing was sampled.
    """
    from scipy.special import betaincinv  # takes its time; most programs need none

    count, of = np.broadcast_arrays(count, of)
    bound = np.ones(count.shape)
    some = count < of
    bound[some] = betaincinv(count[some] + 1.0, of[some] - count[some], _CERTAINTY)
    return bound


def forbidding_nodes(
    tree: PolicyTree, *, epsilon: float, supp_min: float = 0.0, max_depth: int | None = None
) -> NDArray[np.bool_]:
    """The nodes that forbid labels.

    Args:
        tree: With n nodes.
        epsilon: Most that the upper bound of a forbidden label's share may be.
        supp_min: Minimum support.
        max_depth: Nodes below this depth are ignored.

    Returns:
        Whether a node is the first on its path that qualifies for a label, (n, labels).
    """
    qualifies = upper_bound(tree.counts, tree.samples[:, None]) <= epsilon
    qualifies &= (tree.support >= supp_min)[:, None]
    if max_depth is not None:
        qualifies &= (tree.depth <= max_depth)[:, None]
    above = np.zeros_like(qualifies)
    # Parents stand before their children, whichever learner numbered them by depth.
    for node in np.argsort(tree.depth, kind="stable")[1:].tolist():
        parent = tree.parent[node]
        above[node] = above[parent] | qualifies[parent]
    first: NDArray[np.bool_] = qualifies & ~above
    return first


def mine_never_rules(
    demonstrations_or_trees: Demonstrations | PolicyTree | Sequence[PolicyTree],
    *,
    epsilon: float,
    supp_min: float = 0.0,
    max_depth: int | None = None,
    divider: int | None = None,
) -> RuleSet:
    """Mine rules that forbid what the expert does at most rarely.

    Args:
        demonstrations_or_trees: N pairs, or the tree or trees grown from them.
        epsilon: A label is forbidden where the upper 95 % bound of its share is at most this; above
            0, below 1.
        supp_min: Minimum support of a rule, 0 to 1.
        max_depth: Longest rule, in queries.
        divider: Number of intervals of continuous dimensions; 2 where not given, or what the
            trees were grown with.

    Returns:
        The rules, by action dimension, label and node. With two labels a rule that forbids one
        demands the other. With their data boxes where demonstrations were given.

    Raises:
        InputError: If a threshold is out of range, there is nothing to mine, or the trees were
            grown with another divider.
    """
    thresholds = never_thresholds(epsilon, supp_min, max_depth)
    trees = mined_trees(demonstrations_or_trees, divider)
    rules = [
        rule
        for tree in trees
        for rule in never_rules_of(tree, epsilon=epsilon, supp_min=supp_min, max_depth=max_depth)
    ]
    return mined_set(rules, trees, thresholds, demonstrations_or_trees)


def with_never_rules(rule_set: RuleSet, trees: Sequence[PolicyTree], epsilon: float) -> RuleSet:
    """Rules that demand an action, and behind them what is forbidden where none of them applies.

    Args:
        rule_set: Mined from the trees, at some support and maximum depth.
        trees: One an action dimension.
        epsilon: As of `mine_never_rules`.

    Returns:
        Both; a shield asks the rules that demand first.

    Raises:
        InputError: If epsilon is out of range.
    """
    at = rule_set.thresholds
    forbidding = mine_never_rules(
        trees, epsilon=epsilon, supp_min=at.support, max_depth=at.max_depth
    )
    return replace(
        rule_set,
        rules=(*rule_set.rules, *forbidding.rules),
        thresholds=replace(at, never=epsilon),
    )


def mine_at(trees: Sequence[PolicyTree], thresholds: Thresholds) -> RuleSet:
    """Mine rules of either kind, or of both.

    Args:
        trees: One an action dimension.
        thresholds: Of rules that demand, that forbid, or that demand with others behind them.

    Returns:
        The rules.
    """
    support, depth, epsilon = thresholds.support, thresholds.max_depth, thresholds.never
    if epsilon is not None and not thresholds.demands:
        return mine_never_rules(trees, epsilon=epsilon, supp_min=support, max_depth=depth)
    demanding = mine_rules(
        trees,
        supp_min=support,
        conf_min=thresholds.confidence,
        lift_min=thresholds.lift,
        max_depth=depth,
    )
    return demanding if epsilon is None else with_never_rules(demanding, trees, epsilon)


def forbids_alone(rule_set: RuleSet) -> bool:
    """Whether all rules forbid, and there is one."""
    return rule_set.forbids and all(rule.forbids for rule in rule_set.rules)


def never_thresholds(
    epsilon: float, supp_min: float = 0.0, max_depth: int | None = None
) -> Thresholds:
    """The thresholds of never-rules alone.

    Args:
        epsilon: Most that a forbidden label's share may be, by its upper bound.
        supp_min: Minimum support.
        max_depth: Longest rule.

    Raises:
        InputError: If one is out of range.
    """
    must = "epsilon, the most that a forbidden action's share may be, must be a number"
    require(epsilon, Real, must, "give a share above 0 and below 1, as 0.1")
    return Thresholds(supp_min, 1.0, 0.0, max_depth, never=float(epsilon), demands=False)


def never_rules_of(
    tree: PolicyTree, *, epsilon: float, supp_min: float, max_depth: int | None = None
) -> list[Rule]:
    """The never-rules of one tree.

    Args:
        tree: Of one action dimension.
        epsilon: As of `mine_never_rules`.
        supp_min: Minimum support.
        max_depth: Longest rule.

    Returns:
        By label and node.
    """
    labels, nodes = np.nonzero(
        forbidding_nodes(tree, epsilon=epsilon, supp_min=supp_min, max_depth=max_depth).T
    )
    rules = []
    everywhere = 1.0 - tree.counts[0] / tree.samples[0]
    for label, node, conditions in zip(
        labels.tolist(), nodes.tolist(), conditions_to(tree, nodes), strict=True
    ):
        samples, counts = int(tree.samples[node]), tree.counts[node]
        obeyed = 1.0 - int(counts[label]) / samples
        order = [int(one) for one in np.argsort(-counts, kind="stable") if one != label]
        rules.append(
            Rule(
                id=f"{tree.index}n{label}.{tree.number[node]}",
                dimension=tree.index,
                conditions=conditions,
                action=order[0] if order else label,
                support=float(tree.support[node]),
                confidence=obeyed,
                lift=obeyed / float(everywhere[label]) if everywhere[label] else 1.0,
                samples=samples,
                forbids=(label,),
                instead=tuple(order),
            )
        )
    return rules
