"""Learners of Stable-Baselines3 that know what a shield made of their actions.

Loads torch and Stable-Baselines3: imported only where something is learned.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, cast

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.distributions import (
    CategoricalDistribution,
    DiagGaussianDistribution,
    Distribution,
)
from stable_baselines3.common.policies import ActorCriticPolicy
from torch.nn import functional

from sarl_core.learning.replay_buffers import HandoverVecEnv, Lessons, ShieldedRolloutBuffer

_NEVER = -1e8
"""Score of an action that is not allowed: its probability is 0, its entropy and gradient too."""


class DecidedPolicy(ActorCriticPolicy):
    """Acts more decidedly than it is taught, and samples only what is allowed.

    Rules give one action where the expert wavered between two, so who is taught by them wavers
    too, and acting on each doubt at random fails. With sharpness k the network's outputs count
    k times when it acts, and once when it is taught; its best action is the same.

    Attributes:
        sharpness: How many times; of discrete actions only.
        venv: Whose shield says what may be sampled; to be set before the first step.
        allowed: Which discrete actions it chooses from in the states that it is asked about next,
            (B, actions); None for all.
    """

    venv: HandoverVecEnv

    def __init__(self, *args: Any, sharpness: float = 1.0, **kwargs: Any) -> None:
        """As `ActorCriticPolicy`.

        Args:
            args: Handed on.
            sharpness: See there.
            kwargs: Handed on.
        """
        self.sharpness = sharpness
        self.allowed: torch.Tensor | None = None
        super().__init__(*args, **kwargs)

    def forward(
        self, obs: torch.Tensor, deterministic: bool = False
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Choose the actions of a step.

        Args:
            obs: What the environments have just shown, (n_envs, d).
            deterministic: Whether to take the best.

        Returns:
            Actions, values and log-probabilities.
        """
        choices = self.venv.look()
        with self.choosing_from(None if choices is None else torch.from_numpy(choices)):
            return super().forward(obs, deterministic)

    @contextmanager
    def choosing_from(self, allowed: torch.Tensor | None) -> Iterator[None]:
        """Leave the network these actions meanwhile.

        Args:
            allowed: As the attribute.
        """
        self.allowed = allowed
        try:
            yield
        finally:
            self.allowed = None

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> Distribution:
        if not isinstance(self.action_dist, CategoricalDistribution):
            return super()._get_action_dist_from_latent(latent_pi)
        scores = self.sharpness * self.action_net(latent_pi)
        if self.allowed is not None:
            scores = scores.masked_fill(~self.allowed, _NEVER)
        return self.action_dist.proba_distribution(scores)

    def taught(self, observations: torch.Tensor) -> Distribution:
        """What it has been taught.

        Args:
            observations: Shape (B, d).

        Returns:
            The distribution of its actions, sharpness left out.
        """
        sharpness, self.sharpness = self.sharpness, 1.0
        try:
            return self.get_distribution(observations)
        finally:
            self.sharpness = sharpness


class Batch(NamedTuple):
    """A rollout as tensors, R = n_steps * n_envs rows."""

    observations: torch.Tensor
    actions: torch.Tensor
    old_log_prob: torch.Tensor
    advantages: torch.Tensor
    returns: torch.Tensor
    free: torch.Tensor
    allowed: torch.Tensor


class MaskedPPO(PPO):
    """PPO whose policy's gradient is that of choosing from what the rules left.

    A rule that demands prescribes one action. Masking the others leaves one to sample, with
    probability 1 whatever the network says, so the step has no gradient and no entropy: exactly
    what leaving it out does. Rules that forbid leave several, and the probabilities of those are
    made to add up to 1. The network can be taught the rules as well, by `imitation`.

    Attributes:
        imitation: Weight of the loss that draws the network towards the rules.
    """

    imitation = 0.0

    def train(self) -> None:
        """Update the network with the rollout that was collected last."""
        buffer = cast(ShieldedRolloutBuffer, self.rollout_buffer)
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        clip = float(cast(Any, self.clip_range)(self._current_progress_remaining))
        batch = _batch(buffer)
        for _ in range(self.n_epochs):
            for rows in torch.split(torch.randperm(len(batch.free)), self.batch_size):
                loss = self._loss(Batch(*(column[rows] for column in batch)), clip)
                if self.imitation and len(buffer.lessons):
                    loss = loss + self.imitation * self._unlike_rules(buffer.lessons)
                self.policy.optimizer.zero_grad()
                loss.backward()  # type: ignore[no-untyped-call]
                torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.max_grad_norm)
                self.policy.optimizer.step()

    def _loss(self, batch: Batch, clip: float) -> torch.Tensor:
        """PPO's loss, of which forced rows only have the part of the values."""
        policy = cast(DecidedPolicy, self.policy)
        with policy.choosing_from(batch.allowed if batch.allowed.shape[1] else None):
            values, log_prob, entropy = policy.evaluate_actions(batch.observations, batch.actions)
        advantages = batch.advantages
        if len(advantages) > 1:
            advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
        # Of forced rows the log-probability is that of no choice of the network.
        ratio = torch.exp(torch.where(batch.free, log_prob - batch.old_log_prob, 0.0))
        gain = torch.min(advantages * ratio, advantages * ratio.clamp(1 - clip, 1 + clip))
        assert entropy is not None
        return (
            -gain.mean()
            - self.ent_coef * torch.where(batch.free, entropy, 0.0).mean()
            + self.vf_coef * functional.mse_loss(batch.returns, values.flatten())
        )

    def _unlike_rules(self, lessons: Lessons) -> torch.Tensor:
        """How far the network is from what the rules said, in some of the states they spoke in."""
        rows = torch.randint(len(lessons), (self.batch_size,)).numpy()
        actions = torch.from_numpy(lessons.actions[rows])
        taught = torch.from_numpy(lessons.taught[rows])
        policy = cast(DecidedPolicy, self.policy)
        distribution = policy.taught(torch.from_numpy(lessons.observations[rows]))
        if isinstance(distribution, CategoricalDistribution):
            allowed = torch.from_numpy(lessons.allowed[rows])
            scores = distribution.distribution.logits
            return -scores.masked_fill(~allowed, -torch.inf).logsumexp(dim=1).mean()
        assert isinstance(distribution, DiagGaussianDistribution)
        normal = distribution.distribution
        # Only the mean learns from this: drawing the deviation in would end all exploring.
        distance = (actions - normal.mean) / normal.stddev.detach()
        return 0.5 * (torch.where(taught, distance, 0.0) ** 2).sum(dim=1).mean()


def _batch(buffer: ShieldedRolloutBuffer) -> Batch:
    def rows(values: NDArray[Any]) -> torch.Tensor:
        steps, envs, *rest = values.shape  # of which the rest may be none
        return torch.from_numpy(values.reshape(steps * envs, *rest))

    actions = rows(buffer.actions)
    return Batch(
        observations=rows(buffer.observations),
        actions=actions[:, 0].long() if buffer.discrete else actions,
        old_log_prob=rows(buffer.log_probs),
        advantages=rows(buffer.advantages),
        returns=rows(buffer.returns),
        free=~rows(buffer.forced),
        allowed=rows(buffer.allowed),
    )


class _RemembersExecuted:
    """For off-policy learners: the replay buffer holds the action that was executed."""

    def _store_transition(
        self,
        replay_buffer: ReplayBuffer,
        buffer_action: np.ndarray[Any, Any],
        new_obs: Any,
        reward: np.ndarray[Any, Any],
        dones: np.ndarray[Any, Any],
        infos: list[dict[str, Any]],
    ) -> None:
        buffer_action = buffer_action.copy()
        for i, info in enumerate(infos):
            record = info.get("shield")
            if record is not None and record.intervened:
                executed = np.asarray(record.executed)
                continuous = isinstance(cast(Any, self).action_space, spaces.Box)
                buffer_action[i] = (
                    cast(Any, self).policy.scale_action(executed) if continuous else executed
                )
        cast(Any, super())._store_transition(
            replay_buffer, buffer_action, new_obs, reward, dones, infos
        )


class ExecutedDQN(_RemembersExecuted, DQN):
    """DQN whose replay buffer holds the executed action."""


class ExecutedSAC(_RemembersExecuted, SAC):
    """SAC whose replay buffer holds the executed action."""
