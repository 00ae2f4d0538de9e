"""Growing the trees of demonstrations, by the learner that suits their number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, replace
from numbers import Integral, Real
from typing import Any, Literal, get_args

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


@dataclass(frozen=True, eq=False)
class GrownTree:
    """A tree that is grown and not yet counted.

    Attributes:
        structure: Its queries.
        leaves: The leaf that each of the N pairs reaches, (N,); None where that is not known yet.
    """

    structure: TreeStructure
    leaves: NDArray[np.int64] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes, where for a moment there are several copies: in as few bytes."""
        columns = (*(getattr(self.structure, each.name) for each in _COLUMNS), self.leaves)
        return _unpacked, tuple(map(_packed, columns))


_COLUMNS = fields(TreeStructure)


def _packed(column: NDArray[Any] | None) -> NDArray[Any] | None:
    """Whole numbers in the smallest type that holds them, others as they are."""
    if column is None or column.dtype.kind != "i" or not len(column):
        return column
    ends = (np.min_scalar_type(column.min()), np.min_scalar_type(column.max()))
    return column.astype(np.promote_types(*ends))


def _unpacked(*columns: Any) -> GrownTree:
    *parts, leaves = (
        column if column is None or column.dtype.kind == "f" else column.astype(np.int64)
        for column in columns
    )
    return GrownTree(TreeStructure(*parts), leaves)


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
            The histogram learner then takes a part of the time, but is not the same tree cut
            shorter: whether it sorts the states of a node of some hundred, or takes bins of them
            together, depends on how many nodes are to come.

    Returns:
        One tree an action dimension.

    Raises:
        InputError: If the divider, the depth, the learner or the support is none, or the pairs are
            a sample.
    """
    chosen = learner_for(learner, len(demonstrations))
    grown = grow_structures(
        demonstrations,
        divider=divider,
        max_depth=max_depth,
        seed=seed,
        learner=chosen,
        min_support=min_support,
    )
    return counted_trees(
        grown, demonstrations, divider=divider, learner=chosen, min_support=min_support
    )


def grow_structures(
    demonstrations: Demonstrations,
    *,
    divider: int = 2,
    max_depth: int | None = None,
    seed: int = 0,
    learner: LearnerChoice = "exact",
    min_support: float = 0.0,
) -> tuple[GrownTree, ...]:
    """The first half of `grow_policy_trees`, which may be done by another process.

    Args:
        demonstrations: As there.
        divider: Likewise.
        max_depth: Likewise.
        seed: Likewise.
        learner: Likewise.
        min_support: Likewise.

    Returns:
        What `counted_trees` takes, one an action dimension.

    Raises:
        InputError: As there.
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
    labels = [
        dimension.labels_of(demonstrations.action_columns[:, index])
        for index, dimension in enumerate(label_dimensions(demonstrations, divider))
    ]
    states = demonstrations.observations
    if learner_for(learner, len(demonstrations)) == "histogram":
        least = fewest_pairs(float(min_support), len(demonstrations))
        bins = BinnedStates.of(states)
        grown = tuple(
            GrownTree(
                *histogram_structure(
                    bins,
                    column,
                    least=least,
                    max_depth=max_depth,
                    seed=seed,
                    last=index == len(labels) - 1,
                )
            )
            for index, column in enumerate(labels)
        )
        release()  # what small nodes have left: counting needs room, too
        return grown

    def exact(column: NDArray[np.int64]) -> GrownTree:
        return GrownTree(exact_structure(states, column, max_depth=max_depth, seed=seed))

    if len(labels) == 1:
        return (exact(labels[0]),)
    from loky import cpu_count

    # scikit-learn lets other threads run while it grows a tree.
    with ThreadPoolExecutor(min(len(labels), cpu_count())) as threads:
        return tuple(threads.map(exact, labels))


def counted_trees(
    grown: Sequence[GrownTree],
    demonstrations: Demonstrations,
    *,
    divider: int,
    learner: Learner,
    min_support: float = 0.0,
) -> tuple[PolicyTree, ...]:
    """The second half of `grow_policy_trees`: what the expert did at every node.

    Args:
        grown: What `grow_structures` gave.
        demonstrations: Those that it was given.
        divider: Likewise.
        learner: What grew them.
        min_support: What was given there.

    Returns:
        One tree an action dimension.
    """
    least = fewest_pairs(float(min_support), len(demonstrations))

    def counted(index: int, one: GrownTree) -> PolicyTree:
        tree = count_tree(
            one.structure,
            demonstrations,
            index,
            divider=divider,
            learner=learner,
            leaves=one.leaves,
        )
        is_cut = learner == "exact" and least > 2
        cut = cut_back(tree, least, demonstrations) if is_cut else tree
        return replace(cut, least_support=float(min_support))

    return tuple(counted(index, one) for index, one in enumerate(grown))


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


def fewest_pairs(min_support: float, pairs: int) -> int:
    """The fewest pairs that have a support, by the comparison that rules are cut by.

    Args:
        min_support: From 0 to 1.
        pairs: How many there are.
    """
    least = math.ceil(min_support * pairs)
    return next(some for some in (least - 1, least, least + 1) if some / pairs >= min_support)


def cut_back(tree: PolicyTree, least: int, demonstrations: Demonstrations) -> PolicyTree:
    """A tree of which no node with fewer pairs is split.

    scikit-learn would stop there by itself, but then choose otherwise among equally good queries
    of the nodes that follow: the rules would be others.

    Args:
        tree: Fully grown.
        least: How many pairs.
        demonstrations: That it was counted over.

    Returns:
        The rest of it, counted; `least_support` is as it was.
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
    cut = count_tree(
        structure, demonstrations, tree.index, divider=tree.divider, learner=tree.learner
    )
    return replace(cut, number=stays)
