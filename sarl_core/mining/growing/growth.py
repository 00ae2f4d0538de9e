"""Growing the trees of demonstrations, by the learner that suits their number."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from numbers import Integral, Real
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import require_every_step
from sarl_core.errors import InputError, quoted, require
from sarl_core.memory import release
from sarl_core.mining.growing.exact import exact_structure
from sarl_core.mining.growing.histogram import BinnedStates, histogram_structure
from sarl_core.mining.growing.structure import TreeStructure, count_tree, tree_levels
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.tree import LEAF, Learner, PolicyTree

LearnerChoice = Literal["exact", "histogram", "auto"]
EXACT_UP_TO = 50_000
"""Of so many pairs an exact tree is grown while one waits."""


def learner_for(choice: LearnerChoice, pairs: int) -> Learner:
    """What grows trees of so many pairs.

    Args:
        choice: A learner, or "auto": up to `EXACT_UP_TO` pairs the exact one, then the histogram
            learner.
        pairs: How many.

    Returns:
        One of the two.

    Raises:
        InputError: If there is no such learner.
    """
    if choice not in get_args(LearnerChoice):
        raise InputError(
            f"the learner is {quoted(choice)}; choose one of {', '.join(get_args(LearnerChoice))}"
        )
    if choice != "auto":
        return choice
    return "histogram" if pairs > EXACT_UP_TO else "exact"


def grow_policy_trees(
    demonstrations: Demonstrations,
    *,
    divider: int = 2,
    max_depth: int | None = None,
    seed: int = 0,
    learner: LearnerChoice = "exact",
    min_support: float = 0.0,
) -> tuple[PolicyTree, ...]:
    """Grow one CART tree an action dimension (the paper's "Derive Safety Rules").

    Args:
        demonstrations: N pairs.
        divider: Number of intervals of each continuous dimension.
        max_depth: Of the trees; None grows them fully. A limit can also be set afterwards,
            at the thresholds, without growing anything again.
        seed: For choosing among equally good queries.
        learner: "exact" tries every border between two values; "histogram" those between at most
            1,024 bins of a feature, which takes a small part of the time for hundreds of thousands
            of pairs; "auto" chooses by their number, as `learner_for`. Counts are exact in any
            case. A leaf that no border between bins parts better stays mixed.
        min_support: No node with less support is split further: no rule at that minimum support,
            or a higher one, needs it. Rules at a lower one are not those of fully grown trees.
            The histogram learner then takes a part of the time, and may choose otherwise among
            equally good queries than it does without.

    Returns:
        One tree an action dimension.

    Raises:
        InputError: If the divider, the depth, the learner or the support is none, or the pairs are
            a sample.
    """
    must = "what trees are grown from must be Demonstrations"
    require(demonstrations, Demonstrations, must, "load them: load_demonstrations(path)")
    require_every_step(demonstrations, "growing trees")
    if max_depth is not None and not (isinstance(max_depth, Integral) and max_depth >= 1):
        raise InputError(f"the maximum depth is {quoted(max_depth)}; give 1 or more, or none")
    if not (isinstance(min_support, Real) and 0.0 <= min_support <= 1.0):
        raise InputError(
            f"the support down to which trees are grown is {quoted(min_support)}; give 0 to 1"
        )
    chosen = learner_for(learner, len(demonstrations))
    labels = [
        dimension.labels_of(demonstrations.action_columns[:, index])
        for index, dimension in enumerate(label_dimensions(demonstrations, divider))
    ]
    least = _least(float(min_support), len(demonstrations))
    states = demonstrations.observations
    if chosen == "histogram":
        bins = BinnedStates.of(states)
        structures = [
            histogram_structure(
                bins,
                column,
                least=least,
                max_depth=max_depth,
                seed=seed,
                last=index == len(labels) - 1,
            )
            for index, column in enumerate(labels)
        ]
        release()  # what small nodes have left: counting needs room, too
        return tuple(
            replace(
                count_tree(
                    structure, demonstrations, index, divider=divider, learner=chosen, leaves=leaves
                ),
                least_support=float(min_support),
            )
            for index, (structure, leaves) in enumerate(structures)
        )

    def grown(index: int) -> PolicyTree:
        structure = exact_structure(states, labels[index], max_depth=max_depth, seed=seed)
        tree = count_tree(structure, demonstrations, index, divider=divider)
        cut = tree if least <= 2 else _cut_back(tree, least, demonstrations)
        return replace(cut, least_support=float(min_support))

    if len(labels) == 1:
        return (grown(0),)
    from loky import cpu_count

    # scikit-learn lets other threads run while it grows a tree.
    with ThreadPoolExecutor(min(len(labels), cpu_count())) as threads:
        return tuple(threads.map(grown, range(len(labels))))


def part_of_tree(
    observations: NDArray[np.float32],
    labels: NDArray[np.int64],
    *,
    learner: Learner,
    max_depth: int | None = None,
) -> TreeStructure:
    """Grow what is to stand below a node of a tree.

    Args:
        observations: States that reach the node, (n, d).
        labels: Shape (n,).
        learner: That of the tree; where it is the histogram learner, few states are left to the
            exact one.
        max_depth: Of the part; None grows it fully.

    Returns:
        Its queries.
    """
    if learner == "histogram" and len(labels) > EXACT_UP_TO:
        return histogram_structure(
            BinnedStates.of(observations), labels, max_depth=max_depth, last=True
        )[0]
    return exact_structure(observations, labels, max_depth=max_depth)


def _least(min_support: float, pairs: int) -> int:
    """The fewest pairs that have a support, by the comparison that rules are cut by."""
    least = math.ceil(min_support * pairs)
    return next(some for some in (least - 1, least, least + 1) if some / pairs >= min_support)


def _cut_back(tree: PolicyTree, least: int, demonstrations: Demonstrations) -> PolicyTree:
    """A tree of which no node with fewer pairs is split.

    scikit-learn would stop there by itself, but then choose otherwise among equally good queries
    of the nodes that follow: the rules would be others.
    """
    is_split = (tree.feature != LEAF) & (tree.samples >= least)
    left = np.where(is_split, tree.children_left, LEAF)
    right = np.where(is_split, tree.children_right, LEAF)
    stays = np.sort(np.concatenate(tree_levels(left, right)))
    place = np.full(tree.n_nodes + 1, LEAF, dtype=np.int64)  # the last one is that of `LEAF`
    place[stays] = np.arange(len(stays))
    structure = TreeStructure(
        feature=np.where(is_split, tree.feature, LEAF)[stays],
        threshold=np.where(is_split, tree.threshold, 0.0)[stays],
        children_left=place[left[stays]],
        children_right=place[right[stays]],
    )
    cut = count_tree(structure, demonstrations, tree.index, divider=tree.divider)
    return replace(cut, number=stays)
