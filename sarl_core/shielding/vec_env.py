"""The shield around a vectorised environment of Stable-Baselines3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sarl_core.environments.observation_layers import (
    Layer,
    Observed,
    behind,
    hands_on,
    normalised,
    read_layers,
)
from sarl_core.errors import needing_extras, require
from sarl_core.shielding.readers import state_vector
from sarl_core.shielding.shield import BatchDecision, Shield
from sarl_core.shielding.wrappers import StepRecord, check_penalty, fitted, is_flat

with needing_extras():
    from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn


class ShieldedVecEnv(VecEnvWrapper):
    """Environments side by side, every action of each passing through one shield.

    The record of each step is in ``infos[i]["shield"]``.

    Attributes:
        shield: The rules in force, in the order of the environments' features.
        notes: What is to be said of that order, where names do not tell it.
        penalty: Taken off the reward at every intervention.
    """

    def __init__(self, venv: VecEnv, shield: Shield, *, penalty: float = 0.0) -> None:
        """Wrap a vectorised environment.

        Args:
            venv: To wrap.
            shield: The rules in force.
            penalty: Taken off the reward at every intervention.

        Raises:
            InputError: If the penalty is no number, the rules are not for the spaces of this
                environment, its features have other names than theirs, or its observations are
                normalised.
        """
        must = "what is shielded must be a VecEnv of Stable-Baselines3"
        require(venv, VecEnv, must, "make one: DummyVecEnv([lambda: env])")
        check_penalty(penalty)
        super().__init__(venv)
        self.shield, self.notes = fitted(
            shield, venv.observation_space, venv.action_space, _observed(venv)
        )
        self.penalty = penalty
        self._states: Any = []
        self._decision: BatchDecision | None = None
        self._episodes = np.full(self.num_envs, -1)
        self._steps = np.zeros(self.num_envs, dtype=np.int64)

    @property
    def decision(self) -> BatchDecision:
        """What the shield made of the latest actions.

        Raises:
            ValueError: If there were none yet.
        """
        if self._decision is None:
            raise ValueError("no action has been taken yet")
        return self._decision

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the next reset, from which the episodes in the records are counted."""
        self._episodes[:] = -1
        return self.venv.seed(seed)

    def reset(self) -> VecEnvObs:
        """Start an episode in each environment."""
        observations = self.venv.reset()
        self._remember(observations)
        self._episodes += 1
        self._steps[:] = 0
        return observations

    def step_async(self, actions: np.ndarray[Any, Any]) -> None:
        """Check the actions and hand on what the shield makes of them."""
        self._decision = self._decide(actions)
        self.venv.step_async(self._decision.executed)

    def step_wait(self) -> VecEnvStepReturn:
        """Wait for the environments and record the step in each."""
        observations, rewards, dones, infos = self.venv.step_wait()
        decision = self.decision
        for i, info in enumerate(infos):
            info["shield"] = StepRecord(
                int(self._episodes[i]),
                int(self._steps[i]),
                self._states[i],
                decision.proposed[i],
                decision.executed[i],
                tuple(int(rule) if rule >= 0 else None for rule in decision.rules[i]),
                bool(decision.intervened[i]),
                float(decision.margin[i]),
                bool(decision.outside[i]),
                decision.invalid[i],
            )
        if self.penalty:
            rewards = rewards - self.penalty * decision.intervened.astype(rewards.dtype)
        self._remember(observations)
        self._steps = np.where(dones, 0, self._steps + 1)
        self._episodes += dones
        return observations, rewards, dones, infos

    def _decide(self, actions: np.ndarray[Any, Any]) -> BatchDecision:
        """The shield's decision, one action an environment; a subclass may leave some alone."""
        return self.shield.decide_batch(self._states, actions)

    def _remember(self, observations: Any) -> None:
        space = self.venv.observation_space
        by = None if is_flat(space) else space
        rows = [state_vector(_row(observations, i), by) for i in range(self.num_envs)]
        shapes = {np.shape(row) if _is_float32(row) else None for row in rows}
        self._states = np.array(rows) if len(shapes) == 1 and None not in shapes else rows


def _observed(venv: VecEnv) -> Observed:
    """Whose observations they are: wrappers may be around all environments, or around each."""
    layers = []
    while isinstance(venv, VecEnvWrapper):
        name = type(venv).__name__
        if isinstance(venv, VecNormalize):
            if venv.norm_obs:
                raise normalised(name)
        elif not hands_on(type(venv), "step_wait", "reset"):
            layers.append(Layer(name, ()))
        venv = venv.venv
    try:
        texts = dict.fromkeys(venv.env_method("__str__"))
    except (AttributeError, NotImplementedError):
        texts = {"": None}
    environments = []
    for text in texts:
        inner, env_id = read_layers(text)
        environments.append(behind([*layers, *inner], env_id))
    # One of them without names is enough: the shield has one order for all.
    return min(environments, key=lambda one: one.env_id)


def _row(observations: Any, i: int) -> Any:
    """The observation of one environment out of what a vectorised one stacks."""
    if isinstance(observations, dict):
        return {name: value[i] for name, value in observations.items()}
    if isinstance(observations, tuple):
        return tuple(value[i] for value in observations)
    return observations[i]


def _is_float32(row: Any) -> bool:
    return isinstance(row, np.ndarray) and row.dtype == np.float32
