"""How often a shield switches on and off: an agent that is pulled to and fro is seen by it."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from sarl_core.environments.description import (
    describe_environment,
    make_environment,
    steps_a_second,
)
from sarl_core.environments.environment import EnvironmentOrId

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
def pace_of(env_id: EnvironmentOrId) -> Pace:
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
    fps = steps_a_second(env)
    env.close()
    return Pace(fps, "second") if fps else Pace(_STEPS, f"{_STEPS} steps")
