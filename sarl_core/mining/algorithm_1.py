"""The paper's Algorithm 1: every path of a tree is cut at its first qualifying node."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Condition, Operator, Rule, Thresholds
from sarl_core.mining.thresholds.landscape import confidence_above
from sarl_core.mining.tree import PolicyTree, several_trees, source_of


def cut_nodes(
    tree: PolicyTree,
    *,
    supp_min: float,
    conf_min: float,
    lift_min: float = 0.0,
    max_depth: int | None = None,
) -> NDArray[np.int64]:
    """The nodes at which Algorithm 1 cuts the paths of a tree.

    Args:
        tree: With n nodes.
        supp_min: Minimum support.
        conf_min: Minimum confidence.
        lift_min: Minimum lift.
        max_depth: Nodes below this depth are ignored.

    Returns:
        Node numbers, ascending. No one lies below another.
    """
    qualifies = (tree.support >= supp_min) & (tree.confidence >= conf_min) & (tree.lift >= lift_min)
    if max_depth is not None:
        qualifies &= tree.depth <= max_depth
    # An ancestor has at least the node's support, so only its confidence can spare it.
    first = confidence_above(tree, lift_min=lift_min) < conf_min
    return np.flatnonzero(qualifies & first)


def is_cut(tree: PolicyTree, thresholds: Thresholds) -> NDArray[np.bool_]:
    """Whether `cut_nodes` cuts a path at each node.

    Args:
        tree: With n nodes.
        thresholds: At which it is cut.

    Returns:
        Shape (n,).
    """
    nodes = cut_nodes(
        tree,
        supp_min=thresholds.support,
        conf_min=thresholds.confidence,
        lift_min=thresholds.lift,
        max_depth=thresholds.max_depth,
    )
    cut = np.zeros(tree.n_nodes, dtype=np.bool_)
    cut[nodes] = True
    return cut


def mine_rules(
    demonstrations_or_trees: Demonstrations | PolicyTree | Sequence[PolicyTree],
    *,
    supp_min: float,
    conf_min: float,
    lift_min: float = 0.0,
    max_depth: int | None = None,
    divider: int | None = None,
) -> RuleSet:
    """Mine a rule set (the paper's Algorithm 1).

    Args:
        demonstrations_or_trees: N pairs, or the tree or trees grown from them.
        supp_min: Minimum support of a rule, 0 to 1.
        conf_min: Minimum confidence, 0 to 1.
        lift_min: Minimum lift, 0 or more: how many times as frequent the label is where the rule
            applies as among all pairs.
        max_depth: Longest rule, in queries; needs no new tree.
        divider: Number of intervals of continuous dimensions; 2 where not given, or what the
            trees were grown with.

    Returns:
        The rules, by action dimension and node; with their data boxes where demonstrations were
        given, since trees alone do not hold the states.

    Raises:
        InputError: If a threshold is out of range, there is nothing to mine, or the trees were
            grown with another divider.
    """
    thresholds = Thresholds(supp_min, conf_min, lift_min, max_depth)
    trees = mined_trees(demonstrations_or_trees, divider)
    rules = []
    for tree in trees:
        nodes = cut_nodes(
            tree, supp_min=supp_min, conf_min=conf_min, lift_min=lift_min, max_depth=max_depth
        )
        rules += rules_at(tree, nodes)
    return mined_set(rules, trees, thresholds, demonstrations_or_trees)


def mined_trees(
    demonstrations_or_trees: Demonstrations | PolicyTree | Sequence[PolicyTree],
    divider: int | None,
) -> tuple[PolicyTree, ...]:
    """The trees that rules are mined from.

    Args:
        demonstrations_or_trees: N pairs, or the tree or trees grown from them.
        divider: Number of intervals of continuous dimensions; 2 where not given, or what the
            trees were grown with.

    Returns:
        One an action dimension.

    Raises:
        InputError: If there is none, or they were grown with another divider.
    """
    if isinstance(demonstrations_or_trees, Demonstrations):
        trees = grow_policy_trees(
            demonstrations_or_trees, divider=2 if divider is None else divider
        )
    else:
        trees = several_trees(
            demonstrations_or_trees,
            "what rules are mined from must be Demonstrations, or trees grown from them,",
            "load some: load_demonstrations(path)",
        )
    if not trees:
        raise InputError("there is no tree to mine; give demonstrations, or grow the trees first")
    if divider not in (None, trees[0].divider):
        raise InputError(
            f"the divider is {divider} and the trees were grown with {trees[0].divider}; leave it "
            f"out, or grow them again: grow_policy_trees(demonstrations, divider={divider})"
        )
    return trees


def mined_set(
    rules: Sequence[Rule],
    trees: Sequence[PolicyTree],
    thresholds: Thresholds,
    demonstrations_or_trees: object,
) -> RuleSet:
    """Rules with what they were mined from, and how.

    Args:
        rules: Of all trees.
        trees: One an action dimension.
        thresholds: That the rules were mined at.
        demonstrations_or_trees: What the trees were made of.

    Returns:
        The rule set; with data boxes where demonstrations were given.
    """
    mined = RuleSet(
        rules=tuple(rules),
        actions=tuple(tree.dimension for tree in trees),
        source=source_of(trees),
        thresholds=thresholds,
        divider=trees[0].divider,
        learner=trees[0].learner,
    )
    if isinstance(demonstrations_or_trees, Demonstrations):
        return with_boxes(mined, demonstrations_or_trees)
    return mined


def rules_at(tree: PolicyTree, nodes: NDArray[np.int64]) -> list[Rule]:
    """The rules that a cut at these nodes gives.

    Args:
        tree: With n nodes.
        nodes: Node numbers, (k,), as `cut_nodes` gives them, or some of them.

    Returns:
        One rule a node, in their order.
    """
    numbers = zip(
        tree.number[nodes].tolist(),
        nodes.tolist(),
        tree.label[nodes].tolist(),
        tree.support[nodes].tolist(),
        tree.confidence[nodes].tolist(),
        tree.lift[nodes].tolist(),
        tree.samples[nodes].tolist(),
        strict=True,
    )
    return [
        Rule(
            id=f"{tree.index}.{number}",
            dimension=tree.index,
            conditions=conditions,
            action=label,
            support=support,
            confidence=confidence,
            lift=lift,
            samples=samples,
            demonstrated_value=_demonstrated(tree, node),
        )
        for (number, node, label, support, confidence, lift, samples), conditions in zip(
            numbers, conditions_to(tree, nodes), strict=True
        )
    ]


def _demonstrated(tree: PolicyTree, node: int) -> float | None:
    if not tree.dimension.is_interval:
        return None
    rows = tree.rows(node)
    return float(np.median(tree.demonstrated[rows])) if len(rows) else None


def conditions_to(tree: PolicyTree, nodes: NDArray[np.int64]) -> list[tuple[Condition, ...]]:
    """The queries on the way to each node; rules share the beginnings of their paths.

    Args:
        tree: With n nodes.
        nodes: Node numbers, (k,).

    Returns:
        One path a node.
    """
    known: dict[int, tuple[Condition, ...]] = {0: ()}
    parent, left = tree.parent.tolist(), tree.children_left.tolist()
    feature, threshold = tree.feature.tolist(), tree.threshold.tolist()
    result = []
    for node in nodes.tolist():
        missing = []
        at = node
        while at not in known:
            missing.append(at)
            at = parent[at]
        so_far = known[at]
        for below in reversed(missing):
            above = parent[below]
            op: Operator = "<=" if left[above] == below else ">"
            so_far = (*so_far, Condition(feature[above], op, threshold[above]))
            known[below] = so_far
        result.append(so_far)
    return result
