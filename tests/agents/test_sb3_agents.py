"""What is read of a file that Stable-Baselines3 saved acts as its `predict` does."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import stable_baselines3
import torch
from sb3_contrib.common.maskable.policies import MaskableActorCriticPolicy
from sb3_contrib.common.wrappers import ActionMasker
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor

from sarl_core.agents.activations import TORCH_CLASSES
from sarl_core.agents.agent import PolicyAgent
from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.errors import InputError
from sarl_core.learning.experts import export_policy
from sarl_core.rollouts.trial import make_agent
from tests.agents.sb3_learners import (
    CART,
    OFF_POLICY,
    ON_POLICY,
    PENDULUM,
    SMALL,
    differing,
    learner,
    read,
    states,
)


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
    # Of a learner with a buffer one cannot always tell that it saw what the environment gives.
    assert all("does not tell whether its observations were" in note for note in agent.notes)
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
    from sarl_core.agents.sb3_weights import policy_from_state

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
