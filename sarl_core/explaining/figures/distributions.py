"""Distributions of demonstrations as counts, so that a figure never holds a raw point."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.labels import LabelledDimension

_FEW_VALUES = 12
_SAMPLE = 20_000
_BINS = 48


@dataclass(frozen=True, eq=False)
class Histogram:
    """How often which values occur, for each label.

    Attributes:
        edges: Of B bins, ascending, (B + 1,).
        counts: Pairs of each label in each bin, (labels, B).
        values: The values themselves where there are only a few, one a bin; else None.
        infinite: Pairs whose value is infinite, as that of a formula may be: they are in no bin.
    """

    edges: NDArray[np.float64]
    counts: NDArray[np.int64]
    values: NDArray[np.float64] | None = None
    infinite: int = 0

    @property
    def total(self) -> int:
        """All pairs, infinite values included."""
        return int(self.counts.sum()) + self.infinite

    @property
    def centres(self) -> NDArray[np.float64]:
        """Middle of each bin, (B,)."""
        return (self.edges[:-1] + self.edges[1:]) / 2


@dataclass(frozen=True)
class FeatureRow:
    """One feature in numbers.

    Attributes:
        name: In words.
        unit: Its unit, "" without.
        low: Least value.
        median: Half of the pairs lie below it.
        high: Largest value.
    """

    name: str
    unit: str
    low: float
    median: float
    high: float


@dataclass(frozen=True, eq=False)
class EpisodeSeries:
    """One number an episode, in order, grouped where there are many episodes.

    Attributes:
        first: Number of the first episode of each group, counted from 1, (G,).
        last: Number of its last episode, (G,).
        mean: Mean over the group, (G,).
        low: Least of the group, (G,).
        high: Largest of the group, (G,).
        unfinished: Whether the recording stopped before the group's last episode ended, (G,).
    """

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    mean: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    unfinished: NDArray[np.bool_]

    @property
    def is_grouped(self) -> bool:
        """Whether a group holds more than one episode."""
        return bool((self.last > self.first).any())


def feature_rows(demonstrations: Demonstrations) -> tuple[FeatureRow, ...]:
    """Every feature in numbers.

    Args:
        demonstrations: N pairs with d features.

    Returns:
        d rows.
    """
    return tuple(map(feature_row, demonstrations.features, demonstrations.observations.T))


def counted_feature_rows(mined: MinedData) -> tuple[FeatureRow, ...]:
    """Every feature in numbers, of all pairs though only a sample is here.

    Args:
        mined: Over N pairs.

    Returns:
        d rows; where in its bin a median lies, the sample says.
    """
    box = mined.boxes[0][:, 0]  # of the root
    return tuple(
        FeatureRow(feature.name, feature.unit, float(low), median, float(high))
        for feature, low, median, high in zip(
            mined.sample.features, box[0], mined.medians, box[3], strict=True
        )
    )


def feature_row(feature: Feature, values: NDArray[np.float32]) -> FeatureRow:
    """One feature in numbers.

    Args:
        feature: What it is.
        values: Shape (N,), N >= 1; those of a formula may be infinite.

    Returns:
        The row.
    """
    # Of an infinite and a negatively infinite value none is the middle: then the lower one is.
    with np.errstate(invalid="ignore"):
        median = float(np.median(values))
    if np.isnan(median):
        median = -np.inf
    return FeatureRow(feature.name, feature.unit, float(values.min()), median, float(values.max()))


def histogram_by_label(
    values: NDArray[np.floating] | NDArray[np.int64],
    labels: NDArray[np.int64],
    n_labels: int,
    *,
    bins: int = 40,
) -> Histogram:
    """Count values in equal bins, each label on its own.

    Args:
        values: Shape (N,), N >= 1, no NaN.
        labels: Label of each, (N,), from 0 to n_labels - 1.
        n_labels: Number of labels.
        bins: Number of bins; fewer where only a few values occur.

    Returns:
        Counts that sum to N with the infinite ones; no bin where all are infinite.
    """
    finite = np.isfinite(values)
    if not finite.all():
        infinite = int((~finite).sum())
        if infinite == len(values):
            none = np.zeros((n_labels, 0), dtype=np.int64)
            return Histogram(np.zeros(1), none, infinite=infinite)
        counted = histogram_by_label(values[finite], labels[finite], n_labels, bins=bins)
        return replace(counted, infinite=infinite)
    few = _few_values(values)
    if few is not None:
        index = np.searchsorted(few, values)
        gap = float(np.diff(few).min()) if len(few) > 1 else 1.0
        middle = (few[:-1] + few[1:]) / 2
        edges = np.concatenate([[few[0] - gap / 2], middle, [few[-1] + gap / 2]])
        return Histogram(edges, _count(index, labels, n_labels, len(few)), few)
    low, high = float(values.min()), float(values.max())
    edges = np.linspace(low, high, bins + 1)
    scaled = (values.astype(np.float64) - low) * (bins / (high - low))
    index = np.minimum(scaled.astype(np.int64), bins - 1)
    return Histogram(edges, _count(index, labels, n_labels, bins))


def label_histogram(counts: NDArray[np.int64], dimension: LabelledDimension) -> Histogram:
    """Counted labels of an action dimension, one bin a label.

    Args:
        counts: Pairs of each label, (k,).
        dimension: With k labels.

    Returns:
        The counts between the edges of intervals; of names at 0 to k - 1.
    """
    edges = np.array(dimension.edges or np.arange(len(counts) + 1) - 0.5, dtype=np.float64)
    if edges[0] == edges[-1]:  # a single value, with some room beside it
        edges = edges[0] + np.array([-0.5, 0.5])
    return Histogram(edges, np.diag(counts))


def interval_histogram(values: NDArray[Any], dimension: LabelledDimension) -> Histogram:
    """Count the actions of a continuous dimension so that no bin crosses an interval's edge.

    Args:
        values: Actions of this dimension, (N,).
        dimension: With k intervals.

    Returns:
        Counts; actions outside the edges are in the outermost bins.
    """
    k = dimension.n_labels
    each = max(1, _BINS // k)
    bounds = dimension.edges
    if bounds[0] == bounds[-1]:  # a single value, with some room beside it
        bounds = (bounds[0] - 0.5, bounds[0] + 0.5)
    parts = [np.linspace(low, high, each, endpoint=False) for low, high in pairwise(bounds)]
    edges = np.concatenate([*parts, bounds[-1:]])
    index = np.searchsorted(edges[1:-1], values.astype(np.float64), side="right")
    return Histogram(edges, _count(index, index // each, k, k * each))


def episode_series(
    values: NDArray[np.float64] | NDArray[np.int64],
    finished: NDArray[np.bool_] | None,
    *,
    most: int = 240,
) -> EpisodeSeries:
    """One number an episode, in at most `most` groups of neighbours.

    Args:
        values: Shape (E,), E >= 1.
        finished: Whether each episode ended, (E,); None where it is not recorded.
        most: Number of groups at most.

    Returns:
        The groups, in order.
    """
    starts = np.unique(np.linspace(0, len(values), min(most, len(values)) + 1).astype(np.int64))
    starts, ends = starts[:-1], starts[1:]
    numbers = values.astype(np.float64)
    return EpisodeSeries(
        first=starts + 1,
        last=ends,
        mean=np.add.reduceat(numbers, starts) / (ends - starts),
        low=np.minimum.reduceat(numbers, starts),
        high=np.maximum.reduceat(numbers, starts),
        unfinished=np.zeros(len(starts), dtype=np.bool_)
        if finished is None
        else ~finished[ends - 1],
    )


def _few_values(
    values: NDArray[np.floating] | NDArray[np.int64],
) -> NDArray[np.float64] | None:
    """The distinct values if there are no more than a few, else None."""
    # A sample decides nearly always, and spares sorting a million values.
    step = max(1, len(values) // _SAMPLE)
    if len(np.unique(values[::step])) > _FEW_VALUES:
        return None
    distinct = np.unique(values)
    return distinct.astype(np.float64) if len(distinct) <= _FEW_VALUES else None


def _count(
    index: NDArray[np.int64], labels: NDArray[np.int64], n_labels: int, bins: int
) -> NDArray[np.int64]:
    flat = np.bincount(labels * bins + index, minlength=n_labels * bins)
    return flat.reshape(n_labels, bins).astype(np.int64)
