"""The labels by which the actions of an environment are named, with rules and without."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sarl_core.environments.description import EnvironmentDescription
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet


def environment_dimensions(
    description: EnvironmentDescription, rule_set: RuleSet | None, *, divider: int = 2
) -> tuple[LabelledDimension, ...]:
    """The labels by which an environment's actions are named and coloured.

    Args:
        description: Of the environment.
        rule_set: Whose intervals are used where the actions are continuous, or None.
        divider: Number of intervals without a rule set.

    Returns:
        One entry an action dimension.
    """
    if description.action_low is None or description.action_high is None:
        return tuple(
            LabelledDimension(name, labels, first=first)
            for name, labels, first in zip(
                description.action_names,
                description.label_names,
                description.label_first,
                strict=True,
            )
        )
    if rule_set is not None:
        return rule_set.actions
    return tuple(
        LabelledDimension.of_edges(name, _edges(low, high, divider).tolist())
        for name, low, high in zip(
            description.action_names, description.action_low, description.action_high, strict=True
        )
    )


def _edges(low: float, high: float, divider: int) -> NDArray[np.float64]:
    """Edges of equal intervals; of [-1, 1] where a side is open, since any will do to colour."""
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        low, high = -1.0, 1.0
    return np.linspace(low, high, divider + 1)
