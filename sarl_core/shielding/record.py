"""What a shield made of actions: the heart of the flight recorder."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

DecisionFields = tuple[Any, Any, tuple[int | None, ...], bool, float, bool, str | None]
"""The fields of a `Decision`, in their order."""


class Decision(NamedTuple):
    """What the shield made of one action; the heart of the flight recorder.

    Attributes:
        executed: The action to execute, in the environment's dtype; where it breaks no rule and
            has that dtype (and, where the environment is known, that shape) already, the proposed
            object itself. Where the action is `invalid` and passes, that object, too.
        proposed: The agent's action.
        rules: For each action dimension the index of the rule in force, in the rule set's
            order, or None.
        intervened: Whether the shield changed the action.
        margin: Distance of the state to the nearest threshold on the paths walked, in the
            feature's own unit; inf where there is no threshold, NaN where no path was walked.
        outside: Whether the state lies outside the data of a rule that the proposed action
            breaks: of one that changed it, or, where rules abstain, would have.
        invalid: Why no rule was asked, where the observation is no state or the action none of
            the space; else None.
    """

    executed: Any
    proposed: Any
    rules: tuple[int | None, ...]
    intervened: bool
    margin: float
    outside: bool = False
    invalid: str | None = None


class BatchDecision(NamedTuple):
    """What the shield made of B actions.

    Attributes:
        executed: In the environment's dtype, and in its shape where it is known, else in that
            of the proposed actions. Where invalid actions pass that this dtype cannot hold,
            B objects, each as `decide` gives it.
        proposed: The agent's actions; B objects where they are no array of numbers.
        rules: Index of the rule in force or -1, (B, m) int64.
        intervened: Shape (B,).
        margin: Shape (B,).
        outside: Shape (B,).
        invalid: Why no rule was asked, or None, (B,) objects.
    """

    executed: NDArray[Any]
    proposed: NDArray[Any]
    rules: NDArray[np.int64]
    intervened: NDArray[np.bool_]
    margin: NDArray[np.float64]
    outside: NDArray[np.bool_]
    invalid: NDArray[np.object_]


def with_passed(executed: NDArray[Any], proposed: NDArray[Any], unread: list[int]) -> NDArray[Any]:
    """Executed actions, with those that pass as they are.

    Args:
        executed: Of B steps.
        proposed: Of the same, B.
        unread: Rows of those that pass.

    Returns:
        B of them; objects where one that passes is no such action.
    """
    if not unread:
        return executed
    if proposed.dtype != np.object_ and proposed.shape == executed.shape:
        given = proposed[unread]
        with np.errstate(over="ignore", invalid="ignore"):
            held = given.astype(executed.dtype)
        if np.all((held == given) | (np.isnan(held) & np.isnan(given))):
            executed[unread] = held
            return executed
    objects = np.empty(len(executed), dtype=np.object_)
    for row, action in enumerate(executed):
        objects[row] = action
    for row in unread:
        objects[row] = proposed[row]
    return objects
