"""How often a shield switches on and off: an agent that is pulled to and fro is seen by it."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.environments.description import describe_environment, make_environment

_STEPS = 100  # where an environment does not say how fast it runs


class Pace(NamedTuple):
    """By what the flips of a shield are counted.

    Attributes:
        steps: Steps of one unit: those of a second where the environment says how many pictures
            a second shows, else 100.
        unit: "second" or "100 steps".
    """

    steps: float
    unit: str

    @property
    def each(self) -> str:
        """The unit after a number: "a second" or "in 100 steps"."""
        return f"{'a' if self.unit == 'second' else 'in'} {self.unit}"

    def rate(self, flips: float, steps: float) -> float:
        """Flips a unit.

        Args:
            flips: How many there were.
            steps: In so many steps, of one episode or of several.

        Returns:
            As 1.5 a second; NaN without a step.
        """
        return flips * self.steps / steps if steps else float("nan")


@lru_cache(maxsize=64)
def pace_of(env_id: str) -> Pace:
    """By what the flips in an environment are counted.

    Args:
        env_id: What ``gymnasium.make`` takes.

    Returns:
        Its pace: one picture is drawn a step, so the pictures of a second are its steps.

    Raises:
        InputError: If the environment cannot be used.
    """
    describe_environment(env_id)
    env = make_environment(env_id)
    fps = env.metadata.get("render_fps")
    env.close()
    return Pace(float(fps), "second") if fps else Pace(_STEPS, f"{_STEPS} steps")


def count_flips(intervened: NDArray[np.bool_], episode: NDArray[np.int64]) -> NDArray[np.int64]:
    """How often the shield switched on or off in each episode.

    A flip is a step at which the shield changes the action and at the one before it did not, or
    the other way round. The first step of an episode is none.

    Args:
        intervened: Whether the shield changed the action, (T,), in the order of the steps.
        episode: Number of each step's episode, counted from 0 without a gap, ascending, (T,).

    Returns:
        One number an episode.
    """
    if not len(episode):
        return np.zeros(0, dtype=np.int64)
    flips = (intervened[1:] != intervened[:-1]) & (episode[1:] == episode[:-1])
    return np.bincount(episode[1:][flips], minlength=int(episode[-1]) + 1).astype(np.int64)
