from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from sarl_core.environments.description import (
    OWN_MODULES,
    describe_environment,
    make_environment,
)
from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import rollout

VECTOR = spaces.Box(-1, 1, (3,), np.float32)


class Thing(gymnasium.Env[Any, Any]):
    def __init__(
        self, observation_space: Any = VECTOR, action_space: Any = None, fails: bool = False
    ) -> None:
        if fails:
            raise RuntimeError("no licence\nsecond line")
        self.observation_space = observation_space
        self.action_space = action_space or spaces.Discrete(2)


class Plain(gymnasium.Env[Any, Any]):
    """What nobody told that there are pictures."""

    observation_space = VECTOR
    action_space = spaces.Discrete(2)

    def __init__(self) -> None:
        pass

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        return np.zeros(3, np.float32), {}

    def step(self, action: Any) -> Any:
        return np.zeros(3, np.float32), 0.0, False, False, {}


Register = Callable[..., str]


@pytest.fixture
def register() -> Iterator[Register]:
    names: list[str] = []

    def add(**parameters: Any) -> str:
        names.append(f"Thing{len(names)}-v0")
        gymnasium.register(names[-1], entry_point=lambda **_: Thing(**parameters))
        return names[-1]

    yield add
    for name in names:
        del gymnasium.registry[name]
    describe_environment.cache_clear()


@pytest.mark.parametrize(
    ("env_id", "features", "labels"),
    [
        ("CartPole-v1", 4, 2),
        ("LunarLander-v3", 8, 4),
        ("MountainCar-v0", 2, 3),
        ("Acrobot-v1", 6, 3),
    ],
)
def test_discrete_environments_have_names(env_id: str, features: int, labels: int) -> None:
    got = describe_environment(env_id)
    assert len(got.feature_names) == len(got.feature_units) == features
    assert not any(name.startswith("feature ") for name in got.feature_names)
    assert [len(names) for names in got.label_names] == [labels]
    assert not any(name.isdigit() for name in got.label_names[0])
    assert got.is_discrete
    assert (got.label_first, got.action_shape, got.action_low) == ((0,), (), None)


@pytest.mark.parametrize(
    ("env_id", "features", "high"),
    [
        ("Pendulum-v1", 3, (2.0,)),
        ("MountainCarContinuous-v0", 2, (1.0,)),
        ("LunarLanderContinuous-v3", 8, (1.0, 1.0)),
        ("BipedalWalker-v3", 24, (1.0,) * 4),
        ("BipedalWalkerHardcore-v3", 24, (1.0,) * 4),
    ],
)
def test_continuous_environments_have_names_and_bounds(
    env_id: str, features: int, high: tuple[float, ...]
) -> None:
    got = describe_environment(env_id)
    assert len(got.feature_names) == features
    assert not any(name.startswith("feature ") for name in got.feature_names)
    assert not got.is_discrete
    assert got.action_high == high
    assert got.action_low == tuple(-value for value in high)
    assert len(got.action_names) == len(high)
    assert got.label_names == ((),) * len(high)


def test_names_and_units_of_cart_pole() -> None:
    got = describe_environment("CartPole-v1")
    assert got.feature_names == (
        "cart position",
        "cart velocity",
        "pole angle",
        "pole angular velocity",
    )
    assert got.feature_units == ("m", "m/s", "rad", "rad/s")
    assert got.label_names == (("push left", "push right"),)
    assert got.max_steps == 500


def test_multi_discrete_with_starts(register: Register) -> None:
    got = describe_environment(register(action_space=spaces.MultiDiscrete([2, 3], start=[0, 5])))
    assert got.label_names == (("0", "1"), ("5", "6", "7"))
    assert got.label_first == (0, 5)
    assert got.action_names == ("action 0", "action 1")
    assert got.action_shape == (2,)
    assert got.feature_names == ("feature 0", "feature 1", "feature 2")


def test_multi_binary_and_discrete_start(register: Register) -> None:
    binary = describe_environment(register(action_space=spaces.MultiBinary(3)))
    assert binary.label_names == (("0", "1"),) * 3
    shifted = describe_environment(register(action_space=spaces.Discrete(2, start=-1)))
    assert shifted.label_names == (("-1", "0"),)
    assert shifted.label_first == (-1,)


def test_observations_are_flattened(register: Register) -> None:
    space = spaces.Dict({"place": spaces.Discrete(4), "speed": VECTOR})
    assert len(describe_environment(register(observation_space=space)).feature_names) == 7


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"observation_space": spaces.Box(0, 255, (8, 8, 3), np.uint8)}, "images"),
        ({"observation_space": spaces.Sequence(VECTOR)}, "no fixed length"),
        ({"observation_space": spaces.Text(5)}, "with text in them"),
        ({"observation_space": spaces.Dict(word=spaces.Text(5), x=VECTOR)}, "with text in them"),
        ({"observation_space": spaces.Box(-1, 1, (9999,))}, "9,999 features"),
        ({"action_space": spaces.Tuple([spaces.Discrete(2)])}, "Tuple"),
        ({"fails": True}, "cannot be made .no licence."),
    ],
)
def test_what_rules_cannot_be_mined_from(
    parameters: dict[str, Any], message: str, register: Register
) -> None:
    with pytest.raises(InputError, match=message) as error:
        describe_environment(register(**parameters))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("env_id", ["NoSuch-v0", "no_such_module:Thing-v0", "", "CartPole-v77"])
def test_environment_that_does_not_exist(env_id: str) -> None:
    with pytest.raises(InputError, match="cannot be made") as error:
        make_environment(env_id)
    assert "\n" not in str(error.value)
    assert repr(env_id) in str(error.value)


def test_an_environment_that_draws_nothing_need_not_take_a_render_mode() -> None:
    gymnasium.register("test/Plain-v0", entry_point=Plain, max_episode_steps=5)
    try:
        assert rollout("test/Plain-v0", "novice", episodes=2, seed=0).lengths.tolist() == [5, 5]
    finally:
        gymnasium.registry.pop("test/Plain-v0")


@pytest.mark.parametrize(
    "error",
    [
        ModuleNotFoundError("No module named 'engine'"),
        gymnasium.error.DependencyNotInstalled(
            "engine is not installed, run `pip install engine`."
        ),
    ],
)
def test_a_package_that_is_missing_is_named(error: Exception) -> None:
    def fail(**_: Any) -> Any:
        raise error

    gymnasium.register("test/Lacking-v0", entry_point=fail)
    with pytest.raises(InputError, match="needs a package that is not installed") as found:
        make_environment("test/Lacking-v0")
    gymnasium.registry.pop("test/Lacking-v0")
    assert "engine" in str(found.value)


@pytest.mark.parametrize(
    ("env_id", "advice"),
    [
        ("Driving-v0", "pip install 'sarl-explorer[driving]', or choose another environment"),
        ("highway_env:highway-fast-v0", "install that module, or call from the folder it lies in"),
    ],
)
def test_a_simulator_that_is_missing_is_said_in_one_sentence(
    env_id: str, advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "highway_env", None)
    monkeypatch.delitem(sys.modules, OWN_MODULES["Driving-v0"], raising=False)
    with pytest.raises(InputError, match="highway_env") as error:
        make_environment(env_id)
    assert str(error.value).endswith(advice)
    assert ". " not in str(error.value)
