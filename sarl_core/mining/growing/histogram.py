"""CART over bins: where there are many states, borders of a thousand bins are as good as all.

A feature's values become the numbers of bins that hold about as many states each, and a forest of
one tree is grown over those. With fewer values than bins every border between two of them is one.
What is between two bins is a threshold of the states themselves, so the tree asks about those.
"""

from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.requirements import LARGEST
from sarl_core.errors import needing_extras
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.tree import LEAF

BINS = 1_024
"""Of a feature, at most."""
_MOST_BINS = 64 * BINS  # the bins are made: the learner is to throw none of them together


def is_installed() -> bool:
    """Whether what grows such trees is there (the extra "large")."""
    return find_spec("sklearnex") is not None


@dataclass(frozen=True, eq=False)
class BinnedStates:
    """States as numbers of bins, which serve the trees of all action dimensions.

    Attributes:
        numbers: The bin of each value, (N, d) float32, as the learner reads them.
        borders: For each feature what lies between two bins, ascending, float64: a value is in
            bin 0 where it is at most the first.
    """

    numbers: NDArray[np.float32]
    borders: tuple[NDArray[np.float64], ...]

    @classmethod
    def of(cls, observations: NDArray[np.float32]) -> BinnedStates:
        """Find bins.

        Args:
            observations: Shape (N, d), float32.

        Returns:
            At most `BINS` a feature.
        """
        from loky import cpu_count

        numbers = np.empty(observations.shape, dtype=np.float32)

        def bin_feature(index: int) -> NDArray[np.float64]:
            # A formula may be infinite, and thresholds lie below the limit; NaN is at most none.
            values = np.fmax(np.fmin(observations[:, index], LARGEST), -LARGEST)
            # Much faster than to search the bin of each value.
            order = np.argsort(values)
            ascending = values[order]
            ends = _bin_ends(ascending)
            sizes = np.diff(ends, prepend=0, append=len(values))
            numbers[order, index] = np.repeat(np.arange(len(sizes)), sizes)
            # Exact, and strictly between the two: float64 has more than twice the digits.
            return (ascending[ends - 1].astype(np.float64) + ascending[ends]) / 2

        with ThreadPoolExecutor(cpu_count()) as threads:  # sorting and searching let others run
            borders = tuple(threads.map(bin_feature, range(observations.shape[1])))
        return cls(numbers, borders)


def histogram_structure(
    bins: BinnedStates,
    labels: NDArray[np.int64],
    *,
    least: int = 2,
    max_depth: int | None = None,
    seed: int = 0,
) -> TreeStructure:
    """Grow a tree of which each query asks about a border between two bins.

    Args:
        bins: Of N states.
        labels: Shape (N,).
        least: States that a node needs to be split.
        max_depth: Of the tree; None grows it fully: a leaf is pure, holds two states, or no border
            between bins parts its labels better.
        seed: For choosing among equally good queries.

    Returns:
        Its queries.

    Raises:
        WorkError: If the extra "large" is not installed.
    """
    with needing_extras():
        from sklearnex.ensemble import RandomForestClassifier

    forest = RandomForestClassifier(
        n_estimators=1,
        bootstrap=False,
        max_features=None,
        min_samples_split=max(2, least),
        max_depth=max_depth,
        max_bins=_MOST_BINS,
        random_state=seed,
    )
    # Beside the main thread it takes all cores, which is what it does in it, too, and warns.
    warnings.filterwarnings("ignore", "'Threading' parallel backend is not supported", UserWarning)
    tree = forest.fit(bins.numbers, labels).estimators_[0].tree_
    left = np.asarray(tree.children_left, dtype=np.int64)
    feature = np.where(left == LEAF, LEAF, tree.feature).astype(np.int64)
    # Where no state of a node lies in a bin, the border before it parts the same as that behind.
    border = np.floor(tree.threshold).astype(np.int64)
    threshold = np.zeros(len(left))
    for index, borders in enumerate(bins.borders):
        threshold[feature == index] = borders[border[feature == index]]
    return TreeStructure(
        feature=feature,
        threshold=threshold,
        children_left=left,
        children_right=np.asarray(tree.children_right, dtype=np.int64),
    )


def _bin_ends(ascending: NDArray[np.float32]) -> NDArray[np.int64]:
    """Behind which of the ascending values a bin ends: after about as many each, of equals all."""
    ends = np.flatnonzero(ascending[1:] != ascending[:-1]) + 1
    if len(ends) >= BINS:
        wanted = np.arange(1, BINS) * len(ascending) // BINS
        ends = np.unique(ends[np.minimum(np.searchsorted(ends, wanted), len(ends) - 1)])
    return ends
