from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from sarl_core import Environment, InputError, Shield, ShieldedEnv, mine_rules, record, rollout
from sarl_core.environments.description import (
    describe_environment,
    make_environment,
    steps_a_second,
)
from sarl_core.environments.naming import picture_in, space_names

CRANE = spaces.Dict(
    {
        "wind": spaces.Box(-1, 1, (1,), np.float32),
        "gear": spaces.Discrete(3, start=1),
        "arm": spaces.Dict({"reach": spaces.Box(0, 9, (2,), np.float32)}),
        "lamps": spaces.MultiBinary(2),
        "modes": spaces.MultiDiscrete([2, 3]),
        "grid": spaces.Box(-1, 1, (2, 2), np.float64),
    }
)


class Crane(gymnasium.Env[Any, Any]):
    """Gives whatever its space holds."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}
    action_space = spaces.Discrete(2)
    label_names = ("lift", "lower")

    def __init__(self, space: spaces.Space[Any] = CRANE) -> None:
        self.observation_space = deepcopy(space)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.observation_space.seed(seed)
        return self.observation_space.sample(), {}

    def step(self, action: Any) -> Any:
        return self.observation_space.sample(), 1.0, False, False, {}


class Named(gymnasium.ObservationWrapper[Any, Any, Any]):
    """Two features with names of their own."""

    feature_names = ("wind", "gear")
    feature_units = ("m/s", "")

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self.observation_space = spaces.Box(-9, 9, (2,), np.float32)

    def observation(self, observation: Any) -> Any:
        return np.array([observation["wind"][0], observation["gear"]], np.float32)


class Liar(Named):
    """Says that it gives two numbers, and gives three."""

    def observation(self, observation: Any) -> Any:
        return np.zeros(3, np.float32)


@pytest.fixture(autouse=True)
def cranes(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    gymnasium.register("NamedCrane-v0", Crane, max_episode_steps=20)
    yield
    del gymnasium.registry["NamedCrane-v0"]
    describe_environment.cache_clear()


def test_names_stand_where_flatten_puts_the_values() -> None:
    sample = CRANE.sample()
    sample["wind"][:] = 0.5
    sample["gear"] = 2
    sample["arm"]["reach"][:] = (3, 4)
    sample["lamps"][:] = (0, 1)
    sample["modes"][:] = (1, 2)
    sample["grid"][:] = ((5, 6), (7, 8))
    flat = dict(zip(space_names(CRANE), spaces.flatten(CRANE, sample).tolist(), strict=True))
    assert flat == {
        "arm: reach 0": 3,
        "arm: reach 1": 4,
        "gear is 1": 0,
        "gear is 2": 1,
        "gear is 3": 0,
        "grid 0:0": 5,
        "grid 0:1": 6,
        "grid 1:0": 7,
        "grid 1:1": 8,
        "lamps 0": 0,
        "lamps 1": 1,
        "modes 0 is 0": 0,
        "modes 0 is 1": 1,
        "modes 1 is 0": 0,
        "modes 1 is 1": 0,
        "modes 1 is 2": 1,
        "wind": 0.5,
    }


@pytest.mark.parametrize(
    ("space", "names"),
    [
        (spaces.Discrete(2, start=4), ("state is 4", "state is 5")),
        (
            spaces.Tuple([spaces.Discrete(2), spaces.Box(0, 1)]),
            ("part 0 is 0", "part 0 is 1", "part 1"),
        ),
        (
            spaces.Tuple(
                [
                    spaces.Box(0, 1, (2,)),
                    spaces.Tuple([spaces.Box(0, 1, (2,)), spaces.Discrete(2)]),
                    spaces.Dict({"wind": spaces.Box(0, 1, (2,)), "rain": spaces.Box(0, 1)}),
                ]
            ),
            (
                "entry 0 of part 0",
                "entry 1 of part 0",
                "entry 0 of part 0 of part 1",
                "entry 1 of part 0 of part 1",
                "part 1 of part 1 is 0",
                "part 1 of part 1 is 1",
                "rain of part 2",
                "entry 0 of wind of part 2",
                "entry 1 of wind of part 2",
            ),
        ),
        (
            spaces.Dict({"arm": spaces.Tuple([spaces.Box(0, 1), spaces.MultiDiscrete([2])])}),
            ("part 0 of arm", "entry 0 of part 1 of arm is 0", "entry 0 of part 1 of arm is 1"),
        ),
        (spaces.Box(-1, 1, (3,)), ("feature 0", "feature 1", "feature 2")),
        (spaces.MultiBinary(2), ("feature 0", "feature 1")),
    ],
)
def test_what_has_no_names_is_numbered(space: spaces.Space[Any], names: tuple[str, ...]) -> None:
    assert space_names(space) == names
    assert len(names) == spaces.flatdim(space)


@pytest.mark.parametrize(
    ("space", "is_picture"),
    [
        (spaces.Box(0, 255, (96, 96, 3), np.uint8), True),
        (spaces.Box(0, 255, (84, 84), np.uint8), True),
        (spaces.Box(0, 255, (210, 160, 1), np.uint8), True),
        (spaces.Box(0, 1, (3, 64, 64), np.float32), True),
        (spaces.Box(0, 255, (4, 84, 84, 3), np.uint8), True),
        (spaces.Box(0, 255, (7, 7, 3), np.uint8), True),
        (spaces.Dict({"eye": spaces.Box(0, 255, (64, 64, 3), np.uint8)}), True),
        (spaces.Box(-np.inf, np.inf, (5, 5), np.float32), False),
        (spaces.Box(-1, 1, (40, 40), np.float32), False),
        (spaces.Box(-np.inf, np.inf, (4, 11, 11), np.float32), False),
        (spaces.Box(0, 1, (3, 3, 10), np.float32), False),
        (spaces.Box(0, 255, (4, 4), np.uint8), False),
        (spaces.Box(0, 255, (128,), np.uint8), False),
    ],
)
def test_a_picture_is_known_from_a_table(space: spaces.Space[Any], is_picture: bool) -> None:
    assert bool(picture_in(space)) == is_picture


def test_a_wrapper_names_the_features_it_makes() -> None:
    wrapped = Environment("NamedCrane-v0", wrappers=(f"{__name__}:Named",))
    description = describe_environment(wrapped)
    assert description.feature_names == ("wind", "gear")
    assert description.feature_units == ("m/s", "")
    assert description.label_names == (("lift", "lower"),)
    flat = Environment("NamedCrane-v0", wrappers=("gymnasium.wrappers:FlattenObservation",))
    assert describe_environment(flat).feature_names == space_names(CRANE)


def test_observations_that_are_not_of_their_space_are_refused() -> None:
    wrapped = Environment("NamedCrane-v0", wrappers=(f"{__name__}:Liar",))
    with pytest.raises(InputError, match=r"not of its space \(3 numbers and not 2\)"):
        rollout(wrapped, "novice", episodes=1)


def test_rules_are_laid_on_the_features_of_a_structured_space_alike_everywhere() -> None:
    demonstrations = record("NamedCrane-v0", "novice", steps=300)
    assert demonstrations.feature_names == space_names(CRANE)
    rules = mine_rules(demonstrations, supp_min=0.02, conf_min=0.6)
    played = rollout("NamedCrane-v0", "novice", shield=Shield(rules), episodes=2)
    assert played.steps is not None
    assert not played.notes
    guarded = ShieldedEnv(make_environment("NamedCrane-v0"), Shield(rules))
    guarded.reset(seed=0)
    rows = played.steps.of_episode(0)
    for number in range(len(rows)):
        *_, info = guarded.step(int(rows.proposed[number, 0]))
        np.testing.assert_array_equal(info["shield"].observation, rows.observation[number])
        assert int(info["shield"].executed) == rows.executed[number, 0]


def test_a_second_on_the_highway_is_one_decision() -> None:
    env = make_environment("highway_env:highway-fast-v0")
    assert (env.metadata["render_fps"], steps_a_second(env)) == (2, 1.0)
    assert steps_a_second(make_environment("CartPole-v1")) == 50.0


def test_highway_env_tells_its_features_and_actions() -> None:
    description = describe_environment("highway_env:highway-fast-v0")
    assert description.feature_names[5:8] == ("vehicle 2: presence", "vehicle 2: x", "vehicle 2: y")
    assert len(description.feature_names) == 25
    assert description.label_names == (("LANE_LEFT", "IDLE", "LANE_RIGHT", "FASTER", "SLOWER"),)
