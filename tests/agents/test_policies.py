import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import stable_baselines3
import torch
from gymnasium import spaces
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.errors import InputError
from sarl_core.learning.experts import export_policy
from sarl_core.rollouts.trial import make_agent

LEARNERS = [
    ("PPO", "CartPole-v1", {"n_steps": 64, "batch_size": 64}, 128),
    ("PPO", "Pendulum-v1", {"n_steps": 64, "batch_size": 64}, 128),
    ("A2C", "LunarLander-v3", {"policy_kwargs": {"activation_fn": torch.nn.ReLU}}, 50),
    ("DQN", "CartPole-v1", {"learning_starts": 10, "buffer_size": 1000}, 100),
    ("PPO", "toy/VectorMultiBinary-v0", {"n_steps": 64, "batch_size": 64}, 128),
    ("PPO", "toy/VectorMultiDiscrete-v0", {"n_steps": 64, "batch_size": 64}, 128),
]
SAC = ("SAC", "Pendulum-v1", {"learning_starts": 10, "policy_kwargs": {"net_arch": [32, 32]}}, 40)


@pytest.fixture(scope="module", autouse=True)
def _toys() -> None:
    """The toys again, with a plain vector to observe."""
    for name in ("MultiBinary", "MultiDiscrete"):
        if f"toy/Vector{name}-v0" not in gymnasium.registry:
            toy = gymnasium.spec(f"toy/{name}-v0")
            gymnasium.register(
                f"toy/Vector{name}-v0",
                entry_point=toy.entry_point,
                kwargs={**toy.kwargs, "observations": spaces.Box(-1, 1, (3,))},
            )


torch.set_num_threads(1)  # networks this small lose time to more


def learner(algorithm: str, env_id: str, parameters: dict[str, Any], steps: int) -> Any:
    model = getattr(stable_baselines3, algorithm)(
        "MlpPolicy", gymnasium.make(env_id), seed=1, device="cpu", **parameters
    )
    return model.learn(steps)


def visited(model: Any, env_id: str, episodes: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """States of some episodes that the learner itself plays, and what it does in them."""
    env = gymnasium.make(env_id)
    observations, actions = [], []
    for seed in range(episodes):
        observation, _ = env.reset(seed=seed)
        over = False
        while not over:
            action, _ = model.predict(observation, deterministic=True)
            observations.append(np.array(observation))
            actions.append(np.array(action))
            observation, _, terminated, truncated, _ = env.step(action)
            over = terminated or truncated
    return np.array(observations, dtype=np.float32), np.array(actions)


def agreement(mine: np.ndarray, theirs: np.ndarray) -> float:
    theirs = theirs.reshape(mine.shape)
    same = mine == theirs if mine.dtype.kind == "i" else np.abs(mine - theirs) <= 1e-4
    return float(same.all(axis=1).mean())


@pytest.mark.parametrize(("algorithm", "env_id", "parameters", "steps"), [*LEARNERS, SAC])
def test_agrees_with_the_learner_in_memory(
    algorithm: str, env_id: str, parameters: dict[str, Any], steps: int, tmp_path: Path
) -> None:
    model = learner(algorithm, env_id, parameters, steps)
    policy = export_policy(model, env_id=env_id)
    policy.save(tmp_path / "policy.npz")
    again = MlpPolicy.load(tmp_path / "policy.npz")
    observations, actions = visited(model, env_id)
    assert agreement(policy.act(observations), actions) >= 0.999
    assert (again.act(observations) == policy.act(observations)).all()


@pytest.mark.parametrize(("algorithm", "env_id", "parameters", "steps"), LEARNERS)
def test_agrees_with_the_learner_in_a_zip(
    algorithm: str, env_id: str, parameters: dict[str, Any], steps: int, tmp_path: Path
) -> None:
    model = learner(algorithm, env_id, parameters, steps)
    model.save(tmp_path / "model.zip")
    agent = make_agent(tmp_path / "model.zip", env_id)
    observations, actions = visited(model, env_id)
    assert agent.name == "model"
    assert agreement(agent.act(observations, None), actions) >= 0.999


def test_takes_over_the_normalisation() -> None:
    env = VecNormalize(DummyVecEnv([lambda: gymnasium.make("CartPole-v1")]))
    model = stable_baselines3.PPO("MlpPolicy", env, n_steps=64, batch_size=64, device="cpu")
    model.learn(256)
    policy = export_policy(model)
    raw = np.random.default_rng(0).normal(size=(500, 4)).astype(np.float32)
    theirs, _ = model.predict(env.normalize_obs(raw), deterministic=True)
    assert agreement(policy.act(raw), theirs) >= 0.999
    assert policy.normalisation is not None


@pytest.mark.parametrize("stochastic", [False, True])
def test_a_row_does_not_depend_on_the_batch(stochastic: bool) -> None:
    agent = make_agent("expert", "LunarLander-v3", stochastic=stochastic)
    rng = np.random.default_rng(0)
    observations = rng.normal(size=(257, 8)).astype(np.float32)
    uniforms = rng.random((257, 1)) if stochastic else None
    whole = agent.act(observations, uniforms)
    for start, end in ((0, 1), (1, 4), (4, 100), (100, 257)):
        part = None if uniforms is None else uniforms[start:end]
        assert (agent.act(observations[start:end], part) == whole[start:end]).all()
    outputs = agent.policy.outputs(observations)  # type: ignore[attr-defined]
    alone = np.concatenate([agent.policy.outputs(row[None]) for row in observations])  # type: ignore[attr-defined]
    assert outputs.tobytes() == alone.tobytes()


def test_samples_with_the_policys_probabilities() -> None:
    policy = make_agent("expert", "LunarLander-v3").policy  # type: ignore[attr-defined]
    state = np.zeros((1, 8), dtype=np.float32)
    drawn = policy.act(
        np.repeat(state, 50_000, axis=0), np.random.default_rng(0).random((50_000, 1))
    )
    shares = np.bincount(drawn[:, 0], minlength=4) / 50_000
    assert shares == pytest.approx(np.exp(policy.log_probabilities(state)[0]), abs=0.01)


def gaussian() -> MlpPolicy:
    return MlpPolicy(
        weights=(np.zeros((2, 1), np.float32),),
        biases=(np.full(1, 0.5, np.float32),),
        activation="tanh",
        head="gaussian",
        log_std=np.log(np.full(1, 0.25, np.float32)),
        action_low=np.full(1, -10, np.float32),
        action_high=np.full(1, 10, np.float32),
    )


def test_samples_a_normal_distribution() -> None:
    drawn = gaussian().act(
        np.zeros((50_000, 2), np.float32), np.random.default_rng(0).random((50_000, 1))
    )
    assert drawn.mean() == pytest.approx(0.5, abs=0.01)
    assert drawn.std() == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"weights": (), "biases": ()}, "no layers"),
        ({"biases": (np.zeros(2, np.float32),)}, "do not fit 2 inputs"),
        ({"weights": (np.full((2, 1), np.nan, np.float32),)}, "NaN or infinity"),
        ({"log_std": None}, "log std is not a row of 1"),
        ({"action_high": np.zeros(3, np.float32)}, "action high is not a row of 1"),
        ({"head": "squashed_gaussian"}, "1 outputs where its head .* needs 2"),
    ],
)
def test_weights_that_do_not_fit_are_refused(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        replace(gaussian(), **change)


class Boom:
    def __reduce__(self) -> Any:
        return (Path.touch, (Path("boom"),))


def test_a_bad_npz_is_one_sentence_and_runs_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, format=np.array([Boom()], dtype=object))
    foreign = tmp_path / "foreign.npz"
    np.savez(foreign, x=np.zeros(3))
    text = tmp_path / "text.npz"
    text.write_text("hello")
    bomb = tmp_path / "bomb.npz"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.npy", b"\0" * (257 * 2**20))
    gaussian().save(tmp_path / "whole.npz")
    with np.load(tmp_path / "whole.npz") as arrays:
        np.savez(tmp_path / "part.npz", **{k: v for k, v in arrays.items() if k != "bias_0"})
        np.savez(tmp_path / "head.npz", **{**arrays, "head": np.array("other")})
    for name, sentence in (
        ("pickled", "cannot be read as a policy"),
        ("foreign", "is not a policy of this program"),
        ("text", "cannot be read as a policy"),
        ("bomb", "unpacks to 257 MB"),
        ("part", "lacks a part"),
        ("head", "names the head 'other'"),
    ):
        with pytest.raises(InputError, match=sentence):
            MlpPolicy.load(tmp_path / f"{name}.npz")
    assert not Path("boom").exists()


def test_saving_to_a_missing_folder_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"the folder .* does not exist"):
        gaussian().save(tmp_path / "missing" / "policy.npz")
    assert list(tmp_path.iterdir()) == []
