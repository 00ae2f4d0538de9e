"""What a rule asks of a combination: demonstrations over its two features, the line, the side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.demonstrations.derived import Combination
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import Bounds, Rule

MOST_POINTS = 1_200
_MARGIN = 0.04  # around the demonstrations, as a share of their width

Point = tuple[float, float]
Span = tuple[float, float]


@dataclass(frozen=True, eq=False)
class CombinationPlot:
    """One combination of a rule in the plane of its two features.

    Attributes:
        bounds: What the rule asks of the combination.
        features: Indices of the two features: across, and upwards.
        points: A sample of the demonstrated states, (P, 2).
        labels: What was done there, (P,).
        across: Where the axis of the first feature begins and ends.
        upwards: That of the second one.
        side: Corners of what the rule takes; () where nothing of it is in view.
        lines: The ends of each line where a bound lies; none that is out of view.
    """

    bounds: Bounds
    features: tuple[int, int]
    points: NDArray[np.float64]
    labels: NDArray[np.int64]
    across: Span
    upwards: Span
    side: tuple[Point, ...]
    lines: tuple[tuple[Point, Point], ...]


def combination_plots(
    demonstrations: Demonstrations,
    rule: Rule,
    dimension: LabelledDimension,
    features: Sequence[Feature],
    *,
    most: int = MOST_POINTS,
) -> tuple[CombinationPlot, ...]:
    """Every combination that a rule asks about, as it is drawn.

    Args:
        demonstrations: N states.
        rule: Of one action dimension.
        dimension: That one.
        features: Those that the rule's conditions are about.
        most: Points, at most.

    Returns:
        In the order of the rule's bounds; none where it asks about no combination.
    """
    # Evenly spaced, so that the same states are drawn every time, from all episodes.
    count = min(most, len(demonstrations))
    rows = np.linspace(0, len(demonstrations) - 1, count).astype(np.int64)
    labels = dimension.labels_of(demonstrations.action_columns[rows, rule.dimension])
    plots = []
    for bounds in rule.bounds:
        combination = features[bounds.feature].derived
        if not isinstance(combination, Combination):
            continue
        first, second = combination.features
        across, upwards = (
            _span(demonstrations.observations[:, place]) for place in (first, second)
        )
        plots.append(
            CombinationPlot(
                bounds,
                (first, second),
                demonstrations.observations[rows][:, [first, second]].astype(np.float64),
                labels,
                across,
                upwards,
                _side(combination, bounds, across, upwards),
                _lines(combination, bounds, across, upwards),
            )
        )
    return tuple(plots)


def _span(values: NDArray[np.float32]) -> Span:
    low, high = float(values.min()), float(values.max())
    room = _MARGIN * (high - low) or max(abs(low), 1.0) / 2
    return low - room, high + room


def _corners(across: Span, upwards: Span) -> tuple[Point, ...]:
    return (
        (across[0], upwards[0]),
        (across[1], upwards[0]),
        (across[1], upwards[1]),
        (across[0], upwards[1]),
    )


def _side(
    combination: Combination, bounds: Bounds, across: Span, upwards: Span
) -> tuple[Point, ...]:
    corners = _corners(across, upwards)
    for sign, bound in ((1.0, bounds.high), (-1.0, bounds.low)):
        if math.isfinite(bound):
            corners = _cut(corners, combination.ratio, bound, sign)
    return corners


def _cut(corners: Sequence[Point], ratio: float, bound: float, sign: float) -> tuple[Point, ...]:
    """What of a polygon lies where ``sign * (x + ratio * y - bound)`` is at most 0."""
    result: list[Point] = []
    for one, other in zip(corners, (*corners[1:], *corners[:1]), strict=True):
        here, there = (sign * (x + ratio * y - bound) for x, y in (one, other))
        if here <= 0.0:
            result.append(one)
        if (here < 0.0 < there) or (there < 0.0 < here):
            result.append(_between(one, other, here / (here - there)))
    return tuple(result) if len(result) > 2 else ()


def _between(one: Point, other: Point, share: float) -> Point:
    return (one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1]))


def _lines(
    combination: Combination, bounds: Bounds, across: Span, upwards: Span
) -> tuple[tuple[Point, Point], ...]:
    lines = []
    corners = _corners(across, upwards)
    for bound in (bounds.low, bounds.high):
        if not math.isfinite(bound):
            continue
        crossings = []
        for one, other in zip(corners, (*corners[1:], corners[0]), strict=True):
            here, there = (x + combination.ratio * y - bound for x, y in (one, other))
            if (here <= 0.0) != (there <= 0.0):
                crossings.append(_between(one, other, here / (here - there)))
        if len(crossings) == 2:
            lines.append((crossings[0], crossings[1]))
    return tuple(lines)
