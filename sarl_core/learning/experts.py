"""Training the experts that are shipped, with Stable-Baselines3, and exporting their weights.

The only place that trains. A recipe is a set of hyperparameters for one environment; the best
policy by validation episodes is kept, and the card reports episodes never used for choosing.
"""

from __future__ import annotations

import copy
import platform
import shlex
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import PolicyAgent
from sarl_core.agents.mlp_policy import MlpPolicy, Normalisation
from sarl_core.agents.policy_files import write_card
from sarl_core.environments.description import make_environment
from sarl_core.environments.environment import EnvironmentOrId, as_environment
from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.seeds import EXPERT_CHOICE, EXPERT_REPORT

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.vec_env import VecEnv


@dataclass(frozen=True)
class Recipe:
    """How one expert is trained.

    Attributes:
        algorithm: Name of a Stable-Baselines3 algorithm.
        steps: Environment steps, over all environments.
        n_envs: Environments side by side.
        normalise: Whether observations and rewards are normalised while learning.
        parameters: Handed to the algorithm; a ``"linear:x"`` learning rate falls from x to 0.
        validation_every: Steps between validations.
        gamma: Discount factor.
    """

    algorithm: str
    steps: int
    n_envs: int
    normalise: bool
    parameters: Mapping[str, Any]
    validation_every: int
    gamma: float = 0.99


# Values after the algorithms' own papers and defaults, moved by hand until the returns were there.
_LANDER = Recipe(
    algorithm="PPO",
    steps=2_000_000,
    n_envs=16,
    normalise=False,
    validation_every=100_000,
    gamma=0.999,
    parameters={
        "n_steps": 1024,
        "batch_size": 256,
        "n_epochs": 6,
        "gae_lambda": 0.98,
        "learning_rate": "linear:0.0006",
        "clip_range": 0.2,
    },
)
RECIPES: dict[str, Recipe] = {
    "CartPole-v1": Recipe(
        algorithm="PPO",
        steps=150_000,
        n_envs=8,
        normalise=False,
        validation_every=10_000,
        gamma=0.98,
        parameters={
            "n_steps": 128,
            "batch_size": 256,
            "n_epochs": 10,
            "gae_lambda": 0.9,
            "learning_rate": "linear:0.001",
            "clip_range": 0.2,
        },
    ),
    "LunarLander-v3": _LANDER,
    "LunarLanderContinuous-v3": replace(_LANDER, steps=1_500_000),
    "BipedalWalker-v3": Recipe(
        algorithm="PPO",
        steps=3_000_000,
        n_envs=16,
        normalise=True,
        validation_every=100_000,
        gamma=0.999,
        parameters={
            "n_steps": 1024,
            "batch_size": 256,
            "n_epochs": 8,
            "gae_lambda": 0.95,
            "learning_rate": "linear:0.0004",
            "clip_range": 0.18,
        },
    ),
    "Pendulum-v1": Recipe(
        algorithm="SAC",
        steps=20_000,
        n_envs=1,
        normalise=False,
        validation_every=2_500,
        parameters={"learning_rate": 0.001, "policy_kwargs": {"net_arch": [64, 64]}},
    ),
}


def train_expert(
    env_id: EnvironmentOrId,
    *,
    out: Path,
    seed: int = 0,
    steps: int | None = None,
    progress: Callable[[int, int, float], None] | None = None,
) -> dict[str, Any]:
    """Train an expert, keep the best policy by validation, and write weights and card.

    Args:
        env_id: An environment with a recipe.
        out: Path of the `.npz` to write; the card stands beside it as `.json`.
        seed: Of the learner and its environments.
        steps: In place of the recipe's number.
        progress: Called with (steps done, steps in all, last validation mean).

    Returns:
        The card.

    Raises:
        InputError: If there is no recipe for the environment.
    """
    if str(env_id) not in RECIPES:
        known = ", ".join(sorted(RECIPES))
        raise InputError(f"there is no training recipe for {str(env_id)!r}; recipes: {known}")
    recipe = RECIPES[str(env_id)]
    total = steps or recipe.steps
    started = time.monotonic()
    model, env = _make_learner(env_id, recipe, seed)
    keeper = _keep_best(env_id, recipe, total, progress)
    model.learn(total, callback=keeper, progress_bar=False)
    best = keeper.finish()
    env.close()
    _, policy, best_steps = best
    policy.save(out)
    returns = _returns(env_id, policy, episodes=100, seed=EXPERT_REPORT)
    sampled = _returns(env_id, policy, episodes=100, seed=EXPERT_REPORT, stochastic=True)
    card = _card(
        env_id, recipe, seed, total, best_steps, returns, sampled, time.monotonic() - started, out
    )
    write_card(out.with_suffix(".json"), card)
    return card


def export_policy(model: BaseAlgorithm, *, env_id: str = "") -> MlpPolicy:
    """Read an `MlpPolicy` of Stable-Baselines3 into arrays.

    Args:
        model: The learner, in memory.
        env_id: Kept with the policy.

    Returns:
        A policy that gives the same actions.

    Raises:
        InputError: If it is a policy of another kind.
    """
    from gymnasium import spaces
    from stable_baselines3.common.vec_env import VecNormalize

    from sarl_core.agents.sb3_settings import read_settings
    from sarl_core.agents.sb3_weights import policy_from_state
    from sarl_core.agents.spaces import label_counts

    state = {
        name: value.detach().cpu().numpy().copy()
        for name, value in model.policy.state_dict().items()
    }
    normalisation = None
    env = model.get_env()
    if isinstance(env, VecNormalize) and env.norm_obs:
        statistics: Any = env.obs_rms  # one object, as an MlpPolicy takes no Dict observation
        normalisation = Normalisation(
            mean=statistics.mean.copy(),
            variance=statistics.var.copy(),
            clip=float(env.clip_obs),
            epsilon=float(env.epsilon),
        )
    kind = type(model.policy)
    settings = read_settings(
        f"{kind.__module__}.{kind.__qualname__}",
        {
            name: value if isinstance(value, (bool, int, float)) or value is None else str(value)
            for name, value in (model.policy_kwargs or {}).items()
        },
    )
    space = model.action_space
    return policy_from_state(
        state,
        discrete=not isinstance(space, spaces.Box),
        label_counts=label_counts(space),
        action_low=_bounds(space.low) if isinstance(space, spaces.Box) else None,
        action_high=_bounds(space.high) if isinstance(space, spaces.Box) else None,
        settings=settings,
        normalisation=normalisation,
        env_id=env_id,
    )


def _bounds(values: NDArray[Any]) -> NDArray[np.float32]:
    return values.reshape(-1).astype(np.float32)


def _make_learner(
    env_id: EnvironmentOrId, recipe: Recipe, seed: int
) -> tuple[BaseAlgorithm, VecEnv]:
    import stable_baselines3
    import torch
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import VecNormalize

    torch.set_num_threads(1)  # the networks are too small to gain from more
    env: VecEnv = make_vec_env(lambda: make_environment(env_id), n_envs=recipe.n_envs, seed=seed)
    if recipe.normalise:
        env = VecNormalize(env, gamma=recipe.gamma)
    # A copy: the learner fills in what it was not told.
    parameters = copy.deepcopy(dict(recipe.parameters))
    rate = parameters.get("learning_rate")
    if isinstance(rate, str):
        start = float(rate.removeprefix("linear:"))
        parameters["learning_rate"] = lambda remaining: start * max(remaining, 0.02)
    algorithm = getattr(stable_baselines3, recipe.algorithm)
    model = algorithm("MlpPolicy", env, seed=seed, gamma=recipe.gamma, device="cpu", **parameters)
    return model, env


def _keep_best(
    env_id: EnvironmentOrId,
    recipe: Recipe,
    total: int,
    progress: Callable[[int, int, float], None] | None,
) -> Any:
    """A callback of Stable-Baselines3 that validates as it goes and remembers the best policy."""
    from stable_baselines3.common.callbacks import BaseCallback

    class KeepBest(BaseCallback):
        def __init__(self) -> None:
            super().__init__()
            self.best: tuple[float, MlpPolicy, int] | None = None
            self.next_validation = recipe.validation_every

        def _on_step(self) -> bool:
            if self.num_timesteps >= self.next_validation:
                self.next_validation += recipe.validation_every
                self.validate()
            return True

        def validate(self) -> None:
            policy = export_policy(self.model, env_id=str(env_id))
            returns = _returns(env_id, policy, episodes=50, seed=EXPERT_CHOICE)
            score = float(np.mean(returns))
            if self.best is None or score >= self.best[0]:
                self.best = (score, policy, self.num_timesteps)
            if progress is not None:
                progress(self.num_timesteps, total, score)

        def finish(self) -> tuple[float, MlpPolicy, int]:
            self.validate()
            assert self.best is not None
            return self.best

    return KeepBest()


def _returns(
    env_id: EnvironmentOrId,
    policy: MlpPolicy,
    *,
    episodes: int,
    seed: int,
    stochastic: bool = False,
) -> NDArray[np.float64]:
    """Returns of a policy, episode by episode."""
    first = np.zeros(policy.n_dimensions, dtype=np.int64)
    agent = PolicyAgent("expert", policy, stochastic, first)
    return rollout(env_id, agent, episodes=episodes, seed=seed, keep_steps=False).returns


def _card(
    env_id: EnvironmentOrId,
    recipe: Recipe,
    seed: int,
    steps: int,
    best_steps: int,
    returns: NDArray[np.float64],
    sampled: NDArray[np.float64],
    seconds: float,
    out: Path,
) -> dict[str, Any]:
    import gymnasium
    import stable_baselines3
    import torch

    def summary(values: NDArray[np.float64]) -> dict[str, float | int]:
        return {
            "episodes": len(values),
            "mean": round(float(values.mean()), 2),
            "std": round(float(values.std(ddof=1)), 2),
            "min": round(float(values.min()), 2),
            "max": round(float(values.max()), 2),
        }

    return {
        "what": f"expert for {env_id}",
        "command": f"python -m sarl_core train-expert {shlex.join(as_environment(env_id).words)} "
        f"--seed {seed} --steps {steps} --out {out.as_posix()}",
        "algorithm": recipe.algorithm,
        "policy": "MlpPolicy",
        "seed": seed,
        "steps": steps,
        "kept_after_steps": best_steps,
        "kept_by": f"mean of 50 episodes, seeds {EXPERT_CHOICE} and up",
        "n_envs": recipe.n_envs,
        "normalised": recipe.normalise,
        "gamma": recipe.gamma,
        "parameters": dict(recipe.parameters),
        "report_seeds": f"{EXPERT_REPORT} and up",
        "returns_deterministic": summary(returns),
        "returns_sampled": summary(sampled),
        "versions": {
            "python": platform.python_version(),
            "numpy": np.__version__,
            "gymnasium": gymnasium.__version__,
            "torch": torch.__version__,
            "stable_baselines3": stable_baselines3.__version__,
        },
        "seconds": round(seconds),
        "made": datetime.now(UTC).date().isoformat(),
    }
