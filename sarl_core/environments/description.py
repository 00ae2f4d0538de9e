"""What the entries of an environment's observations and actions are called.

Names and units are facts from Gymnasium's documentation of each environment
(https://gymnasium.farama.org/environments/, version 1.4); spaces and bounds come from the
environment itself.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from sarl_core.environments.environment import EnvironmentOrId, as_environment
from sarl_core.environments.feature_order import numbered
from sarl_core.environments.imports import named_object, reason
from sarl_core.environments.naming import own_names, package_labels, picture_in, text_in
from sarl_core.errors import InputError
from sarl_core.limits import MAX_FEATURES


@dataclass(frozen=True)
class EnvironmentDescription:
    """Spaces and names of an environment.

    Attributes:
        env_id: As given to ``gymnasium.make``.
        feature_names: d names.
        feature_units: d units, "" where there is none.
        action_names: m names, one an action dimension.
        label_names: For each dimension the names of its labels; () if continuous.
        label_first: The action that label 0 stands for, for each dimension.
        action_low: m lower bounds of continuous actions, else None.
        action_high: m upper bounds, else None.
        action_shape: Shape of one action; () for a single discrete one.
        max_steps: Steps after which an episode is cut off, None if never.
    """

    env_id: str
    feature_names: tuple[str, ...]
    feature_units: tuple[str, ...]
    action_names: tuple[str, ...]
    label_names: tuple[tuple[str, ...], ...]
    label_first: tuple[int, ...]
    action_low: tuple[float, ...] | None
    action_high: tuple[float, ...] | None
    action_shape: tuple[int, ...]
    max_steps: int | None = None

    @property
    def is_discrete(self) -> bool:
        """Whether the actions are labels."""
        return self.action_low is None


@dataclass(frozen=True)
class EnvironmentNames:
    """Names of features with their units, of action dimensions and of their labels."""

    features: tuple[tuple[str, str], ...]
    actions: tuple[str, ...]
    labels: tuple[tuple[str, ...], ...] = ()


_LUNAR_LANDER_FEATURES = (
    ("horizontal position", ""),
    ("vertical position", ""),
    ("horizontal velocity", ""),
    ("vertical velocity", ""),
    ("angle", "rad"),
    ("angular velocity", ""),
    ("left leg contact", ""),
    ("right leg contact", ""),
)

_TRAFFIC = tuple(
    (f"{what} on the {side}", unit)
    for side in ("left", "right")
    for what, unit in (("gap ahead", "m"), ("room", "m"), ("time to collision", "s"))
)

_CATALOGUE: dict[str, EnvironmentNames] = {
    "CartPole": EnvironmentNames(
        (
            ("cart position", "m"),
            ("cart velocity", "m/s"),
            ("pole angle", "rad"),
            ("pole angular velocity", "rad/s"),
        ),
        ("push",),
        (("push left", "push right"),),
    ),
    "LunarLander": EnvironmentNames(
        _LUNAR_LANDER_FEATURES,
        ("engine",),
        (("do nothing", "fire left engine", "fire main engine", "fire right engine"),),
    ),
    "LunarLanderContinuous": EnvironmentNames(
        _LUNAR_LANDER_FEATURES, ("main engine", "lateral engines")
    ),
    "Pendulum": EnvironmentNames(
        (("cosine of the angle", ""), ("sine of the angle", ""), ("angular velocity", "rad/s")),
        ("torque",),
    ),
    "BipedalWalker": EnvironmentNames(
        (
            ("hull angle", "rad"),
            ("hull angular velocity", ""),
            ("horizontal velocity", ""),
            ("vertical velocity", ""),
            ("hip 1 angle", "rad"),
            ("hip 1 speed", ""),
            ("knee 1 angle", "rad"),
            ("knee 1 speed", ""),
            ("leg 1 ground contact", ""),
            ("hip 2 angle", "rad"),
            ("hip 2 speed", ""),
            ("knee 2 angle", "rad"),
            ("knee 2 speed", ""),
            ("leg 2 ground contact", ""),
            *((f"lidar {number}", "") for number in range(1, 11)),
        ),
        ("hip 1 torque", "knee 1 torque", "hip 2 torque", "knee 2 torque"),
    ),
    "MountainCar": EnvironmentNames(
        (("car position", "m"), ("car velocity", "m/s")),
        ("acceleration",),
        (("accelerate left", "do not accelerate", "accelerate right"),),
    ),
    "MountainCarContinuous": EnvironmentNames(
        (("car position", "m"), ("car velocity", "m/s")), ("force",)
    ),
    "Acrobot": EnvironmentNames(
        (
            ("cosine of angle 1", ""),
            ("sine of angle 1", ""),
            ("cosine of angle 2", ""),
            ("sine of angle 2", ""),
            ("angular velocity 1", "rad/s"),
            ("angular velocity 2", "rad/s"),
        ),
        ("torque",),
        (("torque -1 Nm", "no torque", "torque +1 Nm"),),
    ),
    "Driving": EnvironmentNames(
        (
            ("speed", "m/s"),
            ("gap ahead", "m"),
            ("time to collision ahead", "s"),
            *_TRAFFIC,
        ),
        ("manoeuvre",),
        (("change to the left lane", "keep on", "change to the right lane", "faster", "slower"),),
    ),
}

# Ours, registered as other people's are, by the module that Gymnasium imports first.
OWN_MODULES = {"Driving-v0": "sarl_core.environments.driving"}

_UNKNOWN = re.compile(r"unexpected keyword argument '(\w+)'")


def make_environment(environment: EnvironmentOrId, *, render_mode: str | None = None) -> Any:
    """Make an environment as ``gymnasium.make`` does, with an error of one sentence.

    Args:
        environment: What ``gymnasium.make`` takes, ``module:Id`` included, or that with its
            arguments and wrappers.
        render_mode: As the environment calls it; None for no pictures.

    Returns:
        A ``gymnasium.Env``.

    Raises:
        InputError: If there is no such environment or it cannot be made or wrapped.
    """
    import gymnasium

    environment = as_environment(environment)
    env_id, parameters = environment.id, environment.keywords
    module = OWN_MODULES.get(env_id)
    if render_mode is not None:  # an environment that draws nothing need not take the parameter
        parameters["render_mode"] = render_mode
    try:
        with warnings.catch_warnings():
            # Of versions out of date, say; if it cannot be made, the error says so in one line.
            warnings.simplefilter("ignore")
            env: Any = gymnasium.make(
                f"{module}:{env_id}" if module else env_id, disable_env_checker=True, **parameters
            )
    except (Exception, SystemExit) as error:  # other people's code, which may raise anything
        text = str(error).strip()
        if (unknown := _UNKNOWN.search(text)) and unknown[1] in environment.keywords:
            raise InputError(
                f"the environment {env_id!r} takes no argument {unknown[1]!r}; give it others "
                "(--env-args)"
            ) from error
        because = text.splitlines()[0] if text else type(error).__name__
        if isinstance(error, (ImportError, gymnasium.error.DependencyNotInstalled)):
            # Gymnasium's advice to the author of a module is none for who names it.
            because = because.partition(". Environment registration via")[0].rstrip(".")
            if ":" in env_id:  # it may be the named module that does not exist
                raise InputError(
                    f"the environment {env_id!r} cannot be made ({because}); install that module, "
                    "or call from the folder it lies in"
                ) from error
            how = "pip install 'sarl-explorer[driving]'" if module else "install it"
            raise InputError(
                f"the environment {env_id!r} needs a package that is not installed "
                f"({because}); {how}, or choose another environment"
            ) from error
        raise InputError(
            f"the environment {env_id!r} cannot be made"
            f"{' with these arguments' if environment.keywords else ''} ({because}); "
            "give an id that gymnasium.make knows, such as CartPole-v1"
            f"{', and arguments that it takes' if environment.keywords else ''}"
        ) from error
    for wrapper in environment.wrappers:
        env = _wrapped(env, wrapper)
    return env


def steps_a_second(env: Any) -> float | None:
    """How many steps of an environment are a second of what it shows.

    Args:
        env: A ``gymnasium.Env``.

    Returns:
        The pictures of a second, one a step; of highway-env its decisions, as it draws the
        simulator's steps between them too. None where it does not say.
    """
    try:
        return float(env.get_wrapper_attr("config")["policy_frequency"])
    except (AttributeError, LookupError, TypeError, ValueError):
        pictures = env.metadata.get("render_fps")
        return float(pictures) if pictures else None


def _wrapped(env: Any, name: str) -> Any:
    """An environment in a wrapper that the caller names."""
    import gymnasium

    try:
        wrapper = named_object(name, "the wrapper")
        if not callable(wrapper):
            raise InputError(
                f"the wrapper {name!r} is {type(wrapper).__name__} and cannot be called; name a "
                "gymnasium.Wrapper class, or a function that takes an environment and gives one"
            )
        try:
            outer = wrapper(env)
        except (Exception, SystemExit) as error:  # the caller's code, which may raise anything
            raise InputError(
                f"the wrapper {name!r} cannot be put around the environment ({reason(error)}); "
                "it is called with the environment alone"
            ) from error
        if not isinstance(outer, gymnasium.Env):
            raise InputError(
                f"the wrapper {name!r} gives no environment but {type(outer).__name__}; let it "
                "return a gymnasium.Env"
            )
        return outer
    except InputError:
        env.close()
        raise


@lru_cache(maxsize=64)
def describe_environment(environment: EnvironmentOrId) -> EnvironmentDescription:
    """Spaces and names of an environment.

    Args:
        environment: What `make_environment` takes.

    Returns:
        Its description; names from Gymnasium's documentation where they are known.

    Raises:
        InputError: If there is no such environment, its observations are images, or its
            actions cannot be mined.
    """
    env_id = str(environment)
    env = make_environment(environment)
    try:
        d = _feature_count(env_id, env.observation_space)
        limit = env.spec.max_episode_steps if env.spec is not None else None
        return replace(_describe(env_id, env, d), max_steps=limit)
    finally:
        env.close()


def _feature_count(env_id: str, space: Any) -> int:
    from gymnasium import spaces

    if place := picture_in(space):
        raise InputError(
            f"{env_id} gives observations {place}, as images do, which rules cannot read; choose "
            "an environment with features, or put a wrapper around it that gives them"
        )
    if text_in(space):
        raise InputError(
            f"{env_id} gives observations with text in them, whose signs are no features; put a "
            "wrapper around it that gives numbers, or a Discrete where the words are few"
        )
    try:
        d = int(spaces.utils.flatdim(space))
    except (NotImplementedError, ValueError) as error:
        raise InputError(
            f"{env_id} gives observations ({type(space).__name__}) that have no fixed length; "
            "choose an environment with a vector of features"
        ) from error
    if d > MAX_FEATURES:
        raise InputError(
            f"{env_id} gives {d:,} features, more than the {MAX_FEATURES:,} that rules a person "
            "reads could use; choose an environment with fewer"
        )
    return d


def _describe(env_id: str, env: Any, d: int) -> EnvironmentDescription:
    from gymnasium import spaces

    from sarl_core.environments.observation_layers import as_registered, same_observations

    space = env.action_space
    low = high = None
    first: tuple[int, ...] = ()
    shape: tuple[int, ...] = ()
    counts: tuple[int, ...] = ()
    if isinstance(space, spaces.Discrete):
        counts, first = (int(space.n),), (int(space.start),)
    elif isinstance(space, (spaces.MultiDiscrete, spaces.MultiBinary)):
        shape = tuple(int(size) for size in space.shape)
        if isinstance(space, spaces.MultiDiscrete):
            counts = tuple(int(n) for n in space.nvec.reshape(-1))
            first = tuple(int(start) for start in np.asarray(space.start).reshape(-1))
        else:
            counts = (2,) * int(np.prod(shape))
            first = (0,) * len(counts)
    elif isinstance(space, spaces.Box):
        shape = tuple(int(size) for size in space.shape)
        low = tuple(float(value) for value in space.low.reshape(-1))
        high = tuple(float(value) for value in space.high.reshape(-1))
    else:
        raise InputError(
            f"{env_id} takes actions of the kind {type(space).__name__}, from which no rule can "
            "be mined; choose an environment with discrete or continuous actions"
        )
    m = len(counts) if low is None else len(low)
    layers = same_observations(env)
    own = own_names(layers, d, counts, m)
    made = as_registered(env)
    plain = layers[-1] is made
    try:
        there = int(spaces.utils.flatdim(made.observation_space))
    except (NotImplementedError, ValueError):
        there = d  # no vector before it was wrapped, so no catalogue knows its length
    names = catalogued(env_id, there, m, discrete=low is None)
    features = names.features if plain else [(name, "") for name in numbered(d)]
    units = [""] * d if own.features else [unit for _, unit in features]
    labels = own.labels or names.labels or package_labels(env, counts)
    return EnvironmentDescription(
        env_id=env_id,
        feature_names=own.features or tuple(name for name, _ in features),
        feature_units=own.units or tuple(units),
        action_names=own.actions or names.actions,
        label_names=tuple(
            labels[i]
            if i < len(labels) and len(labels[i]) == counts[i]
            else tuple(str(first[i] + label) for label in range(counts[i]))
            for i in range(m)
        )
        if low is None
        else ((),) * m,
        label_first=first if low is None else (0,) * m,
        action_low=low,
        action_high=high,
        action_shape=shape,
    )


def catalogued(env_id: str, d: int, m: int, *, discrete: bool) -> EnvironmentNames:
    """Names from the catalogue if they fit the spaces, else numbers.

    Args:
        env_id: Of an environment that need not be made.
        d: Number of features.
        m: Number of action dimensions.
        discrete: Whether the actions are labels.

    Returns:
        d features and m actions.
    """
    name = env_id.rsplit(":", 1)[-1].rsplit("/", 1)[-1]
    family = name.rsplit("-v", 1)[0].removesuffix("Hardcore")
    for key in (family, f"{family}Continuous"):
        names = _CATALOGUE.get(key)
        if (
            names is not None
            and bool(names.labels) == discrete
            and len(names.features) == d
            and len(names.actions) == m
        ):
            return names
    return EnvironmentNames(
        tuple((name, "") for name in numbered(d)),
        ("action",) if m == 1 else tuple(f"action {index}" for index in range(m)),
    )
