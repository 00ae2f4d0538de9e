"""What is known of failures without asking: a crash, a fall, whatever a task must not let happen.

Who knows more says so (`signals`).
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from sarl_core.environments.environment import EnvironmentOrId, as_environment

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
    "Driving": _EVERY_END,  # it ends by a crash alone
    "Pendulum": _NO_END,
    "MountainCar": _NO_END,  # it ends at the flag
    "MountainCarContinuous": _NO_END,
    "Acrobot": _NO_END,  # it ends when it has swung up
}


# The same for who knows only the task, of an episode.
_MEANINGS = {
    "LunarLander": "the lander crashes or leaves the field",
    "LunarLanderContinuous": "the lander crashes or leaves the field",
    "BipedalWalker": "the walker falls",
    "BipedalWalkerHardcore": "the walker falls",
    "CarRacing": "the car leaves the field",
    "CartPole": "the pole falls or the cart leaves its track",
    "InvertedPendulum": "the pole falls",
    "InvertedDoublePendulum": "the poles fall",
    "Driving": "the car crashes",
}

# Packages whose every environment says so itself, and by which key of `info`.
_INFO_KEYS = {"highway_env": "crashed"}


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
        Shape (E,); of an environment in which the ends do not tell, none.
    """
    meaning = _end_of_failure(env_id)
    if isinstance(meaning, float):
        return np.asarray(terminated & (last_rewards == meaning))
    return np.asarray(terminated & (meaning == _EVERY_END))


def ends_tell(env_id: str) -> bool:
    """Whether it is known which ends of an environment's episodes are failures, and some are.

    Args:
        env_id: Environment.

    Returns:
        False for an environment that this project knows nothing of, and for one that cannot fail.
    """
    return _end_of_failure(env_id) not in (None, _NO_END)


def info_key(env_id: str) -> str:
    """The key of ``info`` by which an environment says itself that it has failed.

    Args:
        env_id: Environment.

    Returns:
        "" where it is not known.
    """
    return _INFO_KEYS.get(_package(env_id), "")


def failure_known(environment: EnvironmentOrId) -> bool:
    """Whether it is known which of an environment's episodes are failures.

    Args:
        environment: Its id, or with what its caller calls a failure.

    Returns:
        False for an environment that neither this project nor its caller knows, and for one that
        cannot fail.
    """
    return not no_failures_text(environment)


def cannot_fail(environment: EnvironmentOrId) -> bool:
    """Whether no end of an environment's episodes is a failure.

    Args:
        environment: Its id, or with what its caller calls a failure.

    Returns:
        False where it is not known.
    """
    environment = as_environment(environment)
    return not environment.failure and _end_of_failure(environment.id) == _NO_END


def no_failures_text(environment: EnvironmentOrId) -> str:
    """Why nothing is said of failures in an environment.

    Args:
        environment: Its id, or with what its caller calls a failure.

    Returns:
        A clause; "" where it is known which of its episodes are failures.
    """
    environment = as_environment(environment)
    if environment.failure or ends_tell(environment.id) or info_key(environment.id):
        return ""
    if cannot_fail(environment):
        return "no end of this environment's episodes is a failure"
    return "nothing says which ends of this environment's episodes are failures"


def failure_text(environment: EnvironmentOrId) -> str:
    """What a failure is in an environment.

    Args:
        environment: Its id, or with what its caller calls a failure.

    Returns:
        As "an end with a last reward of -100"; "" where it is not known, or there is none.
    """
    environment = as_environment(environment)
    if environment.failure:
        return f"a step at which {environment.failure} is true"
    if key := info_key(environment.id):
        return f"a step at which the environment says {key}"
    meaning = _end_of_failure(environment.id)
    if isinstance(meaning, float):
        return f"an end with a last reward of {meaning:g}"
    return "an end that is no time limit" if meaning == _EVERY_END else ""


def failure_meaning(env_id: str, failure: str) -> str:
    """When an episode fails, for who knows only the task.

    Args:
        env_id: Environment.
        failure: What a failure was in it, as `failure_text` has it.

    Returns:
        As "the lander crashes or leaves the field" where that is what is known of the environment,
        or else as "it comes to a step at which speed > 9 is true"; "" where `failure` is.
    """
    own = _MEANINGS.get(_family(env_id))
    if own and failure == failure_text(env_id):
        return own
    return f"it comes to {failure}" if failure else ""


def _end_of_failure(env_id: str) -> str | float | None:
    return _FAILURES.get(_family(env_id))


def _family(env_id: str) -> str:
    return re.sub(r"-v\d+$", "", env_id.rsplit(":", 1)[-1])


def _package(env_id: str) -> str:
    """The package that an environment's class is from, as far as that can be told unmade."""
    from gymnasium.envs.registration import registry

    module, _, bare = env_id.rpartition(":")
    spec = registry.get(bare)
    if spec is not None and isinstance(spec.entry_point, str):
        module = spec.entry_point
    return module.partition(":")[0].partition(".")[0]
