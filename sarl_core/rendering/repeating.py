"""An agent that does what was done."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.spaces import Actions


@dataclass
class Repeating:
    """Does what was done in one episode, step by step, whatever the state.

    Attributes:
        actions: One column a dimension, (T, m).
        name: What it is called on screen.
        n_uniforms: None is needed.
        done: Number of steps so far.
    """

    actions: Actions
    name: str = "as recorded"
    n_uniforms: int = 0
    done: int = 0

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        """The next action, (1, m)."""
        self.done += 1
        return self.actions[self.done - 1 : self.done]
