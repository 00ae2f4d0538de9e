"""Policies that were trained under VecNormalize, or behind another wrapper."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import NormalizeObservation, RescaleAction
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from sarl_core.agents.agent import PolicyAgent
from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.errors import InputError
from sarl_core.rollouts.trial import make_agent
from tests.agents.sb3_learners import (
    CART,
    OFF_POLICY,
    ON_POLICY,
    PENDULUM,
    differing,
    learner,
    read,
    states,
)


def normalising(env_id: str, **options: Any) -> VecNormalize:
    return VecNormalize(DummyVecEnv([lambda: gymnasium.make(env_id)]), **options)


@pytest.mark.parametrize(
    ("name", "env_id", "parameters"),
    [
        ("PPO", PENDULUM, ON_POLICY),
        ("A2C", CART, {}),
        ("SAC", PENDULUM, OFF_POLICY),
        ("DQN", CART, OFF_POLICY),
        ("ARS", CART, {"n_delta": 2}),
    ],
)
def test_the_statistics_beside_a_file_are_read_and_that_is_said(
    name: str, env_id: str, parameters: dict[str, Any], tmp_path: Path
) -> None:
    env = normalising(env_id, clip_obs=2.0, epsilon=0.01)
    model = learner(name, env, **parameters)
    env.save(str(tmp_path / "vecnormalize.pkl"))
    rows = 3 * states(env_id)
    agent = read(model, tmp_path, env_id)
    assert differing(agent, model, rows, env.normalize_obs(rows)) == 0
    assert len(agent.notes) == 1
    assert "normalised by" in agent.notes[0]
    assert "vecnormalize.pkl" in agent.notes[0]
    agent.policy.save(tmp_path / "policy.npz")
    again = MlpPolicy.load(tmp_path / "policy.npz")
    assert (again.act(rows) == agent.policy.act(rows)).all()


def test_statistics_are_as_precise_as_they_were(tmp_path: Path) -> None:
    """A mean of 293.42 with a spread of 0.001 does not survive in float32."""
    env = normalising(CART)
    model = learner("PPO", env, **ON_POLICY)
    env.obs_rms.mean = np.full(4, 293.42)
    env.obs_rms.var = np.full(4, 1e-6)
    env.save(str(tmp_path / "model_vecnormalize.pkl"))
    rng = np.random.default_rng(0)
    rows = (293.42 + 0.001 * rng.normal(size=(200, 4))).astype(np.float32)
    model.save(tmp_path / "model.zip")
    agent = make_agent(tmp_path / "model.zip", CART)
    assert isinstance(agent, PolicyAgent)
    assert agent.policy.normalisation is not None
    assert (agent.policy.normalisation(rows) == env.normalize_obs(rows)).all()


@pytest.mark.parametrize("named", ["model_vecnormalize.pkl", "vec_normalize.pkl", "other.pkl"])
def test_statistics_are_found_by_their_name_or_given(named: str, tmp_path: Path) -> None:
    env = normalising(PENDULUM)
    model = learner("PPO", env, **ON_POLICY)
    env.save(str(tmp_path / named))
    rows = states(PENDULUM)
    if named == "other.pkl":
        with pytest.raises(InputError, match=r"trained under a VecNormalize.*--normalise FILE"):
            read(model, tmp_path, PENDULUM)
        agent = read(model, tmp_path, PENDULUM, normalise=tmp_path / named)
        assert agent.notes == ()
    else:
        agent = read(model, tmp_path, PENDULUM)
    assert differing(agent, model, rows, env.normalize_obs(rows)) == 0


def test_a_checkpoint_finds_the_statistics_of_its_step(tmp_path: Path) -> None:
    env = normalising(PENDULUM)
    model = learner("PPO", env, **ON_POLICY)
    model.save(tmp_path / "rl_model_200_steps.zip")
    model.save(tmp_path / "rl_model_100_steps.zip")
    env.save(str(tmp_path / "rl_model_vecnormalize_200_steps.pkl"))
    agent = make_agent(tmp_path / "rl_model_200_steps.zip", PENDULUM)
    assert isinstance(agent, PolicyAgent)
    assert "rl_model_vecnormalize_200_steps.pkl" in agent.notes[0]
    with pytest.raises(InputError, match="do not lie beside it"):
        make_agent(tmp_path / "rl_model_100_steps.zip", PENDULUM)


def test_statistics_that_may_be_anothers_are_not_guessed(tmp_path: Path) -> None:
    env = normalising(PENDULUM)
    model = learner("PPO", env, **ON_POLICY)
    env.save(str(tmp_path / "vecnormalize.pkl"))
    model.save(tmp_path / "another.zip")
    with pytest.raises(InputError, match=r"vecnormalize\.pkl and another\.zip.*--normalise FILE"):
        read(model, tmp_path, PENDULUM)
    (tmp_path / "another.zip").unlink()
    env.save(str(tmp_path / "vec_normalize.pkl"))
    with pytest.raises(InputError, match=r"vecnormalize\.pkl and vec_normalize\.pkl"):
        read(model, tmp_path, PENDULUM)


def test_observations_that_were_left_as_they_are(tmp_path: Path) -> None:
    env = normalising(PENDULUM, norm_obs=False)
    rows = states(PENDULUM)
    model = learner("PPO", env, **ON_POLICY)
    assert differing(read(model, tmp_path, PENDULUM, normalise="none"), model, rows) == 0
    env.save(str(tmp_path / "vecnormalize.pkl"))
    agent = read(model, tmp_path, PENDULUM)
    assert "were not normalised" in agent.notes[0]
    assert differing(agent, model, rows) == 0
    (tmp_path / "vecnormalize.pkl").unlink()
    # What an off-policy learner keeps shows it.
    model = learner("SAC", normalising(PENDULUM, norm_obs=False), **OFF_POLICY)
    assert read(model, tmp_path, PENDULUM).notes == ()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("name", "env_id"), [("SAC", PENDULUM), ("DQN", CART)])
def test_a_learner_with_a_buffer_without_its_statistics_does_not_pass_in_silence(
    name: str, env_id: str, seed: int, tmp_path: Path
) -> None:
    idle = {**OFF_POLICY, "learning_starts": 1000}
    model = learner(name, normalising(env_id), steps=150 + 40 * seed, **idle)
    try:
        said = " ".join(read(model, tmp_path, env_id).notes)  # where it cannot be sure
    except InputError as error:
        said = str(error)
    assert "VecNormalize" in said
    assert "--normalise FILE" in said


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("env_id", [CART, "MountainCar-v0", "LunarLander-v3", "FrozenLake-v1"])
def test_a_learner_with_a_buffer_that_saw_what_there_was_is_read_without_a_word(
    env_id: str, seed: int, tmp_path: Path
) -> None:
    idle = {**OFF_POLICY, "learning_starts": 1000}
    model = learner("DQN", env_id, steps=150 + 40 * seed, **idle)
    assert read(model, tmp_path, env_id).notes == ()


def test_an_environment_that_fails_says_so_where_it_is_played_in(tmp_path: Path) -> None:
    """And not where an agent is tried in it."""
    idle = {**OFF_POLICY, "learning_starts": 1000}
    model = learner("DQN", normalising(CART), steps=150, **idle)
    gymnasium.register("toy/FallsAtOnce-v0", lambda: Fails(gymnasium.make(CART)))
    notes = read(model, tmp_path, "toy/FallsAtOnce-v0").notes
    assert any("does not tell whether its observations were normalised" in one for one in notes)


class Fails(gymnasium.Wrapper[Any, Any, Any, Any]):
    def step(self, action: Any) -> Any:
        raise OSError("the track is closed")


def test_statistics_of_another_task_are_refused_or_said(tmp_path: Path) -> None:
    env = normalising(PENDULUM)
    model = learner("PPO", env, **ON_POLICY)
    normalising(CART).save(str(tmp_path / "cart.pkl"))
    with pytest.raises(InputError, match=r"takes 3 features, and the statistics .* are of 4"):
        read(model, tmp_path, PENDULUM, normalise=tmp_path / "cart.pkl")
    env.obs_rms.mean = env.obs_rms.mean + 100.0
    env.save(str(tmp_path / "far.pkl"))
    agent = read(model, tmp_path, PENDULUM, normalise=tmp_path / "far.pkl")
    assert any("unlike those that it was trained on" in note for note in agent.notes)
    plain = learner("PPO", PENDULUM, **ON_POLICY)
    agent = read(plain, tmp_path, PENDULUM, normalise=tmp_path / "far.pkl")
    assert any("does not look as if it was trained under" in note for note in agent.notes)


def test_statistics_belong_to_a_zip(tmp_path: Path) -> None:
    for spec in ("novice", "expert", tmp_path / "policy.npz"):
        with pytest.raises(InputError, match="leave out --normalise"):
            make_agent(spec, PENDULUM, normalise=tmp_path / "vecnormalize.pkl")


def test_a_wrapper_that_scaled_observations_is_said(tmp_path: Path) -> None:
    env = NormalizeObservation(gymnasium.make(CART))
    agent = read(learner("PPO", env, **ON_POLICY), tmp_path, CART)
    assert len(agent.notes) == 1
    assert "between -inf and inf in training" in agent.notes[0]


def test_observations_that_the_environment_cannot_give_are_said(tmp_path: Path) -> None:
    class Scaled(gymnasium.ObservationWrapper[Any, Any, Any]):
        """Its space does not say that it scales."""

        def observation(self, observation: Any) -> Any:
            return np.float32(100.0) * observation

    agent = read(learner("PPO", Scaled(gymnasium.make(PENDULUM)), **ON_POLICY), tmp_path, PENDULUM)
    assert any("the last observation of its training" in note for note in agent.notes)


def test_actions_of_another_range_are_refused(tmp_path: Path) -> None:
    env = RescaleAction(gymnasium.make(PENDULUM), np.float32(-1.0), np.float32(1.0))
    with pytest.raises(InputError, match=r"between -1 and 1 in training.* takes -2 and 2"):
        read(learner("PPO", env, **ON_POLICY), tmp_path, PENDULUM)
