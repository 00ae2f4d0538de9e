"""What an action that breaks a rule becomes (the paper's Algorithm 2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import Rule, RuleSet

Projection = Literal["centre", "clip", "expert"]


@dataclass(frozen=True)
class Replacements:
    """The action each rule puts in place of one that breaks it.

    The action is the rule's target moved into [low, high], where target is the proposed action
    itself for ``clip``.

    Attributes:
        target: One value a rule; NaN stands for the proposed action, (rules,) float64.
        low: Least float32 value that carries the rule's label, (rules,).
        high: Largest such value, (rules,).
    """

    target: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    def many(self, rules: NDArray[np.int64], values: NDArray[Any]) -> NDArray[np.float64]:
        """Replace actions that break rules.

        Args:
            rules: The rule that each one breaks, (B,).
            values: Proposed actions, (B,).

        Returns:
            Actions that carry the rules' labels, (B,).
        """
        target = self.target[rules]
        target = np.where(np.isnan(target), values, target)
        # A proposed action that is no number has no nearest value; it goes to the lower edge.
        target = np.where(np.isnan(target), self.low[rules], target)
        return np.clip(target, self.low[rules], self.high[rules])

    def one(self, rule: int, value: float) -> float:
        """Replace one action that breaks a rule.

        Args:
            rule: Its index.
            value: Proposed action.

        Returns:
            An action that carries the rule's label.
        """
        return float(self.many(np.array([rule]), np.array([value]))[0])


def replacements(rule_set: RuleSet, projection: Projection) -> Replacements:
    """Work out every rule's replacement once.

    Args:
        rule_set: The rules.
        projection: How continuous actions are replaced.

    Returns:
        One entry a rule. A rule written by hand may have no demonstrated value, where the expert
        never was: ``expert`` then takes the centre of its interval.

    Raises:
        InputError: If ``expert`` is asked of mined rules that hold no demonstrated values.
    """
    entries = [
        _of_rule(rule, rule_set.actions[rule.dimension], projection) for rule in rule_set.rules
    ]
    target, low, high = np.array(entries, dtype=np.float64).reshape(-1, 3).T
    return Replacements(target.copy(), low.copy(), high.copy())


def _of_rule(
    rule: Rule, dimension: LabelledDimension, projection: Projection
) -> tuple[float, float, float]:
    if not dimension.is_interval:
        value = float(rule.action + dimension.first)
        return value, value, value
    lower, upper = dimension.edges[rule.action], dimension.edges[rule.action + 1]
    low, high = _float32_range(lower, upper, last=rule.action == dimension.n_labels - 1)
    if projection == "clip":
        return np.nan, low, high
    undemonstrated = rule.origin == "manual" and rule.demonstrated_value is None
    if projection == "centre" or undemonstrated:
        return dimension.centre(rule.action), low, high
    if rule.demonstrated_value is None:
        raise InputError(
            f"rule {rule.id} holds no demonstrated value, which the projection 'expert' needs; "
            "mine the rules again, or choose centre or clip"
        )
    return rule.demonstrated_value, low, high


def _float32_range(lower: float, upper: float, *, last: bool) -> tuple[float, float]:
    """Least and largest float32 number in [lower, upper), or [lower, upper] if it is the last.

    Actions are float32: the nearest one to an edge may lie on the wrong side of it.
    """
    low, high = np.float32(lower), np.float32(upper)
    if float(low) < lower:
        low = np.nextafter(low, np.float32(np.inf))
    if float(high) > upper or (not last and float(high) >= upper):
        high = np.nextafter(high, np.float32(-np.inf))
    return float(low), float(high)
