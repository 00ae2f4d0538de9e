"""Which ends of episodes are failures: a crash, a fall, whatever the task must not let happen."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

_EVERY_END, _NO_END = "every end", "no end"
# What an end that is no time limit means, of Gymnasium's own environments by their full names: of
# others nothing is guessed. Some end for good reasons too; there only a failure brings exactly
# this reward.
_FAILURES: dict[str, str | float] = {
    "LunarLander": -100.0,
    "LunarLanderContinuous": -100.0,
    "BipedalWalker": -100.0,
    "BipedalWalkerHardcore": -100.0,
    "CarRacing": -100.0,
    "CartPole": _EVERY_END,
    "InvertedPendulum": _EVERY_END,
    "InvertedDoublePendulum": _EVERY_END,
    "Hopper": _EVERY_END,
    "Walker2d": _EVERY_END,
    "Ant": _EVERY_END,
    "Humanoid": _EVERY_END,
    "Pendulum": _NO_END,
    "MountainCar": _NO_END,  # it ends at the flag
    "MountainCarContinuous": _NO_END,
    "Acrobot": _NO_END,  # it ends when it has swung up
}


def failed(
    env_id: str, terminated: NDArray[np.bool_], last_rewards: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which ends of episodes are failures.

    In LunarLander and BipedalWalker an episode also ends when the lander rests and when the
    walker arrives; there a failure is an end with a last reward of -100. In CartPole every end
    that is not a time limit is one, in MountainCar none is.

    Args:
        env_id: Environment.
        terminated: Whether the environment ended each episode, and no limit, (E,).
        last_rewards: Reward of each episode's last step, (E,).

    Returns:
        Shape (E,); of an environment in which it is not known, none.
    """
    meaning = _failure(env_id)
    if isinstance(meaning, float):
        return np.asarray(terminated & (last_rewards == meaning))
    return np.asarray(terminated & (meaning == _EVERY_END))


def failure_known(env_id: str) -> bool:
    """Whether it is known which ends of an environment's episodes are failures.

    Args:
        env_id: Environment.

    Returns:
        False for an environment that this project knows nothing of, and for one that cannot fail.
    """
    return not no_failures_text(env_id)


def cannot_fail(env_id: str) -> bool:
    """Whether no end of an environment's episodes is a failure.

    Args:
        env_id: Environment.

    Returns:
        False where it is not known.
    """
    return _failure(env_id) == _NO_END


def no_failures_text(env_id: str) -> str:
    """Why nothing is said of failures in an environment.

    Args:
        env_id: Environment.

    Returns:
        A clause; "" where it is known which ends of its episodes are failures.
    """
    if _failure(env_id) is None:
        return "nothing says which ends of this environment's episodes are failures"
    if cannot_fail(env_id):
        return "no end of this environment's episodes is a failure"
    return ""


def _failure(env_id: str) -> str | float | None:
    return _FAILURES.get(re.sub(r"-v\d+$", "", env_id.rsplit(":", 1)[-1]))
