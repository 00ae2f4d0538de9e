"""Whether a state lies where the pairs of a rule lay: the evidence envelope.

A rule's half-spaces reach further than the demonstrations that it was mined from. What the shield
does out there is an extrapolation; here it is told from the rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.rules import Rule

_LARGEST = float(np.finfo(np.float32).max)

Sides = tuple[tuple[float, ...], tuple[float, ...]]
"""Least and largest values of the d features."""


class Boxes:
    """The data boxes of a rule set; a rule without one reaches everywhere.

    Attributes:
        sides: Of each rule, None where it has no box.
    """

    def __init__(self, rules: Sequence[Rule], n_features: int) -> None:
        """Lay out the boxes.

        Args:
            rules: R rules.
            n_features: Length d of a state.
        """
        self.sides: list[Sides | None] = [
            None if box is None else (tuple(map(_side, box.least)), tuple(map(_side, box.most)))
            for box in (rule.box for rule in rules)
        ]
        self._known = np.array([rule.box is not None for rule in rules], dtype=np.bool_)
        shape = (-1, n_features)
        # One row a rule that has a box, so that a set without boxes takes no room.
        self._row = np.cumsum(self._known) - 1
        sides = [one for one in self.sides if one is not None]
        self._least = np.array([least for least, _ in sides], dtype=np.float64).reshape(shape)
        self._most = np.array([most for _, most in sides], dtype=np.float64).reshape(shape)

    @property
    def count(self) -> int:
        """Number of rules that have a box."""
        return len(self._least)

    def leave_out(self, rules: NDArray[np.int64], states: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Whether states lie outside the boxes of rules, each as `leaves_out`.

        Args:
            rules: One index a state, (B,).
            states: Shape (B, d).

        Returns:
            Shape (B,); False where a rule has no box.
        """
        outside = np.zeros(len(rules), dtype=np.bool_)
        if not self.count:
            return outside
        known = np.flatnonzero(self._known[rules])
        rows = self._row[rules[known]]
        beyond = np.zeros(len(known), dtype=np.bool_)
        # Feature by feature: all at once would take d times the memory of a large batch.
        for feature in range(states.shape[1]):
            values = states[known, feature]
            beyond |= ~(
                (values >= self._least[rows, feature]) & (values <= self._most[rows, feature])
            )
        outside[known] = beyond
        return outside


def _side(value: float) -> float:
    """A side of a box; the largest float32 number stands for what is infinite, of a formula."""
    return math.copysign(math.inf, value) if abs(value) >= _LARGEST else value


def leaves_out(sides: Sides, state: list[float]) -> bool:
    """Whether one state lies outside a box.

    Args:
        sides: Of the box.
        state: d values; one that is no number lies outside.

    Returns:
        Whether any value does.
    """
    lower, upper = sides
    # A plain loop and a plain `zip`: `any` or equal lengths would take a quarter longer, at every
    # intervention.
    for value, least, most in zip(state, lower, upper):  # noqa: B905, SIM110
        if not least <= value <= most:
            return True
    return False
