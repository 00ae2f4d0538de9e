"""Whether a state lies where the pairs of a rule lay: the evidence envelope.

A rule's half-spaces reach further than the demonstrations that it was mined from. What the shield
does out there is an extrapolation; here it is told from the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.rules import Rule

_LARGEST = float(np.finfo(np.float32).max)

Sides = tuple[tuple[float, ...], tuple[float, ...]]
"""Least and largest values of the d features."""


class Boxes:
    """The data boxes of a rule set; a rule without one reaches everywhere.

    Attributes:
        sides: Of each rule, by its index; None where it has no box.
    """

    def __init__(self, rules: Sequence[Rule], n_features: int) -> None:
        """Lay out the boxes.

        Args:
            rules: R rules.
            n_features: Length d of a state.
        """
        self._known = np.array([rule.box is not None for rule in rules], dtype=np.bool_)
        # One row a rule that has a box, so that a set without boxes takes no room.
        self._row = np.cumsum(self._known) - 1
        boxes = [rule.box for rule in rules if rule.box is not None]
        self._least = _side([box.least for box in boxes], n_features)
        self._most = _side([box.most for box in boxes], n_features)
        self.sides: Mapping[int, Sides | None] = _SidesByRule(self._at)

    def _at(self, rule: int) -> Sides | None:
        if not self._known[rule]:
            return None
        row = self._row[rule]
        return tuple(self._least[row].tolist()), tuple(self._most[row].tolist())

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


class _SidesByRule(dict[int, Sides | None]):
    """Plain numbers of the boxes that single states are held against, made when one is.

    Args:
        make: The sides of a rule's box.
    """

    def __init__(self, make: Callable[[int], Sides | None]) -> None:
        super().__init__()
        self._make = make

    def __missing__(self, rule: int) -> Sides | None:
        sides = self[rule] = self._make(rule)
        return sides


def _side(values: Sequence[tuple[float, ...]], n_features: int) -> NDArray[np.float64]:
    """One side of b boxes, (b, d); the largest float32 number stands for what is infinite."""
    side = np.array(values, dtype=np.float64).reshape(-1, n_features)
    infinite = np.abs(side) >= _LARGEST
    side[infinite] = np.copysign(np.inf, side[infinite])
    return side


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
