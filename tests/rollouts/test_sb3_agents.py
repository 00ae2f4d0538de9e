"""What is read of a file that Stable-Baselines3 saved acts as its `predict` does."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import sb3_contrib
import stable_baselines3
import torch
from gymnasium.wrappers import NormalizeObservation, RescaleAction
from sb3_contrib.common.maskable.policies import MaskableActorCriticPolicy
from sb3_contrib.common.wrappers import ActionMasker
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from sarl_core.errors import InputError
from sarl_core.rollouts.activations import TORCH_CLASSES
from sarl_core.rollouts.agents import PolicyAgent, make_agent
from sarl_core.rollouts.policies import MlpPolicy
from sarl_core.rollouts.training import export_policy

CART, PENDULUM = "CartPole-v1", "Pendulum-v1"
SMALL = {"net_arch": [16, 16]}
ON_POLICY = {"n_steps": 64, "batch_size": 64}
OFF_POLICY = {"learning_starts": 20, "buffer_size": 1000, "batch_size": 16}

torch.set_num_threads(1)  # networks this small lose time to more


def learner(
    name: str, env: Any, steps: int = 128, kind: Any = "MlpPolicy", **parameters: Any
) -> Any:
    module = stable_baselines3 if hasattr(stable_baselines3, name) else sb3_contrib
    given = {**parameters, "policy_kwargs": {**parameters.get("policy_kwargs", SMALL)}}
    return getattr(module, name)(kind, env, seed=1, device="cpu", **given).learn(steps)


def read(model: Any, folder: Path, env_id: str, **options: Any) -> PolicyAgent:
    model.save(folder / "model.zip")
    agent = make_agent(folder / "model.zip", env_id, **options)
    assert isinstance(agent, PolicyAgent)
    return agent


def states(env_id: str, count: int = 200) -> np.ndarray:
    """States that episodes of random actions lead to."""
    env = gymnasium.make(env_id)
    env.action_space.seed(0)
    rows: list[np.ndarray] = []
    while len(rows) < count:
        observation, over = env.reset(seed=len(rows))[0], False
        while not over and len(rows) < count:
            rows.append(np.array(observation))
            observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
            over = terminated or truncated
    env.close()
    return np.array(rows, dtype=np.float32)


def differing(agent: Any, model: Any, rows: np.ndarray, shown: np.ndarray | None = None) -> int:
    """In how many states it does something else than the original's `predict`."""
    theirs, _ = model.predict(rows if shown is None else shown, deterministic=True)
    mine = agent.act(rows, None)
    return int((np.abs(mine - theirs.reshape(mine.shape)) > 2e-5).any(axis=1).sum())


@pytest.mark.parametrize(
    ("name", "env_id", "parameters"),
    [
        ("TD3", PENDULUM, OFF_POLICY),
        ("DDPG", PENDULUM, OFF_POLICY),
        ("SAC", PENDULUM, OFF_POLICY),
        ("TQC", PENDULUM, OFF_POLICY),
        ("TQC", PENDULUM, {**OFF_POLICY, "use_sde": True}),
        ("CrossQ", PENDULUM, OFF_POLICY),
        ("CrossQ", PENDULUM, {**OFF_POLICY, "use_sde": True}),
        ("CrossQ", PENDULUM, {**OFF_POLICY, "policy_kwargs": {**SMALL, "batch_norm": False}}),
        (
            "CrossQ",
            PENDULUM,
            {**OFF_POLICY, "policy_kwargs": {**SMALL, "batch_norm_eps": 0.5}},
        ),
        ("QRDQN", CART, OFF_POLICY),
        ("QRDQN", CART, {**OFF_POLICY, "policy_kwargs": {**SMALL, "n_quantiles": 7}}),
        ("TRPO", PENDULUM, ON_POLICY),
        ("ARS", PENDULUM, {"n_delta": 2}),
        ("ARS", CART, {"n_delta": 2}),
        ("PPO", PENDULUM, {**ON_POLICY, "use_sde": True}),
        (
            "PPO",
            PENDULUM,
            {**ON_POLICY, "use_sde": True, "policy_kwargs": {**SMALL, "squash_output": True}},
        ),
        ("A2C", PENDULUM, {"use_sde": True, "policy_kwargs": {**SMALL, "full_std": False}}),
        ("SAC", PENDULUM, {**OFF_POLICY, "use_sde": True}),
        (
            "SAC",
            PENDULUM,
            {**OFF_POLICY, "use_sde": True, "policy_kwargs": {**SMALL, "clip_mean": 0.5}},
        ),
        (
            "SAC",
            PENDULUM,
            {**OFF_POLICY, "use_sde": True, "policy_kwargs": {**SMALL, "clip_mean": 0.0}},
        ),
        (
            "PPO",
            CART,
            {
                **ON_POLICY,
                "policy_kwargs": {
                    "net_arch": {"pi": [8], "vf": [4, 4]},
                    "share_features_extractor": False,
                    "features_extractor_class": FlattenExtractor,
                    "ortho_init": False,
                },
            },
        ),
        ("DQN", CART, {**OFF_POLICY, "policy_kwargs": {"net_arch": []}}),
        ("SAC", PENDULUM, {**OFF_POLICY, "policy_kwargs": {"net_arch": []}}),
    ],
)
def test_every_algorithm_acts_as_the_original(
    name: str, env_id: str, parameters: dict[str, Any], tmp_path: Path
) -> None:
    model = learner(name, env_id, **parameters)
    rows = np.concatenate([states(env_id), 30 * states(env_id)])  # from usual to far off
    agent = read(model, tmp_path, env_id)
    assert agent.notes == ()
    assert differing(agent, model, rows) == 0
    assert len(np.unique(agent.act(rows, None))) > 1
    # In memory, and through a file of ours, it is the same.
    exported = export_policy(model, env_id=env_id)
    exported.save(tmp_path / "policy.npz")
    again = MlpPolicy.load(tmp_path / "policy.npz")
    for policy in (exported, again):
        assert (policy.act(rows) == agent.policy.act(rows)).all()
    assert (again.head, again.mean_bound, again.noise_by_state) == (
        agent.policy.head,
        agent.policy.mean_bound,
        agent.policy.noise_by_state,
    )


def test_a_linear_ars_has_no_bias_and_no_tanh(tmp_path: Path) -> None:
    model = learner("ARS", PENDULUM, kind="LinearPolicy", policy_kwargs={}, n_delta=2)
    assert differing(read(model, tmp_path, PENDULUM), model, 10 * states(PENDULUM)) == 0


@pytest.mark.parametrize("torch_class", TORCH_CLASSES)
def test_every_activation_acts_as_the_original(torch_class: str, tmp_path: Path) -> None:
    kwargs = {"net_arch": [16, 16], "activation_fn": getattr(torch.nn, torch_class)}
    model = stable_baselines3.PPO("MlpPolicy", PENDULUM, policy_kwargs=kwargs, seed=1, device="cpu")
    with torch.no_grad():  # far from 0, where activations differ the most
        for parameter in model.policy.parameters():
            parameter.mul_(3.0)
    rows = states(PENDULUM)
    agent = read(model, tmp_path, PENDULUM)
    assert differing(agent, model, rows) == 0
    hidden = np.linspace(-30.0, 30.0, 4001, dtype=np.float32)
    with torch.no_grad():
        theirs = getattr(torch.nn, torch_class)().eval()(torch.from_numpy(hidden)).numpy()
    layer = MlpPolicy(
        weights=(np.ones((1, 1), np.float32), np.ones((1, 1), np.float32)),
        biases=(np.zeros(1, np.float32), np.zeros(1, np.float32)),
        activation=TORCH_CLASSES[torch_class],
        head="clipped",
        action_low=np.full(1, -np.inf, np.float32),
        action_high=np.full(1, np.inf, np.float32),
    )
    mine = layer.outputs(hidden[:, None])
    assert mine.dtype == np.float32
    np.testing.assert_allclose(mine[:, 0], theirs, rtol=2e-6, atol=2e-6)


def test_noise_that_hangs_on_the_state_is_not_sampled(tmp_path: Path) -> None:
    model = learner("PPO", PENDULUM, use_sde=True, **ON_POLICY)
    with pytest.raises(InputError, match=r"gSDE.*leave out --stochastic"):
        read(model, tmp_path, PENDULUM, stochastic=True)
    export_policy(model).save(tmp_path / "policy.npz")
    with pytest.raises(InputError, match=r"gSDE.*leave out --stochastic"):
        make_agent(tmp_path / "policy.npz", PENDULUM, stochastic=True)


def test_a_policy_without_a_distribution_needs_no_random_numbers(tmp_path: Path) -> None:
    model = learner("TD3", PENDULUM, **OFF_POLICY)
    assert read(model, tmp_path, PENDULUM, stochastic=True).n_uniforms == 0


class OwnPolicy(ActorCriticPolicy):
    """Acts contrary."""

    def _predict(self, observation: Any, deterministic: bool = False) -> torch.Tensor:
        return 1 - super()._predict(observation, deterministic)


class OwnExtractor(FlattenExtractor):
    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return -super().forward(observations)


class OwnActivation(torch.nn.Tanh):
    pass


def masked() -> gymnasium.Env[Any, Any]:
    return ActionMasker(gymnasium.make(CART), lambda env: np.array([True, False]))


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: learner("PPO", CART, kind=OwnPolicy, steps=0), r"the class '.*\.OwnPolicy'"),
        (
            lambda: learner(
                "PPO", CART, policy_kwargs={"features_extractor_class": OwnExtractor}, steps=0
            ),
            r"extracts features by '.*\.OwnExtractor'",
        ),
        (
            lambda: learner("PPO", CART, policy_kwargs={"activation_fn": OwnActivation}, steps=0),
            r"the activation '.*\.OwnActivation'",
        ),
        (
            lambda: learner("PPO", CART, policy_kwargs={"activation_fn": torch.nn.PReLU}, steps=0),
            r"the activation 'torch\.nn\.modules\.activation\.PReLU'",
        ),
        (
            lambda: learner(
                "PPO",
                CART,
                policy_kwargs={"activation_fn": lambda: torch.nn.LeakyReLU(0.3)},
                steps=0,
            ),
            "the activation '<function",
        ),
        (
            lambda: learner("MaskablePPO", masked(), steps=0),
            rf"the class '{MaskableActorCriticPolicy.__module__}.MaskableActorCriticPolicy'",
        ),
        (
            lambda: learner("RecurrentPPO", CART, kind="MlpLstmPolicy", steps=0),
            "the class '.*RecurrentActorCriticPolicy'",
        ),
    ],
)
def test_what_is_not_known_is_refused_by_its_name(
    make: Callable[[], Any], sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=sentence) as caught:
        read(make(), tmp_path, CART)
    assert len(str(caught.value)) < 600
    assert "\n" not in str(caught.value)


def rewritten(path: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """A copy of a zip with other text."""
    target = path.with_name("rewritten.zip")
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename == "data":
                data = json.loads(content)
                change(data)
                content = json.dumps(data).encode()
            new.writestr(entry.filename, content)
    return target


def test_unknown_arguments_and_classes_without_a_name_are_refused(tmp_path: Path) -> None:
    model = stable_baselines3.PPO("MlpPolicy", CART, device="cpu")
    model.save(tmp_path / "model.zip")
    for change, sentence in (
        (lambda data: data["policy_kwargs"].update(temperature=3), "made with 'temperature'"),
        (lambda data: data["policy_class"].update(__module__="mine"), "'mine.ActorCriticPolicy'"),
        (lambda data: data.update(policy_class="Mine"), "of the class 'Mine'"),
        (lambda data: data["policy_class"].pop("__module__"), "of the class \"<class 'abc"),
        (lambda data: data["policy_kwargs"].update(squash_output="yes"), "neither true nor false"),
    ):
        with pytest.raises(InputError, match=sentence):
            make_agent(rewritten(tmp_path / "model.zip", change), CART)


def test_a_file_that_names_no_class_is_read_by_its_weights_and_that_is_said(tmp_path: Path) -> None:
    model = learner("PPO", CART, **ON_POLICY)
    model.save(tmp_path / "model.zip")
    nameless = rewritten(tmp_path / "model.zip", lambda data: data.pop("policy_class") and None)
    agent = make_agent(nameless, CART)
    assert isinstance(agent, PolicyAgent)
    assert "does not name the class" in agent.notes[0]
    assert differing(agent, model, states(CART)) == 0


def test_layers_that_older_versions_shared_with_the_critic_are_read(tmp_path: Path) -> None:
    from sarl_core.rollouts.sb3_weights import policy_from_state

    rng = np.random.default_rng(0)
    sizes = {"mlp_extractor.shared_net.0": (5, 4), "mlp_extractor.policy_net.0": (3, 5)}
    state = {}
    for name, shape in {**sizes, "action_net": (2, 3), "value_net": (1, 5)}.items():
        state[f"{name}.weight"] = rng.normal(size=shape).astype(np.float32)
        state[f"{name}.bias"] = rng.normal(size=shape[0]).astype(np.float32)
    policy = policy_from_state(state, discrete=True)
    hidden = row = rng.normal(size=(1, 4)).astype(np.float32)
    for name in sizes:
        hidden = np.tanh(hidden @ state[f"{name}.weight"].T + state[f"{name}.bias"])
    expected = hidden @ state["action_net.weight"].T + state["action_net.bias"]
    np.testing.assert_allclose(policy.outputs(row), expected, rtol=1e-5)


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


@pytest.mark.parametrize(("name", "env_id"), [("SAC", PENDULUM), ("DQN", CART)])
def test_an_off_policy_learner_without_its_statistics_does_not_pass_in_silence(
    name: str, env_id: str, tmp_path: Path
) -> None:
    model = learner(name, normalising(env_id), steps=150, **OFF_POLICY)
    try:
        said = " ".join(read(model, tmp_path, env_id).notes)  # where it cannot be sure
    except InputError as error:
        said = str(error)
    assert "VecNormalize" in said
    assert "--normalise FILE" in said


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
