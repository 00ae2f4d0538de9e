"""Finding steps in a record: those that were changed, those of a rule, those of an episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.rollouts.steps import StepTable


@dataclass(frozen=True)
class StepFilter:
    """What a step has to be; every condition that is set must hold.

    Attributes:
        intervened: Only steps at which the shield changed the action.
        outside: Only steps outside the data of a rule that the proposed action breaks.
        rule: Only steps at which this rule is in force, by its index; None for any or none.
        episode: Only those of this episode, counted from 0; None for all.
    """

    intervened: bool = False
    outside: bool = False
    rule: int | None = None
    episode: int | None = None

    def rows(self, steps: StepTable) -> NDArray[np.int64]:
        """The rows of a table that it lets through.

        Args:
            steps: T of them.

        Returns:
            Their numbers, ascending.
        """
        start, stop = 0, len(steps)
        if self.episode is not None:  # episodes stand behind each other: no need to look at all
            ends = np.searchsorted(steps.episode, [self.episode, self.episode + 1])
            start, stop = int(ends[0]), int(ends[1])
        part = slice(start, stop)
        through = np.ones(stop - start, dtype=np.bool_)
        if self.intervened:
            through &= steps.intervened[part]
        if self.outside:
            through &= steps.outside[part]
        if self.rule is not None:
            through &= (steps.rules[part] == self.rule).any(axis=1)
        return start + np.flatnonzero(through)


def used_rules(steps: StepTable) -> NDArray[np.int64]:
    """The rules that were in force at some step, the most frequent first.

    Args:
        steps: T of them.

    Returns:
        Their indices.
    """
    used = steps.rules[steps.rules >= 0]
    counts = np.bincount(used) if len(used) else np.zeros(0, dtype=np.int64)
    order = np.argsort(-counts, kind="stable")
    return np.asarray(order[: int((counts > 0).sum())])
