"""Regrowing a part of a tree: a node asks another query, and what lies below it is grown anew.

What comes of it is a tree like any other, from which rules are mined as ever. All other nodes keep
their numbers, and their rules their ids; the new ones have numbers of their own, made from what
is asked on the way to them: the same at all thresholds, and whenever the same is done again.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import require_every_step
from sarl_core.errors import InputError, quoted
from sarl_core.mining.algorithm_1 import cut_nodes
from sarl_core.mining.editing.edits import Edit, Regrow
from sarl_core.mining.growing.growth import part_of_tree
from sarl_core.mining.growing.structure import TreeStructure, count_tree
from sarl_core.mining.rules import FIRST_REGROWN, LAST_REGROWN, Thresholds
from sarl_core.mining.tree import LEAF, PolicyTree

MOST_QUERIES = 8


class NextQuery(NamedTuple):
    """A query that a node may ask.

    Attributes:
        feature: Index of the feature.
        threshold: A state goes left where the feature is at most this.
        gain: By how much it lowers Gini's impurity of the node's labels, 0 to 1: the measure that
            a tree is grown by.
        left: Pairs that go left.
        right: Pairs that go right.
        current: Whether the node asks it now.
    """

    feature: int
    threshold: float
    gain: float
    left: int
    right: int
    current: bool = False


def next_queries(
    tree: PolicyTree, node: int, demonstrations: Demonstrations, *, most: int = MOST_QUERIES
) -> tuple[NextQuery, ...]:
    """The best queries that a node may ask: of each feature the best threshold.

    Args:
        tree: Of one action dimension.
        node: Number of the node, as `PolicyTree.number` has it.
        demonstrations: What the tree was grown from.
        most: How many, besides the one that the node asks now.

    Returns:
        First the one that it asks now, if it is no leaf; then the others, the best first, of
        equals the first feature's. Features that are the same in all pairs of the node have none.

    Raises:
        InputError: If there is no such node, or the tree is of other demonstrations.
    """
    place = _place_of(tree, node, demonstrations)
    rows = np.sort(tree.rows(place))
    labels = _labels(tree, demonstrations)[rows]
    states = demonstrations.observations[rows]
    queries = []
    if tree.feature[place] != LEAF:
        feature, threshold = int(tree.feature[place]), float(tree.threshold[place])
        queries.append(_query(states, labels, feature, threshold)._replace(current=True))
    others = []
    for feature in range(states.shape[1]) if len({*labels.tolist()}) > 1 else ():
        column = states[:, [feature]]
        stump = part_of_tree(column, labels, learner=tree.learner, max_depth=1)
        if stump.feature[0] != LEAF:
            others.append(_query(states, labels, feature, float(stump.threshold[0])))
    asks_now = [(one.feature, one.threshold) for one in queries]
    others = [one for one in others if (one.feature, one.threshold) not in asks_now]
    others.sort(key=lambda one: -one.gain)  # stable: of equals, the first feature stays the first
    return (*queries, *others[:most])


def regrown(
    tree: PolicyTree,
    node: int,
    feature: int,
    threshold: float,
    demonstrations: Demonstrations,
) -> PolicyTree:
    """Let a node ask a query, and grow the tree anew below it, fully, as the others are.

    Args:
        tree: Of one action dimension.
        node: Number of the node, as `PolicyTree.number` has it.
        feature: Index of the feature to ask about.
        threshold: A state goes left where the feature is at most this.
        demonstrations: What the tree was grown from.

    Returns:
        The tree with another part below the node; nothing else of it changes. The same object
        where the node asks this already, and nothing below it was regrown.

    Raises:
        InputError: If there is no such node or feature, if all pairs of the node lie on one side
            of the threshold, or if the tree is of other demonstrations.
    """
    place = _place_of(tree, node, demonstrations)
    rows = np.sort(tree.rows(place))
    if not len(rows):
        raise InputError(f"no pair reaches node {node}, so nothing can be grown there")
    d = demonstrations.observations.shape[1]
    if not 0 <= feature < d:
        raise InputError(f"there is no feature {feature} to ask about; give one of 0 to {d - 1}")
    if not math.isfinite(threshold):
        raise InputError(
            f"the threshold of the condition is {quoted(threshold)}; give a finite number"
        )
    below = _below(tree, place)
    same = (int(tree.feature[place]), float(tree.threshold[place])) == (feature, threshold)
    if same and (tree.number[below] < FIRST_REGROWN).all():
        return tree
    left = demonstrations.observations[rows, feature] <= np.float64(threshold)
    if left.all() or not left.any():
        low, high = np.sort(demonstrations.observations[rows, feature])[[0, -1]].tolist()
        raise InputError(
            f"all {len(rows):,} pairs of node {node} lie on one side of {threshold!r}; "
            + (
                f"give a threshold of at least {low!r} and below {high!r}"
                if low < high
                else "ask about another feature"
            )
        )
    labels = _labels(tree, demonstrations)
    parts = [
        part_of_tree(demonstrations.observations[side], labels[side], learner=tree.learner)
        for side in (rows[left], rows[~left])
    ]
    structure, number = _joined(tree, place, below, (feature, float(threshold)), parts)
    return replace(
        count_tree(
            structure, demonstrations, tree.index, divider=tree.divider, learner=tree.learner
        ),
        number=number,
    )


def regrown_trees(
    trees: Sequence[PolicyTree], edits: Iterable[Edit], demonstrations: Demonstrations
) -> tuple[PolicyTree, ...]:
    """The trees that edits make of others.

    Args:
        trees: One an action dimension.
        edits: The oldest first; those that regrow no part change nothing here.
        demonstrations: What the trees were grown from.

    Returns:
        One an action dimension, to mine and then to `apply` the same edits to.

    Raises:
        InputError: If a part cannot be regrown.
    """
    made = list(trees)
    for edit in edits:
        if isinstance(edit, Regrow):
            tree = tree_for(made, edit)
            made[edit.dimension] = regrown(
                tree, edit.node, edit.feature, edit.threshold, demonstrations
            )
    return tuple(made)


def tree_for(trees: Sequence[PolicyTree], edit: Regrow) -> PolicyTree:
    """The tree of which a part is to be regrown.

    Args:
        trees: One an action dimension.
        edit: Names the dimension.

    Returns:
        One of them.

    Raises:
        InputError: If there is no such dimension.
    """
    if not 0 <= edit.dimension < len(trees):
        raise InputError(
            f"there is no action dimension {edit.dimension} to regrow a part of; there are "
            f"{len(trees)}"
        )
    return trees[edit.dimension]


@dataclass(frozen=True, eq=False)
class Way:
    """The nodes on the way to a node at which a part can be regrown, so that it changes rules.

    Attributes:
        places: Node numbers, the root first; none at or below a node where a path is cut.
        rules: For each the rules that are cut below it, in as many.
    """

    places: tuple[int, ...]
    rules: tuple[int, ...]


def way_to(tree: PolicyTree, place: int, thresholds: Thresholds) -> Way:
    """Where on the way to a node a part can be regrown.

    Args:
        tree: With n nodes.
        place: Node number.
        thresholds: At which the paths of the tree are cut: what lies below a cut gives no rules,
            whatever is asked there.

    Returns:
        Nodes above the first cut.
    """
    cut = cut_nodes(
        tree,
        supp_min=thresholds.support,
        conf_min=thresholds.confidence,
        lift_min=thresholds.lift,
        max_depth=thresholds.max_depth,
    )
    path = tree.path(place)
    cuts = {*cut.tolist()}
    ends = next((at for at, one in enumerate(path) if one in cuts), len(path))
    places = path[:ends]
    begins = tree.sample_start[cut]
    start, end = tree.sample_start, tree.sample_start + tree.samples
    rules = [int(((begins >= start[one]) & (begins < end[one])).sum()) for one in places]
    return Way(places, tuple(rules))


def _place_of(tree: PolicyTree, node: int, demonstrations: Demonstrations) -> int:
    require_every_step(demonstrations, "regrowing a part of the tree")
    if tree.source.digest != demonstrations.digest:
        raise InputError(
            f"the tree of {tree.dimension.name!r} was grown from other demonstrations; give those "
            "it was grown from"
        )
    place = tree.place_of(node)
    if place is None:
        raise InputError(
            f"there is no node {node} in the tree of {tree.dimension.name!r}; choose one of those "
            "on the way to a rule"
        )
    return place


def _labels(tree: PolicyTree, demonstrations: Demonstrations) -> NDArray[np.int64]:
    values = demonstrations.action_columns[:, tree.index]
    return np.asarray(tree.dimension.labels_of(values), dtype=np.int64)


def _query(
    states: NDArray[np.float32], labels: NDArray[np.int64], feature: int, threshold: float
) -> NextQuery:
    goes_left = states[:, feature] <= np.float64(threshold)
    counts = [np.bincount(labels[side]) for side in (goes_left, ~goes_left)]
    left, right = (int(count.sum()) for count in counts)
    sides = sum(int(count.sum()) * _impurity(count) for count in counts) / max(len(labels), 1)
    gain = max(_impurity(np.bincount(labels)) - sides, 0.0)
    return NextQuery(feature, threshold, gain, left, right)


def _impurity(counts: NDArray[np.int64]) -> float:
    """Gini's: how often two pairs, drawn by chance, carry different labels."""
    whole = int(counts.sum())
    return 1.0 - float(np.square(counts / whole).sum()) if whole else 0.0


def _below(tree: PolicyTree, place: int) -> NDArray[np.bool_]:
    """Which nodes lie below one, (n,)."""
    below = np.zeros(tree.n_nodes, dtype=np.bool_)
    level = np.array([place])
    while len(inner := level[tree.feature[level] != LEAF]):
        level = np.concatenate([tree.children_left[inner], tree.children_right[inner]])
        below[level] = True
    return below


def _joined(
    tree: PolicyTree,
    place: int,
    below: NDArray[np.bool_],
    query: tuple[int, float],
    parts: Sequence[TreeStructure],
) -> tuple[TreeStructure, NDArray[np.int64]]:
    """A tree with two parts in the place of what lies below a node, and its nodes' numbers."""
    stays = np.flatnonzero(~below)
    before = int(np.searchsorted(stays, place)) + 1  # the parts come right behind the node
    sizes = [len(part.feature) for part in parts]
    behind = len(stays) - before
    n = len(stays) + sum(sizes)
    to = np.concatenate([np.arange(before), np.arange(n - behind, n)])
    moved = np.full(tree.n_nodes, LEAF, dtype=np.int64)
    moved[stays] = to
    columns: dict[str, NDArray[Any]] = {
        "feature": np.full(n, LEAF, dtype=np.int64),
        "threshold": np.zeros(n),
        "left": np.full(n, LEAF, dtype=np.int64),
        "right": np.full(n, LEAF, dtype=np.int64),
    }
    columns["feature"][to], columns["threshold"][to] = tree.feature[stays], tree.threshold[stays]
    inner = to[tree.feature[stays] != LEAF]
    for side, children in (("left", tree.children_left), ("right", tree.children_right)):
        columns[side][inner] = moved[children[stays][tree.feature[stays] != LEAF]]
    at = int(moved[place])
    columns["feature"][at], columns["threshold"][at] = query
    start = before
    for side, part, size in zip(("left", "right"), parts, sizes, strict=True):
        columns[side][at] = start
        end = start + size
        columns["feature"][start:end] = part.feature
        columns["threshold"][start:end] = part.threshold
        for child, children in (("left", part.children_left), ("right", part.children_right)):
            columns[child][start:end] = np.where(children == LEAF, LEAF, children + start)
        start = end
    label, number = np.full((2, n), -1, dtype=np.int64)
    label[to], number[to] = tree.label[stays], tree.number[stays]
    structure = TreeStructure(
        columns["feature"], columns["threshold"], columns["left"], columns["right"], label
    )
    _give_numbers(structure, number, at)
    return structure, number


def _give_numbers(structure: TreeStructure, number: NDArray[np.int64], at: int) -> None:
    """Number the nodes below one, each from the number above it and what was asked there."""
    waiting = [at]
    while waiting:
        node = waiting.pop()
        if structure.feature[node] == LEAF:
            continue
        asks = f"{number[node]} {structure.feature[node]} {structure.threshold[node]!r}"
        for side, children in (
            ("<=", structure.children_left),
            (">", structure.children_right),
        ):
            child = int(children[node])
            digest = hashlib.blake2b(f"{asks} {side}".encode(), digest_size=8).digest()
            room = LAST_REGROWN - FIRST_REGROWN + 1
            number[child] = FIRST_REGROWN + int.from_bytes(digest) % room
            waiting.append(child)
