"""The thresholds a person can choose: steps of the sliders, grids of the figures, neat jumps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.landscape import next_changes
from sarl_core.mining.tree import PolicyTree

# Most that is of interest happens below a support of 0.05, so the steps grow with the support.
_DECADE = (1, 1.5, 2, 2.5, 3, 4, 5, 6, 7, 8, 9)
SUPPORT_STEPS: tuple[float, ...] = (
    0.0,
    0.00001,
    0.00002,
    0.00005,
    *(float(f"{digit:g}e-{power}") for power in (4, 3, 2) for digit in _DECADE),
    *(step / 20 for step in range(2, 21)),
)
CONFIDENCE_STEPS: tuple[float, ...] = (
    *(step / 20 for step in range(10)),
    *(step / 100 for step in range(50, 90)),
    *(step / 200 for step in range(180, 201)),
)
FINE_SUPPORTS: tuple[float, ...] = (
    0.0,
    0.0002,
    0.0005,
    0.001,
    0.002,
    0.003,
    0.004,
    0.005,
    0.007,
    0.01,
    0.015,
    0.02,
    0.03,
    0.04,
    0.05,
    0.07,
    0.1,
    0.15,
    0.2,
    0.3,
    0.4,
    0.5,
)
FINE_CONFIDENCES: tuple[float, ...] = (
    0.0,
    0.1,
    0.2,
    0.3,
    0.4,
    0.5,
    0.55,
    0.6,
    0.65,
    0.7,
    0.75,
    0.8,
    0.85,
    0.9,
    0.92,
    0.94,
    0.95,
    0.96,
    0.97,
    0.98,
    0.99,
    1.0,
)


class Jumps(NamedTuple):
    """Neat thresholds at which the rule set differs from the present one; None where none does.

    Attributes:
        support_below: Largest change downwards.
        support_above: Nearest change upwards.
        confidence_below: Likewise for the minimum confidence.
        confidence_above: Likewise.
    """

    support_below: float | None
    support_above: float | None
    confidence_below: float | None
    confidence_above: float | None


def with_step(steps: Sequence[float], value: float) -> tuple[float, ...]:
    """The steps of a slider that can also show one more value.

    Args:
        steps: Ascending.
        value: Added where it is missing.

    Returns:
        Ascending.
    """
    return tuple(steps) if value in steps else tuple(sorted({*steps, value}))


def neat_point(trees: Sequence[PolicyTree], thresholds: Thresholds) -> Thresholds:
    """Thresholds with fewer decimals that give the same rules.

    Args:
        trees: One an action dimension.
        thresholds: Any.

    Returns:
        At most as high as those given.
    """
    for name, decimals in (("support", 3), ("confidence", 2)):
        edge = getattr(
            next_changes(
                trees,
                supp_min=thresholds.support,
                conf_min=thresholds.confidence,
                lift_min=thresholds.lift,
                max_depth=thresholds.max_depth,
            ),
            f"{name}_below",
        )
        value = getattr(thresholds, name)
        neat = neat_between(-1.0 if edge is None else edge, value, decimals=decimals)
        thresholds = (
            replace(thresholds, support=neat)
            if name == "support"
            else replace(thresholds, confidence=neat)
        )
    return thresholds


def neat_between(low: float, high: float, *, decimals: int = 2) -> float:
    """The number with the fewest decimals in an interval, so that people need read no more.

    Args:
        low: Exclusive.
        high: Inclusive, above `low`.
        decimals: At least so many are used where they help.

    Returns:
        A number in (low, high]; the largest of the shortest ones.
    """
    for digits in range(decimals, 17):
        value = float(round(math.floor(high * 10**digits + 1e-9) / 10**digits, digits))
        if low < value <= high:
            return value
    return high


def neat_jumps(trees: Sequence[PolicyTree], thresholds: Thresholds) -> Jumps:
    """Where to move a threshold so that the rule set changes, and no further than needed.

    A rule set is the same from just above one edge up to the next, so any number in between does;
    the shortest is given.

    Args:
        trees: One an action dimension.
        thresholds: In force.

    Returns:
        For each threshold the neighbours below and above.
    """

    def edges(at: Thresholds) -> tuple[float | None, float | None, float | None, float | None]:
        return next_changes(
            trees,
            supp_min=at.support,
            conf_min=at.confidence,
            lift_min=at.lift,
            max_depth=at.max_depth,
        )

    here = edges(thresholds)

    def beyond(place: int, value: float) -> float | None:
        moved = (
            replace(thresholds, support=value)
            if place < 2
            else replace(thresholds, confidence=value)
        )
        return edges(moved)[place]

    def below(place: int, decimals: int) -> float | None:
        edge = here[place]
        if edge is None:
            return None
        further = beyond(place, edge)
        return neat_between(-1.0 if further is None else further, edge, decimals=decimals)

    def above(place: int, decimals: int) -> float | None:
        start = here[place]
        if start is None:
            return None
        further = beyond(place, start)
        edge = math.nextafter(start, -math.inf)
        end = 1.0 if further is None else math.nextafter(further, -math.inf)
        # The nearest neat number, not the farthest: one decimal step up from the edge.
        near = math.floor(edge * 10**decimals + 1) / 10**decimals
        return neat_between(edge, min(end, max(near, start)), decimals=decimals)

    return Jumps(below(0, 3), above(1, 3), below(2, 2), above(3, 2))
