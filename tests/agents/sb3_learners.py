"""Learners of Stable-Baselines3 that have hardly learned, and their files read again."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import sb3_contrib
import stable_baselines3
import torch

from sarl_core.agents.agent import PolicyAgent
from sarl_core.rollouts.trial import make_agent

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
