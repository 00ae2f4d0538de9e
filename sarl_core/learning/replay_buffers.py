"""What a shielded learner remembers: what was executed, where it had no choice, what rules said.

Loads torch and Stable-Baselines3: imported only where something is learned.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.policies import ActorCriticPolicy

from sarl_core.learning.arms import Memory
from sarl_core.shielding.leeway import allowed_actions
from sarl_core.shielding.shield import BatchDecision
from sarl_core.shielding.vec_env import ShieldedVecEnv

_LESSONS = 50_000  # states whose rule is remembered; the oldest go first


class HandoverVecEnv(ShieldedVecEnv):
    """Shielded environments, some of which may be left to the learner.

    Attributes:
        enforced: Whether the rules are in force in each environment, (n_envs,) bool; to be
            changed where an episode begins. Where they are not, the record names no rule.
        advice: What the shield would have made of the latest actions, were it in force everywhere.
        choices: What it would have let pass where the learner looked last, were it in force
            everywhere, (n_envs, actions) bool; None where it does not look.
        left: What the learner could choose from there, likewise.
    """

    advice: BatchDecision
    choices: NDArray[np.bool_] | None = None
    left: NDArray[np.bool_] | None = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """As `ShieldedVecEnv`."""
        super().__init__(*args, **kwargs)
        self.enforced = np.ones(self.num_envs, dtype=np.bool_)

    def look(self) -> NDArray[np.bool_] | None:
        """See what the learner may choose from, before it does.

        Returns:
            Shape (n_envs, actions); everything where the rules are not in force. None where
            actions are continuous, or all rules demand one: what it samples is replaced then.
        """
        space = self.action_space
        if isinstance(space, spaces.Discrete) and self.shield.rule_set.forbids:
            self.choices = allowed_actions(self.shield, self._states, int(space.n))
            self.left = self.choices | ~self.enforced[:, None]
        return self.left

    def _decide(self, actions: np.ndarray[Any, Any]) -> BatchDecision:
        decision = self.advice = super()._decide(actions)
        if self.enforced.all():
            return decision
        on = self.enforced.reshape(-1, *[1] * (actions.ndim - 1))
        return BatchDecision(
            executed=np.where(on, decision.executed, decision.proposed),
            proposed=decision.proposed,
            rules=np.where(self.enforced[:, None], decision.rules, -1),
            intervened=decision.intervened & self.enforced,
            margin=decision.margin,
            outside=decision.outside & self.enforced,
            invalid=decision.invalid,
        )


class Lessons:
    """What the rules said, in the states in which they spoke; the latest are kept."""

    def __init__(
        self, n_features: int, n_actions: int, n_labels: int = 0, most: int = _LESSONS
    ) -> None:
        """Begin with none.

        Args:
            n_features: Length d of an observation.
            n_actions: Action dimensions m.
            n_labels: Number L of discrete actions; 0 for continuous ones.
            most: How many are kept.
        """
        self.observations = np.zeros((most, n_features), dtype=np.float32)
        self.actions = np.zeros((most, n_actions), dtype=np.float32)
        self.taught = np.zeros((most, n_actions), dtype=np.bool_)
        self.allowed = np.zeros((most, n_labels), dtype=np.bool_)
        self.seen = 0

    def __len__(self) -> int:
        """How many are kept."""
        return min(self.seen, len(self.actions))

    def add(
        self,
        observations: NDArray[np.float32],
        actions: NDArray[np.float32],
        taught: NDArray[np.bool_],
        allowed: NDArray[np.bool_],
    ) -> None:
        """Remember k lessons.

        Args:
            observations: Shape (k, d).
            actions: What the rules would have executed, (k, m).
            taught: Which dimensions the rules speak of, (k, m).
            allowed: Which discrete actions they let pass, (k, L).
        """
        rows = (self.seen + np.arange(len(actions))) % len(self.actions)
        self.observations[rows] = observations
        self.actions[rows] = actions
        self.taught[rows] = taught
        self.allowed[rows] = allowed
        self.seen += len(actions)

    def state(self) -> dict[str, Any]:
        """What a checkpoint keeps of it."""
        count = len(self)
        return {
            "seen": self.seen,
            "observations": torch.from_numpy(self.observations[:count].copy()),
            "actions": torch.from_numpy(self.actions[:count].copy()),
            "taught": torch.from_numpy(self.taught[:count].copy()),
            "allowed": torch.from_numpy(self.allowed[:count].copy()),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take up where `state` was."""
        count = len(state["actions"])
        self.observations[:count] = state["observations"].numpy()
        self.actions[:count] = state["actions"].numpy()
        self.taught[:count] = state["taught"].numpy()
        self.allowed[:count] = state["allowed"].numpy()
        self.seen = int(state["seen"])


class ShieldedRolloutBuffer(RolloutBuffer):
    """Holds what was executed, and where the learner had no choice.

    Attributes:
        forced: Where a rule decided, so that the step says nothing about the learner's own
            choosing, (n_steps, n_envs) bool.
        allowed: What it could choose from, (n_steps, n_envs, actions) bool; of no actions where
            it did not look.
        lessons: What the rules said.
        policy: The learner's; to be set before the first step.
    """

    policy: ActorCriticPolicy

    def __init__(self, *args: Any, venv: HandoverVecEnv, memory: Memory, **kwargs: Any) -> None:
        """As `RolloutBuffer`.

        Args:
            args: Handed on.
            venv: Whose decisions are remembered.
            memory: ``executed`` or ``masked``.
            kwargs: Handed on.
        """
        super().__init__(*args, **kwargs)
        self.venv, self.memory = venv, memory
        self.discrete = isinstance(self.action_space, spaces.Discrete)
        self.forced = np.zeros((self.buffer_size, self.n_envs), dtype=np.bool_)
        labels = int(self.action_space.n) if isinstance(self.action_space, spaces.Discrete) else 0
        looked = labels if memory == "masked" and venv.shield.rule_set.forbids else 0
        self.allowed = np.ones((self.buffer_size, self.n_envs, looked), dtype=np.bool_)
        self.lessons = Lessons(int(np.prod(self.obs_shape)), self.action_dim, labels)

    def add(
        self,
        obs: np.ndarray[Any, Any],
        action: np.ndarray[Any, Any],
        reward: np.ndarray[Any, Any],
        episode_start: np.ndarray[Any, Any],
        value: torch.Tensor,
        log_prob: torch.Tensor,
    ) -> None:
        """Add the step that the environments have just made."""
        decision, advice = self.venv.decision, self.venv.advice
        executed, proposed, advised = (
            np.asarray(actions).reshape(self.n_envs, -1)
            for actions in (decision.executed, advice.proposed, advice.executed)
        )
        # A continuous action that was not replaced stays what was sampled, within the bounds or
        # not: the probability belongs to that.
        changed = decision.intervened
        action = np.where(changed[:, None], executed, action.reshape(self.n_envs, -1))
        if self.memory == "executed" and changed.any():
            log_prob = self._log_prob(obs, action)
        # A discrete action that the rule would have chosen too was no choice either; a continuous
        # one was, within its interval.
        taught = advice.rules >= 0 if self.discrete else proposed != advised
        spoken = taught.any(axis=1)
        self.forced[self.pos] = spoken & self.venv.enforced
        allowed = np.zeros((self.n_envs, self.lessons.allowed.shape[1]), dtype=np.bool_)
        if self.venv.choices is not None and self.venv.left is not None:
            allowed, self.allowed[self.pos] = self.venv.choices, self.venv.left
            self.forced[self.pos] = self.venv.left.sum(axis=1) == 1
        elif self.discrete:
            np.put_along_axis(allowed, advised.astype(np.int64), values=True, axis=1)
        self.lessons.add(
            obs.reshape(self.n_envs, -1)[spoken],
            advised[spoken].astype(np.float32),
            taught[spoken],
            allowed[spoken],
        )
        super().add(obs, action, reward, episode_start, value, log_prob)

    def _log_prob(self, obs: np.ndarray[Any, Any], action: np.ndarray[Any, Any]) -> torch.Tensor:
        with torch.no_grad():
            distribution = self.policy.get_distribution(torch.as_tensor(obs))
            actions = torch.as_tensor(action)
            return distribution.log_prob(actions[:, 0] if self.discrete else actions)
