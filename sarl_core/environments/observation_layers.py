"""Whose observations rules meet: an environment's own, or what a wrapper made of them.

Of an environment whose id is known the names of its features are known too, but only as long as
no wrapper has put other numbers in their places.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from sarl_core.environments.naming import OwnNames, own_names
from sarl_core.errors import InputError

# Wrappers that hand observations on as they are, or lay them flat, by package and class.
_HAND_ON = {
    "gymnasium": [
        "Wrapper",
        "ActionWrapper",
        "RewardWrapper",
        "OrderEnforcing",
        "PassiveEnvChecker",
        "TimeLimit",
        "Autoreset",
        "RecordEpisodeStatistics",
        "RecordVideo",
        "HumanRendering",
        "RenderCollection",
        "NormalizeReward",
        "RepeatAction",
        "StickyAction",
        "FlattenObservation",
    ],
    "stable_baselines3": ["Monitor", "VecMonitor", "VecCheckNan", "VecVideoRecorder"],
    "sarl_core": ["ShieldedEnv", "ShieldedVecEnv"],
}
_WRAPPED = re.compile(r"((?:<\w+)*)<([^<>]+)>+")  # as Gymnasium writes <TimeLimit<CartPole-v1>>


class Observed(NamedTuple):
    """Whose observations they are.

    Attributes:
        owner: In a sentence, as "CartPole-v1" or "CartPole-v1 behind FilterObservation".
        env_id: Of the environment whose features they are; "" where a wrapper may have changed
            what they are, or nothing says.
        names: What the environment, or a wrapper, calls them itself.
    """

    owner: str
    env_id: str
    names: OwnNames = OwnNames()


class Layer(NamedTuple):
    """A wrapper.

    Attributes:
        name: Of its class.
        classes: That it may be of; none where that is not known.
    """

    name: str
    classes: tuple[type, ...]


def observed(env: gymnasium.Env[Any, Any]) -> Observed:
    """Say whose observations an environment shows.

    Args:
        env: Wrapped or not.

    Returns:
        Whose they are.

    Raises:
        InputError: If they are normalised.
    """
    outer = behind(_layers(env), str(getattr(env.spec, "id", None) or ""))
    d = int(gymnasium.spaces.utils.flatdim(env.observation_space))
    m = int(np.prod(env.action_space.shape or ()))
    return outer._replace(names=own_names(same_observations(env), d, (), m))


def same_observations(env: gymnasium.Env[Any, Any]) -> list[gymnasium.Env[Any, Any]]:
    """The layers of an environment whose observations are those that it shows.

    Args:
        env: Wrapped or not.

    Returns:
        The outermost first; the last one is where the observations come from.
    """
    layers = [env]
    within = as_registered(env)
    while (
        (layer := layers[-1]) is not within
        and isinstance(layer, gymnasium.Wrapper)
        and hands_on(type(layer), "step", "reset")
    ):
        layers.append(layer.env)
    return layers


def as_registered(env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any]:
    """The environment that an id stands for, within whatever was put around it.

    It may have wrappers of its own; Gymnasium puts `OrderEnforcing` around it.

    Args:
        env: Wrapped or not.

    Returns:
        One of its layers.
    """
    while isinstance(env, gymnasium.Wrapper):
        enforcing = type(env) is gymnasium.wrappers.OrderEnforcing
        env = env.env
        if enforcing:
            break
    return env


def behind(layers: Iterable[Layer], env_id: str) -> Observed:
    """Say whose observations come through wrappers; the one place that decides it.

    Args:
        layers: The wrappers, the outermost first.
        env_id: Of the environment in them; "" if unknown.

    Returns:
        Whose they are.

    Raises:
        InputError: If one of the wrappers normalises them.
    """
    owner = env_id.rsplit(":", 1)[-1] or "the environment"
    for name, classes in layers:
        if any(issubclass(one, gymnasium.wrappers.NormalizeObservation) for one in classes):
            raise normalised(name)
        if not classes or not all(hands_on(one, "step", "reset") for one in classes):
            return Observed(f"{owner} behind {name}", "")
        if gymnasium.wrappers.OrderEnforcing in classes:
            break  # what comes within belongs to the environment of that id
    return Observed(owner, env_id)


def normalised(name: str) -> InputError:
    """What to say of observations that a wrapper normalises.

    Args:
        name: Of the wrapper.

    Returns:
        To be raised.
    """
    return InputError(
        f"{name} normalises the observations, and rules speak of them as the environment gives "
        f"them; put the shield around the environment first and {name} around the shield"
    )


def hands_on(wrapper: type, *methods: str) -> bool:
    """Whether wrappers of a class hand observations on as they are, or lay them flat.

    Args:
        wrapper: The class.
        methods: Names of those that give observations.

    Returns:
        True if it is known to, or has these methods from classes that are.
    """
    return _known(wrapper) or all(
        _known(next(one for one in wrapper.__mro__ if method in vars(one))) for method in methods
    )


def read_layers(text: str) -> tuple[list[Layer], str]:
    """The wrappers of an environment in another process, as it describes itself.

    Nothing else of it can be asked for safely: what cannot be sent ends that process.

    Args:
        text: What ``str`` makes of it.

    Returns:
        The outermost first, and the environment's id; "" where that is not told.
    """
    match = _WRAPPED.fullmatch(text)
    if match is None:
        return [], ""
    *names, _ = match[1].split("<")[1:] or [""]
    loaded = list(_descendants(gymnasium.Wrapper))
    return [
        Layer(name, tuple(one for one in loaded if one.__name__ == name)) for name in names
    ], match[2]


def _layers(env: Any) -> Iterator[Layer]:
    while isinstance(env, gymnasium.Wrapper):
        yield Layer(type(env).__name__, (type(env),))
        env = env.env


def _known(wrapper: type) -> bool:
    return wrapper.__name__ in _HAND_ON.get(wrapper.__module__.partition(".")[0], ())


def _descendants(wrapper: type[Any]) -> Iterator[type[Any]]:
    yield wrapper
    for one in wrapper.__subclasses__():
        yield from _descendants(one)
