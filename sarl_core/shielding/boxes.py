"""Whether a state lies where the pairs of a rule lay: the evidence envelope.

A rule's half-spaces reach further than the demonstrations that it was mined from. What the shield
does out there is an extrapolation; here it is told from the rest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sarl_core.mining.evidence import DataBox
from sarl_core.mining.rules import Rule


class Boxes:
    """The data boxes of a rule set; a rule without one reaches everywhere."""

    def __init__(self, rules: Sequence[Rule], n_features: int) -> None:
        """Lay out the boxes.

        Args:
            rules: R rules.
            n_features: Length d of a state.
        """
        self._boxes: list[DataBox | None] = [rule.box for rule in rules]
        self._known = np.array([box is not None for box in self._boxes], dtype=np.bool_)
        shape = (int(self._known.sum()), n_features)
        boxes = [box for box in self._boxes if box is not None]
        # One row a rule that has a box, so that a set without boxes takes no room.
        self._row = np.cumsum(self._known) - 1
        self._least = np.array([box.least for box in boxes], dtype=np.float64).reshape(shape)
        self._most = np.array([box.most for box in boxes], dtype=np.float64).reshape(shape)

    @property
    def count(self) -> int:
        """Number of rules that have a box."""
        return len(self._least)

    def leaves_out(self, rule: int, state: list[float]) -> bool:
        """Whether one state lies outside the box of a rule.

        Args:
            rule: Its index.
            state: d values; one that is no number lies outside.

        Returns:
            False where the rule has no box.
        """
        box = self._boxes[rule]
        if box is None:
            return False
        for value, least, most in zip(state, box.least, box.most, strict=True):
            if not least <= value <= most:
                return True
        return False

    def leave_out(self, rules: NDArray[np.int64], states: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Whether states lie outside the boxes of rules, each as `leaves_out`.

        Args:
            rules: One index a state, (B,).
            states: Shape (B, d).

        Returns:
            Shape (B,).
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
