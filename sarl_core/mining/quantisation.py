"""What dividing continuous actions costs, seen from the demonstrations alone.

A rule names an interval and no value, so an action that follows it is known no better than the
interval is wide. Here an action is *snapped*: replaced by what a shield would put in its place if
its own interval were asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import require_every_step
from sarl_core.errors import InputError
from sarl_core.mining.labels import LabelledDimension, label_dimensions

Snapping = Literal["centre", "clip", "expert"]
SNAPPINGS: tuple[Snapping, ...] = get_args(Snapping)
STUDIED_DIVIDERS = (2, 3, 5, 9)

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Quantisation:
    """One action dimension of N demonstrated pairs, divided into k intervals.

    Attributes:
        dimension: Its intervals.
        divider: Their number k.
        counts: Demonstrated values in each, (k,) int64.
        medians: Median demonstrated value of each, its centre where there is none, (k,).
        errors: For each way to snap the root mean square of what it changes, in the action's
            unit.
    """

    dimension: LabelledDimension
    divider: int
    counts: NDArray[np.int64]
    medians: Floats
    errors: dict[Snapping, float]

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        make_read_only(self)

    @property
    def occupancy(self) -> Floats:
        """Share of the demonstrated values in each interval, (k,)."""
        return np.asarray(self.counts / self.counts.sum())

    @property
    def never_seen(self) -> tuple[int, ...]:
        """The intervals without a demonstrated value: no rule will ever ask for them."""
        return tuple(np.flatnonzero(self.counts == 0).tolist())

    @property
    def width(self) -> float:
        """From the lowest to the highest edge."""
        return self.dimension.edges[-1] - self.dimension.edges[0]

    def share_of_width(self, snapping: Snapping) -> float:
        """The error as a share of the whole range, to compare dimensions by.

        Args:
            snapping: How values are snapped.

        Returns:
            0 to 1.
        """
        return self.errors[snapping] / self.width if self.width else 0.0

    def targets(self, snapping: Snapping) -> Floats | None:
        """What the values of each interval become.

        Args:
            snapping: How values are snapped.

        Returns:
            Shape (k,); None where they stay what they are.
        """
        return _targets(self.dimension, self.medians, snapping)


def quantise(
    demonstrations: Demonstrations, dividers: Sequence[int] = STUDIED_DIVIDERS
) -> tuple[tuple[Quantisation, ...], ...]:
    """Divide every continuous action dimension in several ways.

    Args:
        demonstrations: N pairs.
        dividers: Numbers of intervals, 2 or more each.

    Returns:
        For each action dimension one entry a divider.

    Raises:
        InputError: If the actions are discrete or a sample, there is no divider, or one is out of
            range.
    """
    require_every_step(demonstrations, "trying dividers")
    if demonstrations.is_discrete:
        raise InputError(
            "the demonstrated actions are discrete, and there is nothing to divide; give "
            "demonstrations with continuous actions"
        )
    if not dividers:
        raise InputError("there is no divider to study; give at least one, such as 3")
    columns = demonstrations.action_columns
    divided = [label_dimensions(demonstrations, divider) for divider in dividers]
    return tuple(
        tuple(
            _quantised(dimensions[index], columns[:, index].astype(np.float64))
            for dimensions in divided
        )
        for index in range(columns.shape[1])
    )


def snap(
    values: NDArray[np.float32], dimension: LabelledDimension, targets: Floats | None
) -> NDArray[np.float32]:
    """Replace actions by what stands for their interval.

    Args:
        values: Actions of one dimension, (B,).
        dimension: Its intervals.
        targets: What the values of each become, (k,); None leaves them as they are.

    Returns:
        Shape (B,), float32.
    """
    if targets is None:
        return values
    return np.asarray(targets[dimension.labels_of(values)], dtype=np.float32)


def _quantised(dimension: LabelledDimension, values: Floats) -> Quantisation:
    labels = dimension.labels_of(values)
    counts = np.bincount(labels, minlength=dimension.n_labels)
    medians = np.array(
        [
            np.median(values[labels == label]) if counts[label] else dimension.centre(label)
            for label in range(dimension.n_labels)
        ]
    )
    errors: dict[Snapping, float] = {}
    for snapping in SNAPPINGS:
        targets = _targets(dimension, medians, snapping)
        moved = np.zeros(1) if targets is None else targets[labels] - values
        errors[snapping] = float(np.sqrt(np.mean(moved**2)))
    return Quantisation(dimension, dimension.n_labels, counts, medians, errors)


def _targets(dimension: LabelledDimension, medians: Floats, snapping: Snapping) -> Floats | None:
    if snapping == "clip":
        return None  # the nearest value in its own interval is the value itself
    if snapping == "expert":
        return medians
    return np.array([dimension.centre(label) for label in range(dimension.n_labels)])
