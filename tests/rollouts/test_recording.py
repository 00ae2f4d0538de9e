from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest

from sarl_core.environments.environment import Environment
from sarl_core.errors import InputError
from sarl_core.progress import CancelledError
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.recording import RecordingFaultError, record
from sarl_core.rollouts.trial import make_agent


def test_records_exactly_as_many_steps_as_asked() -> None:
    demos = record("LunarLander-v3", "novice", steps=777, seed=3)
    assert len(demos) == 777
    assert demos.feature_names is not None
    assert demos.feature_names[4] == "angle"
    assert demos.feature_units is not None
    assert demos.feature_units[4] == "rad"
    assert demos.label_names == (
        ("do nothing", "fire left engine", "fire main engine", "fire right engine"),
    )
    assert (demos.env_id, demos.agent, demos.seed) == ("LunarLander-v3", "novice", 3)


def test_holds_the_episodes_of_rollout_one_after_the_other() -> None:
    demos = record("LunarLander-v3", "novice", steps=900, seed=3)
    played = rollout("LunarLander-v3", "novice", episodes=demos.n_episodes, seed=3)
    assert played.steps is not None
    assert demos.rewards is not None
    assert demos.actions.tobytes() == played.steps.executed[:900, 0].tobytes()
    assert demos.observations.tobytes() == played.steps.observation[:900].tobytes()
    assert demos.rewards.tobytes() == played.steps.reward[:900].tobytes()
    assert demos.episodes.tobytes() == played.steps.episode[:900].tobytes()
    assert demos.steps is not None
    assert demos.steps.tobytes() == played.steps.step[:900].tobytes()


def test_marks_where_episodes_end_and_leaves_the_last_one_open() -> None:
    demos = record("CartPole-v1", "expert", steps=1_250)
    assert demos.episode_lengths.tolist() == [500, 500, 250]
    assert demos.truncated is not None
    assert demos.terminated is not None
    assert np.flatnonzero(demos.truncated).tolist() == [499, 999]
    assert not demos.terminated.any()
    assert demos.episode_finished is not None
    assert demos.episode_finished.tolist() == [True, True, False]


def test_a_whole_number_of_episodes_is_finished() -> None:
    demos = record("CartPole-v1", "expert", steps=500)
    assert demos.episode_finished is not None
    assert demos.episode_finished.tolist() == [True]


def test_the_first_steps_do_not_depend_on_how_many_are_asked_for() -> None:
    short, long = (
        record("LunarLander-v3", "expert", steps=steps, stochastic=True) for steps in (300, 2_000)
    )
    assert short.observations.tobytes() == long.observations[:300].tobytes()
    assert short.actions.tobytes() == long.actions[:300].tobytes()


def test_same_seed_same_digest() -> None:
    first, again, other = (
        record("Pendulum-v1", "expert", steps=450, seed=seed, stochastic=True) for seed in (1, 1, 2)
    )
    assert first.digest == again.digest
    assert first.digest != other.digest


def test_a_stochastic_policy_is_sampled() -> None:
    greedy, sampled = (
        record("LunarLander-v3", "expert", steps=200, stochastic=stochastic)
        for stochastic in (False, True)
    )
    assert (greedy.actions != sampled.actions).any()
    policy = make_agent("expert", "LunarLander-v3")
    assert (policy.act(greedy.observations, None)[:, 0] == greedy.actions).all()


def test_every_kind_of_space_is_recorded(toy_id: str) -> None:
    demos = record(toy_id, "novice", steps=60)
    assert len(demos) == 60
    assert demos.is_discrete == (
        toy_id in ("toy/Offset-v0", "toy/MultiDiscrete-v0", "toy/MultiBinary-v0")
    )
    if toy_id == "toy/Offset-v0":
        assert demos.actions.shape == (60,)
        assert demos.actions.min() == -1
    elif toy_id == "toy/Matrix-v0":
        assert demos.actions.shape == (60, 4)
        assert demos.bounds_from == "action space"
    elif toy_id == "toy/Open-v0":
        assert demos.bounds_from == "demonstrated values"


def test_an_endless_environment_is_cut_and_not_marked_as_ended() -> None:
    demos = record("toy/Endless-v0", "novice", steps=70)
    assert demos.truncated is not None
    assert demos.terminated is not None
    assert len(demos) == 70
    assert not demos.truncated.any()
    assert not demos.terminated.any()


def test_progress_and_stopping() -> None:
    calls: list[tuple[int, int]] = []
    record("CartPole-v1", "novice", steps=300, progress=lambda *call: calls.append(call))
    assert calls[0] == (0, 300)
    assert calls[-1] == (300, 300)
    with pytest.raises(CancelledError):
        record("CartPole-v1", "novice", steps=300, progress=lambda *_: False)


@pytest.mark.parametrize("arguments", [{"steps": 0}, {"steps": 5, "seed": -1}])
def test_numbers_out_of_range_are_named(arguments: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="must be at least"):
        record("CartPole-v1", "novice", **arguments)


class BlindAtStep5(gymnasium.Wrapper[Any, Any, Any, Any]):
    """A sensor that fails at step 5 of the second episode."""

    sight: Any = np.array([0, np.nan, 0, 0], dtype=np.float32)
    reward = 1.0

    def reset(self, **kwargs: Any) -> Any:
        self.left = 5 if kwargs["seed"] == 1 else -1
        return super().reset(**kwargs)

    def step(self, action: Any) -> Any:
        self.left -= 1
        observation, _, *rest = super().step(action)
        blind = self.left == 0
        return (self.sight if blind else observation, self.reward if blind else 1.0, *rest)


class Short(BlindAtStep5):
    """An observation of another length."""

    sight = np.zeros(3, dtype=np.float32)


class Unpaid(BlindAtStep5):
    """An infinite reward, and nothing wrong with what is seen."""

    sight, reward = np.zeros(4, dtype=np.float32), np.inf


@pytest.mark.parametrize(
    ("wrapper", "step", "fault"),
    [
        (BlindAtStep5, 5, r"'feature 1' that is not a number \(NaN\) at step 5 of the episode"),
        (Short, 5, "what is no observation of its space at step 5 of the episode with seed 1"),
        (Unpaid, 4, "a reward that is infinite at step 4 of the episode with seed 1"),
    ],
)
def test_what_came_before_a_value_that_is_none_is_kept(
    wrapper: type, step: int, fault: str
) -> None:
    blind = Environment("CartPole-v1", wrappers=(f"{__name__}:{wrapper.__name__}",))
    with pytest.raises(RecordingFaultError, match=fault) as caught:
        record(blind, "expert", steps=1_200)
    recorded = caught.value.recorded
    assert recorded.episode_lengths.tolist() == [500, step]
    assert recorded.observations[:500].tobytes() == (
        record("CartPole-v1", "expert", steps=500).observations.tobytes()
    )
    few = record(blind, "expert", steps=500 + step)
    assert few.observations.tobytes() == recorded.observations.tobytes()


class Crates(gymnasium.Env[Any, Any]):
    """Takes whole crates, and remembers how many."""

    observation_space = gymnasium.spaces.Box(0, 100, (1,), np.float32)
    action_space = gymnasium.spaces.Box(0, 9, (2,), np.int64)

    def __init__(self, taken: list[list[int]]) -> None:
        self.taken = taken

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> Any:
        assert action.dtype == np.int64
        self.taken.append(action.tolist())
        return np.ones(1, np.float32), 0.0, False, False, {}


def test_amounts_in_whole_numbers_are_recorded_as_the_environment_took_them() -> None:
    taken: list[list[int]] = []
    gymnasium.register("Crates-v0", partial(Crates, taken), max_episode_steps=20)
    demos = record("Crates-v0", "novice", steps=20)
    gymnasium.registry.pop("Crates-v0")
    assert demos.actions.tolist() == taken
    assert len(np.unique(demos.actions)) > 5
