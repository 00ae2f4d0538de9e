"""Trees and their combinations: those that they ask about, and some with other ratios."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import Combination, DerivedFeature
from sarl_core.mining.combining.candidates import rounded_ratio
from sarl_core.mining.growing.structure import TreeStructure, count_tree
from sarl_core.mining.tree import LEAF, PolicyTree


def with_ratios(
    structure: TreeStructure,
    derived: Sequence[DerivedFeature],
    ratios: Mapping[int, float],
    *,
    observed: int,
) -> tuple[TreeStructure, list[DerivedFeature]]:
    """A tree some of whose combinations count their second feature otherwise.

    Args:
        structure: Over d observed and k derived features.
        derived: The k.
        ratios: For some nodes that ask about a combination its new ratio, before it is rounded.
        observed: Number d.

    Returns:
        The tree, and the k derived features with the new combinations behind them.
    """
    feature, both = structure.feature.copy(), list(derived)
    for node, ratio in ratios.items():
        queried = derived[int(feature[node]) - observed].definition
        if not isinstance(queried, Combination):
            raise ValueError(f"node {node} asks about no combination")
        first, second = queried.features
        moved = DerivedFeature(Combination(((first, 1.0), (second, rounded_ratio(ratio)))))
        if moved not in both:
            both.append(moved)
        feature[node] = observed + both.index(moved)
    return replace(structure, feature=feature), both


def over_queried(
    structures: Sequence[TreeStructure], derived: Sequence[DerivedFeature], *, observed: int
) -> tuple[list[TreeStructure], tuple[DerivedFeature, ...]]:
    """The same trees, with no combination that none of them asks about.

    Args:
        structures: Over d observed and k derived features.
        derived: The k.
        observed: Number d.

    Returns:
        The trees over the derived features that are left, and those, in their order.
    """
    features = np.concatenate([structure.feature for structure in structures])
    queried = np.array(
        [
            observed + place
            for place, one in enumerate(derived)
            # A formula stays: a person wrote it.
            if not isinstance(one.definition, Combination) or observed + place in features
        ],
        dtype=np.int64,
    )
    places = np.arange(observed + len(derived))
    places[queried] = observed + np.arange(len(queried))
    return (
        [
            replace(
                structure,
                feature=np.where(structure.feature == LEAF, LEAF, places[structure.feature]),
            )
            for structure in structures
        ],
        tuple(derived[place - observed] for place in queried.tolist()),
    )


def trees_over_used(
    trees: Sequence[PolicyTree], demonstrations: Demonstrations
) -> tuple[PolicyTree, ...]:
    """The same trees over demonstrations with those combinations that some of them ask about.

    Args:
        trees: One an action dimension.
        demonstrations: N pairs that they were grown from.

    Returns:
        As many.
    """
    structures, derived = over_queried(
        [
            TreeStructure(
                tree.feature, tree.threshold, tree.children_left, tree.children_right, tree.label
            )
            for tree in trees
        ],
        demonstrations.derived,
        observed=len(demonstrations.observed),
    )
    if len(derived) == len(demonstrations.derived):
        return tuple(trees)
    pairs = demonstrations.deriving(derived)
    return tuple(
        count_tree(structure, pairs, index, divider=trees[0].divider)
        for index, structure in enumerate(structures)
    )
