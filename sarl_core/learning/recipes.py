"""Which learner an arm takes, and with which hyperparameters: the same for every arm of a kind."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from sarl_core.environments.description import make_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.learning.arms import SEEDS_APART, LearningArm
from sarl_core.shielding.shield import Shield

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv

_ENVIRONMENTS = 8  # side by side, for PPO

# By the beginning of the environment's id.
_PPO: dict[str, dict[str, Any]] = {
    "CartPole": {
        "n_steps": 64,
        "batch_size": 128,
        "n_epochs": 10,
        "gamma": 0.98,
        "gae_lambda": 0.9,
        "learning_rate": 0.001,
    },
    "": {
        "n_steps": 256,
        "batch_size": 64,
        "n_epochs": 4,
        "gamma": 0.999,
        "gae_lambda": 0.98,
        "ent_coef": 0.01,
        "learning_rate": 0.0005,
    },
}
_DQN: dict[str, dict[str, Any]] = {
    "CartPole": {
        "learning_rate": 0.0005,
        "batch_size": 64,
        "learning_starts": 1000,
        "gamma": 0.98,
        "target_update_interval": 250,
        "train_freq": 4,
        "gradient_steps": 4,
        "exploration_fraction": 0.2,
        "exploration_final_eps": 0.04,
        "policy_kwargs": {"net_arch": [64, 64]},
    },
    "": {
        "learning_rate": 0.00063,
        "batch_size": 128,
        "learning_starts": 1000,
        "gamma": 0.99,
        "target_update_interval": 250,
        "train_freq": 4,
        "gradient_steps": 2,
        "exploration_fraction": 0.12,
        "exploration_final_eps": 0.1,
        "policy_kwargs": {"net_arch": [128, 128]},
    },
}
_SAC: dict[str, Any] = {
    "learning_rate": 0.00073,
    "batch_size": 256,
    "learning_starts": 1000,
    "gamma": 0.99,
    "tau": 0.01,
    "policy_kwargs": {"net_arch": [128, 128]},
}
_REPLAY = 100_000  # steps that an off-policy learner remembers


def make_learner(
    env_id: EnvironmentOrId, shield: Shield | None, arm: LearningArm, *, steps: int, seed: int
) -> tuple[BaseAlgorithm, VecEnv]:
    """Make the learner of an arm, and its environments.

    Args:
        env_id: What ``gymnasium.make`` takes.
        shield: In force while learning; None for none.
        arm: The way to learn.
        steps: That it will learn for.
        seed: Of learner and environments.

    Returns:
        Both; the environments are shielded if there is a shield.
    """
    import torch
    from gymnasium.spaces import Box
    from stable_baselines3.common.vec_env import DummyVecEnv

    from sarl_core.learning import learners
    from sarl_core.learning import replay_buffers as learning_memory

    torch.set_num_threads(1)  # the networks are too small to gain from more
    side_by_side = 1 if arm.replay else _ENVIRONMENTS
    env: VecEnv = DummyVecEnv([lambda: _environment(env_id)] * side_by_side)
    if shield is not None:
        env = learning_memory.HandoverVecEnv(env, shield, penalty=arm.penalty)
    common: dict[str, Any] = {
        "policy": "MlpPolicy",
        "env": env,
        "device": "cpu",
        "seed": seed * SEEDS_APART,
    }
    if arm.replay:
        continuous = isinstance(env.action_space, Box)
        recipe = dict(_SAC) if continuous else _recipe(_DQN, str(env_id))
        recipe["buffer_size"] = min(_REPLAY, steps)
        recipe["learning_starts"] = min(recipe["learning_starts"], steps // 10)
        algorithm: Any = learners.ExecutedSAC if continuous else learners.ExecutedDQN
        return algorithm(**common, **recipe), env
    with warnings.catch_warnings():
        # A last batch that is smaller than the others does no harm.
        warnings.filterwarnings("ignore", message="You have specified a mini-batch size")
        return _policy_gradient(str(env_id), env, arm, steps, common), env


def _policy_gradient(
    env_id: str, env: VecEnv, arm: LearningArm, steps: int, common: Mapping[str, Any]
) -> BaseAlgorithm:
    from stable_baselines3 import PPO

    from sarl_core.learning import learners
    from sarl_core.learning import replay_buffers as learning_memory

    recipe = _recipe(_PPO, env_id)
    recipe["learning_rate"] = _falling(recipe["learning_rate"])
    rollouts = -(-steps // (env.num_envs * recipe["n_steps"]))
    recipe["n_steps"] = max(2, steps // (env.num_envs * rollouts))  # so that none is left half done
    if arm.memory == "proposed":
        return PPO(**common, **recipe)
    recipe["rollout_buffer_class"] = learning_memory.ShieldedRolloutBuffer
    recipe["rollout_buffer_kwargs"] = {"venv": env, "memory": arm.memory}
    model: PPO
    if arm.memory == "executed":
        model = PPO(**common, **recipe)
    else:
        recipe["policy_kwargs"] = {"sharpness": arm.sharpness}
        common = {**common, "policy": learners.DecidedPolicy}
        model = learners.MaskedPPO(**common, **recipe)
        model.imitation = arm.imitation
        assert isinstance(model.policy, learners.DecidedPolicy)
        assert isinstance(env, learning_memory.HandoverVecEnv)
        model.policy.venv = env
    assert isinstance(model.rollout_buffer, learning_memory.ShieldedRolloutBuffer)
    model.rollout_buffer.policy = model.policy
    return model


def _recipe(recipes: Mapping[str, dict[str, Any]], env_id: str) -> dict[str, Any]:
    name = env_id.rsplit(":", 1)[-1].rsplit("/", 1)[-1]
    return dict(next(recipe for start, recipe in recipes.items() if name.startswith(start)))


def _falling(start: float) -> Callable[[float], float]:
    """A learning rate that falls to nearly nothing: the last steps settle what was learned."""
    return lambda remaining: start * max(remaining, 0.02)


def _environment(env_id: EnvironmentOrId) -> Any:
    from gymnasium.wrappers import FlattenObservation

    from sarl_core.learning.faults import WatchedEnvironment
    from sarl_core.shielding.wrappers import is_flat

    env = make_environment(env_id)
    return WatchedEnvironment(env if is_flat(env.observation_space) else FlattenObservation(env))
