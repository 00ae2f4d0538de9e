"""Keeping the record of a learner at work: every episode, progress, and when to stop.

Loads Stable-Baselines3: imported only where something is learned.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback

from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.environments.signals import SignalTally, StepOutcomes
from sarl_core.learning.arms import Handover, LearningArm
from sarl_core.learning.curves import Columns, LearningEpisodes
from sarl_core.learning.learners import MaskedPPO
from sarl_core.learning.replay_buffers import HandoverVecEnv

_REPORTED_EVERY = 0.3  # seconds
_SAVED_EVERY = 20.0  # seconds; what a power cut may cost


class Recorder(BaseCallback):
    """Takes note of every episode, and stops the learner when it is told to.

    Attributes:
        stopped: Whether the learner was stopped before its end.
    """

    def __init__(
        self,
        env_id: EnvironmentOrId,
        arm: LearningArm,
        env: Any,
        before: LearningEpisodes,
        *,
        steps: int,
        seed: int,
        tell: Callable[[LearningEpisodes, int], bool],
        keep: Callable[[LearningEpisodes], None],
    ) -> None:
        """Begin, or go on after an earlier sitting.

        Args:
            env_id: Environment.
            arm: The way it learns.
            env: The learner's environments.
            before: Episodes of earlier sittings.
            steps: Environment steps after which the learner ends.
            seed: Of which episodes are left to the learner.
            tell: Called now and then with the curve so far and the steps made; returns whether
                to go on.
            keep: Called more rarely, with the curve so far, to save what was learned.
        """
        super().__init__()
        self.arm, self.env = arm, env
        self.steps = steps
        self.tell, self.keep = tell, keep
        self.stopped = False
        self.columns: dict[str, list[Any]] = before.to_dict()
        self.handover = Handover()
        for shielded, crashed in zip(before.shielded, before.crashed, strict=True):
            self.handover.ended(shielded=bool(shielded), crashed=bool(crashed))
        self.generator = np.random.default_rng(seed)
        count = env.num_envs
        self.tally = SignalTally(
            env_id, count, lambda place: f"of episode {len(self.columns['ends'])} while learning"
        )
        self.returns, self.lengths, self.interventions, self.covered = np.zeros((4, count))
        self.reported = self.saved = time.monotonic()
        self._share(np.arange(count))

    def curve(self) -> LearningEpisodes:
        """The episodes that have ended."""
        return Columns(**self.columns).read()

    def _on_step(self) -> bool:
        dones: NDArray[np.bool_] = self.locals["dones"]
        infos = self.locals["infos"]
        rewards = np.array(self.locals["rewards"], dtype=np.float64)  # as the learner sees them
        if self.arm.shielded:
            decision = self.env.decision
            self.interventions += decision.intervened
            self.covered += (decision.rules >= 0).any(axis=1)
            rewards += self.arm.penalty * decision.intervened
        self._take_in(dones, rewards, infos)
        self.returns += rewards
        self.lengths += 1
        if dones.any():
            self._note(np.flatnonzero(dones))
        now = time.monotonic()
        if now - self.saved > _SAVED_EVERY:
            self.keep(self.curve())
            self.saved = time.monotonic()
        if now - self.reported > _REPORTED_EVERY:
            self.reported = now
            self.stopped = not self.tell(self.curve(), self.num_timesteps)
        return not self.stopped and (self.num_timesteps < self.steps or self._fills_rollout())

    def _fills_rollout(self) -> bool:
        """Whether the steps that an on-policy learner will now learn from are complete."""
        buffer = getattr(self.model, "rollout_buffer", None)
        return buffer is not None and buffer.pos == buffer.buffer_size - 1

    def _take_in(self, dones: NDArray[np.bool_], rewards: NDArray[np.float64], infos: Any) -> None:
        """See what the step says of failure."""
        observations = np.array(self.locals["new_obs"], dtype=np.float32)
        terminated = dones.astype(np.bool_)  # a copy
        for place in np.flatnonzero(dones).tolist():
            # What is new there is the first observation of the next episode.
            observations[place] = infos[place]["terminal_observation"]
            terminated[place] = not infos[place].get("TimeLimit.truncated", False)
        actions = self.locals.get("clipped_actions", self.locals["actions"])
        if self.arm.shielded:
            actions = self.env.decision.executed
        places = np.arange(len(dones))
        steps = self.lengths.astype(np.int64)
        self.tally.add(
            places, steps, StepOutcomes(observations, list(actions), rewards, terminated, infos)
        )

    def _note(self, ended: NDArray[np.int64]) -> None:
        for place in ended.tolist():
            self.tally.end(place)
        crashed = self.tally.failures[ended] == 1.0
        shielded = self._enforced()[ended]
        row = {
            "ends": np.full(len(ended), self.num_timesteps),
            "returns": self.returns[ended],
            "lengths": self.lengths[ended].astype(np.int64),
            "crashed": crashed,
            "interventions": self.interventions[ended].astype(np.int64),
            "covered": self.covered[ended].astype(np.int64),
            "shielded": shielded,
        }
        for name, values in row.items():
            self.columns[name] += values.tolist()
        for values in (self.returns, self.lengths, self.interventions, self.covered):
            values[ended] = 0
        for place in ended.tolist():
            self.tally.restart(place)
        for was_shielded, has_crashed in zip(shielded.tolist(), crashed.tolist(), strict=True):
            self.handover.ended(shielded=was_shielded, crashed=has_crashed)
        self._share(ended)

    def _enforced(self) -> NDArray[np.bool_]:
        if isinstance(self.env, HandoverVecEnv):
            return self.env.enforced
        return np.zeros(self.env.num_envs, dtype=np.bool_)

    def _share(self, beginning: NDArray[np.int64]) -> None:
        """Decide of the episodes that begin who acts in them."""
        if not self.arm.handover:
            return
        share = self.handover.share
        self.env.enforced[beginning] = self.generator.random(len(beginning)) >= share

    def _on_rollout_start(self) -> None:
        if self.arm.handover and isinstance(self.model, MaskedPPO):
            # What it is trusted with, it need not copy any more.
            self.model.imitation = self.arm.imitation * (1 - self.handover.share)
