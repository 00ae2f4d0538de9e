"""Exact CART: every border between two values is tried."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.requirements import LARGEST
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.tree import LEAF

_SMALL = 2.0**-10  # a feature with no larger spread is multiplied before a tree is grown
_CROWDED = 1e-6  # and one of which half of the values lie as close together
_SCALED_TO = 20  # the power of two that spreads are brought to
_LARGEST_EXPONENT = 126  # of a float32, with some room
_LOOKED_AT = 1_000


def exact_structure(
    observations: NDArray[np.float32],
    labels: NDArray[np.int64],
    *,
    max_depth: int | None = None,
    seed: int = 0,
) -> TreeStructure:
    """Grow a tree of which each query is the best of all borders between two values.

    Args:
        observations: Shape (N, d), float32.
        labels: Shape (N,).
        max_depth: Of the tree; None grows it fully: a leaf is pure, or its states are the same.
        seed: For choosing among equally good queries.

    Returns:
        Its queries.
    """
    from sklearn.tree import DecisionTreeClassifier

    learner = DecisionTreeClassifier(
        criterion="gini", max_depth=max_depth, random_state=seed % 2**32
    )
    return fitted(learner, observations, labels)


def fitted(
    learner: Any,
    observations: NDArray[np.float32],
    targets: NDArray[Any],
    weights: NDArray[np.float64] | None = None,
) -> TreeStructure:
    """Fit a tree of scikit-learn to states of any scale, and read its queries.

    scikit-learn takes values within 1e-7 of each other for equal. Features that small are grown on
    multiplied by a power of two, which is exact, and so are the thresholds on the way back: the
    tree splits the states themselves as it split their multiples.

    Args:
        learner: A `DecisionTreeClassifier` or `DecisionTreeRegressor`; it is fitted.
        observations: Shape (N, d), float32.
        targets: Labels (N,), or values (N,) or (N, k).
        weights: Of the pairs, (N,), or None.

    Returns:
        Its queries, without labels.
    """
    # A formula may be infinite, which scikit-learn refuses; thresholds lie below the limit.
    if observations.max() > LARGEST or observations.min() < -LARGEST:
        observations = np.clip(observations, -LARGEST, LARGEST)
    exponents = _exponents(observations)
    states = np.ldexp(observations, exponents) if exponents.any() else observations
    learner.fit(states, targets, sample_weight=weights)
    tree = learner.tree_
    left = np.asarray(tree.children_left, dtype=np.int64)
    feature = np.where(left == LEAF, LEAF, tree.feature).astype(np.int64)
    threshold = np.array(tree.threshold, dtype=np.float64)
    inner = feature != LEAF
    threshold[inner] = np.ldexp(threshold[inner], -exponents[feature[inner]])
    return TreeStructure(
        feature=feature,
        threshold=threshold,
        children_left=left,
        children_right=np.asarray(tree.children_right, dtype=np.int64),
    )


def _exponents(observations: NDArray[np.float32]) -> NDArray[np.int64]:
    """By which powers of two features are multiplied, (d,); 0 for those of a usual scale."""
    low, high = observations.min(axis=0), observations.max(axis=0)
    width = high.astype(np.float64) - low
    # An outlier may hide how small the others are; some rows are enough to see it.
    some = np.sort(observations[:: max(1, len(observations) // _LOOKED_AT)].astype(np.float64), 0)
    half = len(some) // 2
    dense = (some[half:] - some[: len(some) - half]).min(axis=0)
    width = np.where((dense > 0) & (dense < _CROWDED), dense, width)
    small = (width > 0) & (width < _SMALL)
    exponents = np.zeros(observations.shape[1], dtype=np.int64)
    wanted = _SCALED_TO - np.frexp(width[small])[1]
    most = np.frexp(np.maximum(np.abs(low[small]), np.abs(high[small])))[1]
    exponents[small] = np.clip(wanted, 0, _LARGEST_EXPONENT - most)
    return exponents
