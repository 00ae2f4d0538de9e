"""What an action that breaks a rule becomes (the paper's Algorithm 2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule

Projection = Literal["centre", "clip", "expert"]

_FLOAT32 = np.dtype(np.float32)


@dataclass(frozen=True)
class Replacements:
    """The action each rule puts in place of one that breaks it.

    The action is the rule's target moved into [low, high], where target is the proposed action
    itself for ``clip``.

    Attributes:
        target: One value a rule; NaN stands for the proposed action, (rules,) float64.
        low: Least value of the actions' dtype that carries the rule's label, (rules,).
        high: Largest such value, (rules,).
    """

    target: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def many(self, rules: NDArray[np.int64], values: NDArray[Any]) -> NDArray[np.float64]:
        """Replace actions that break rules.

        Args:
            rules: The rule that each one breaks, (B,).
            values: Proposed actions, finite, (B,).

        Returns:
            Actions that carry the rules' labels, (B,).
        """
        target = self.target[rules]
        target = np.where(np.isnan(target), values, target)
        return np.clip(target, self.low[rules], self.high[rules])

    @cached_property
    def entries(self) -> list[tuple[float, float, float]]:
        """Target, low and high of each rule, for single actions."""
        columns = (self.target.tolist(), self.low.tolist(), self.high.tolist())
        return list(zip(*columns, strict=True))

    def one(self, rule: int, value: float) -> float:
        """Replace one action that breaks a rule.

        Args:
            rule: Its index.
            value: Proposed action, finite.

        Returns:
            An action that carries the rule's label.
        """
        target, low, high = self.entries[rule]
        if target != target:  # NaN, which stands for the proposed action
            target = value
        return min(max(target, low), high)


def replacements(
    rule_set: RuleSet, projection: Projection, dtype: np.dtype[Any] = _FLOAT32
) -> Replacements:
    """Work out every rule's replacement once.

    Args:
        rule_set: The rules.
        projection: How continuous actions are replaced.
        dtype: Of the actions that the environment takes.

    Returns:
        One entry a rule. A rule written by hand may have no demonstrated value, where the expert
        never was: ``expert`` then takes the centre of its interval.

    Raises:
        InputError: If ``expert`` is asked of mined rules that hold no demonstrated values, or
            no number of the dtype lies in a rule's interval.
    """
    if dtype.kind == "f" and dtype.itemsize > _FLOAT32.itemsize:
        dtype = _FLOAT32  # each of its numbers is one of the wider kind, too
    return _together(
        [
            _of_rule(rule, rule_set.actions[rule.dimension], projection, dtype)
            for rule in rule_set.rules
        ]
    )


def label_replacements(
    dimension: LabelledDimension, projection: Projection, dtype: np.dtype[Any] = _FLOAT32
) -> Replacements:
    """The same for what comes in the place of a forbidden label.

    Args:
        dimension: Of L labels.
        projection: How continuous actions are replaced; ``expert`` takes the centre of an interval,
            as a never-rule holds no value that was shown.
        dtype: Of the actions that the environment takes.

    Returns:
        One entry a label, whose values are not numbers where no number of the dtype lies there.
    """
    if dtype.kind == "f" and dtype.itemsize > _FLOAT32.itemsize:
        dtype = _FLOAT32
    return _together(
        [
            _of_label(label, dimension, projection, dtype, None)
            for label in range(dimension.n_labels)
        ]
    )


def _together(entries: Sequence[tuple[float, float, float]]) -> Replacements:
    target, low, high = np.array(entries, dtype=np.float64).reshape(-1, 3).T
    return Replacements(target.copy(), low.copy(), high.copy())


def _of_rule(
    rule: Rule, dimension: LabelledDimension, projection: Projection, dtype: np.dtype[Any]
) -> tuple[float, float, float]:
    """Target, low and high of a rule; none of a never-rule, whose target is the state's."""
    if rule.forbids:
        return np.nan, np.nan, np.nan
    undemonstrated = rule.origin == "manual" or not dimension.is_interval
    if projection == "expert" and rule.demonstrated_value is None and not undemonstrated:
        raise InputError(
            f"a rule for {dimension.label_names[rule.action][:60]} holds no demonstrated value, "
            "which the projection 'expert' needs; mine the rules again, or choose centre or clip"
        )
    entry = _of_label(rule.action, dimension, projection, dtype, rule.demonstrated_value)
    if rule.enabled and not entry[1] <= entry[2]:
        raise InputError(
            f"a rule asks for {dimension.label_names[rule.action][:60]}, and no number "
            f"of the kind that the environment takes ({dtype}) lies there; mine with a smaller "
            "divider"
        )
    return entry


def _of_label(
    label: int,
    dimension: LabelledDimension,
    projection: Projection,
    dtype: np.dtype[Any],
    demonstrated: float | None,
) -> tuple[float, float, float]:
    if not dimension.is_interval:
        value = float(dimension.actions[label])
        return value, value, value
    lower, upper = dimension.edges[label], dimension.edges[label + 1]
    last = label == dimension.n_labels - 1
    if dtype.kind == "f":
        low, high = _float_range(lower, upper, dtype, last=last)
    else:
        low, high = _whole_range(lower, upper, dtype, last=last)
    if projection == "clip":
        return np.nan, low, high
    target = dimension.centre(label)
    if projection == "expert" and demonstrated is not None:
        target = demonstrated
    # Rounded before it is moved into the interval, and not after: it might fall out of it.
    with np.errstate(over="ignore"):
        rounded = float(dtype.type(target)) if dtype.kind == "f" else float(round(target))
    return min(max(rounded, low), high), low, high


def _float_range(
    lower: float, upper: float, dtype: np.dtype[Any], *, last: bool
) -> tuple[float, float]:
    """Least and largest float of a kind in [lower, upper), or [lower, upper] if it is the last.

    The nearest one to an edge may lie on the wrong side of it.
    """
    kind: Any = dtype.type
    with np.errstate(over="ignore"):
        low, high = kind(lower), kind(upper)
    if float(low) < lower:
        low = np.nextafter(low, kind(np.inf))
    if float(high) > upper or (not last and float(high) >= upper):
        high = np.nextafter(high, kind(-np.inf))
    return float(low), float(high)


def _whole_range(
    lower: float, upper: float, dtype: np.dtype[Any], *, last: bool
) -> tuple[float, float]:
    """The same in whole numbers."""
    reach = np.iinfo(dtype)
    high = math.floor(upper) if last else math.ceil(upper) - 1
    return float(max(math.ceil(lower), reach.min)), float(min(high, reach.max))
