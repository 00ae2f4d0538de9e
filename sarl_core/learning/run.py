"""Learning under a shield: one learner, one seed, every episode on the record."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sarl_core.agents.agent import Agent, PolicyAgent
from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.environments.environment import EnvironmentOrId, as_environment
from sarl_core.errors import InputError, WorkError
from sarl_core.learning.arms import LearningArm, check_learning
from sarl_core.learning.checkpoints import Rest, load_checkpoint, save_checkpoint
from sarl_core.learning.curves import NO_EPISODES, LearningEpisodes, Trial
from sarl_core.learning.experts import export_policy
from sarl_core.learning.recipes import make_learner
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_core.progress import CancelledError, Progress
from sarl_core.rollouts import seeds
from sarl_core.rollouts.episodes import rollout
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield

TRIAL_EPISODES = 50


class DivergedError(WorkError):
    """The weights of a learner are no numbers any more."""


Watch = Callable[[LearningEpisodes, int], None]
"""Called now and then with the curve so far and the environment steps made."""


@dataclass(frozen=True, eq=False)
class LearningResult:
    """A learner that has learned.

    Attributes:
        env_id: Environment.
        arm: The way it learned.
        steps: Environment steps.
        seed: Of the learner.
        curve: What happened meanwhile.
        policy: What it learned: the network alone, whatever shielded it.
        alone: Episodes after learning, without a shield.
        shielded: Likewise with the shield on; None without rules.
        seconds: Learning and trials took, over all sittings.
        sittings: In how many goes it learned.
    """

    env_id: str
    arm: LearningArm
    steps: int
    seed: int
    curve: LearningEpisodes
    policy: MlpPolicy
    alone: Trial
    shielded: Trial | None
    seconds: float
    sittings: int


def learn(
    env_id: EnvironmentOrId,
    rules: RuleSet | None,
    arm: LearningArm,
    *,
    steps: int,
    seed: int = 0,
    projection: Projection = "centre",
    episodes: int = TRIAL_EPISODES,
    max_steps: int | None = None,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
    watch: Watch | None = None,
) -> LearningResult:
    """Let a learner learn, and try what it learned.

    Args:
        env_id: What ``gymnasium.make`` takes.
        rules: Of the shield, in force while learning if the arm says so, and in the trials
            after it; None for none.
        arm: The way to learn.
        steps: Environment steps; a learner with several environments side by side may make a
            few more.
        seed: Of the learner and its environments. The same arguments give the same result.
        projection: What becomes of a continuous action that breaks a rule.
        episodes: After learning, without a shield and with it, on seeds from `seeds.TRIAL`.
        max_steps: An episode after learning that has not ended by then is cut off;
            `episodes.MAX_STEPS` where not given.
        checkpoint: File to take up the learning from, if it exists, and to keep it in meanwhile
            and when it is cancelled. A resumed run begins new episodes and draws new random
            numbers: it is not bit for bit what an uninterrupted one would have been.
        progress: Called with (steps done, `steps`); returning False stops.
        watch: See `Watch`.

    Returns:
        The result.

    Raises:
        InputError: If a number is out of range, or arm, rules and environment do not fit, or the
            checkpoint is of another run.
        CancelledError: If `progress` returned False; the checkpoint has what was learned.
        WorkError: If the learner diverged, the environment failed in the middle (the checkpoint
            has what was learned), or the checkpoint cannot be written.
    """
    check_learning(env_id, rules, arm, steps=steps, seed=seed)
    if episodes < 1:
        raise InputError(f"episodes is {episodes} and must be at least 1; give a larger number")
    began = time.monotonic()
    shield = None if rules is None else Shield(rules, projection=projection)
    identity = {
        "env_id": as_environment(env_id).key,
        "arm": arm.name,
        "steps": steps,
        "seed": seed,
        "rules": rules_digest(rules) if arm.shielded and rules is not None else "",
        "projection": projection if arm.shielded else "",
    }
    learner, env = make_learner(
        env_id, shield if arm.shielded else None, arm, steps=steps, seed=seed
    )
    rest = Rest(NO_EPISODES, 0.0, 0)
    if checkpoint is not None:
        rest = load_checkpoint(checkpoint, learner, identity) or rest
    if rest.sittings:
        fresh = np.random.SeedSequence((seed, learner.num_timesteps)).generate_state(1)
        learner.set_random_seed(int(fresh[0] % 2**31))

    def so_far(curve: LearningEpisodes) -> Rest:
        return Rest(curve, rest.seconds + time.monotonic() - began, rest.sittings + 1)

    def keep(curve: LearningEpisodes) -> None:
        if checkpoint is not None:
            save_checkpoint(checkpoint, learner, identity, so_far(curve))

    def tell(curve: LearningEpisodes, done: int) -> bool:
        if watch is not None:
            watch(curve, done)
        return progress is None or progress(min(done, steps), steps) is not False

    try:
        curve = _learn(learner, env, env_id, arm, steps, seed, rest.curve, tell, keep)
        policy = _exported(learner, str(env_id), arm)
    finally:
        env.close()

    def still(done: int, total: int) -> bool:
        return progress is None or progress(steps, steps) is not False

    learned = PolicyAgent("learner", policy, False, np.zeros(policy.n_dimensions, dtype=np.int64))

    def tried(shield: Shield | None) -> Trial:
        return try_agent(
            env_id, learned, shield, episodes=episodes, max_steps=max_steps, progress=still
        )

    alone, shielded = tried(None), None if shield is None else tried(shield)
    end = so_far(curve)
    return LearningResult(
        str(env_id), arm, steps, seed, curve, policy, alone, shielded, end.seconds, end.sittings
    )


def _learn(
    learner: Any,
    env: Any,
    env_id: EnvironmentOrId,
    arm: LearningArm,
    steps: int,
    seed: int,
    before: LearningEpisodes,
    tell: Callable[[LearningEpisodes, int], bool],
    keep: Callable[[LearningEpisodes], None],
) -> LearningEpisodes:
    """Learn until the steps are made; keep what was learned, then and when stopped.

    Raises:
        CancelledError: If `tell` said so.
        WorkError: If the environment failed.
    """
    from sarl_core.learning.faults import EnvironmentFaultError
    from sarl_core.learning.recorder import Recorder

    begun = learner.num_timesteps
    recorder = Recorder(
        env_id, arm, env, before, steps=steps, seed=seed + begun, tell=tell, keep=keep
    )
    go_on = tell(before, begun)
    if go_on and begun < steps:
        try:
            learner.learn(steps - begun, callback=recorder, reset_num_timesteps=False)
        except EnvironmentFaultError as error:
            keep(recorder.curve())
            tell(recorder.curve(), learner.num_timesteps)
            raise WorkError(error.sentence(str(env_id), len(recorder.curve()))) from error
        except ValueError as error:  # torch's word for probabilities that are no numbers
            raise _diverged(learner, error) from error
    keep(recorder.curve())
    if not go_on or recorder.stopped or not tell(recorder.curve(), learner.num_timesteps):
        raise CancelledError(f"stopped after {learner.num_timesteps:,} of {steps:,} steps")
    return recorder.curve()


def _exported(learner: Any, env_id: str, arm: LearningArm) -> MlpPolicy:
    """The network alone; its samples are as decided as they were while it learned."""
    try:
        policy = export_policy(learner, env_id=env_id)
        if arm.sharpness == 1.0 or not policy.is_discrete:
            return policy
        sharp = np.float32(arm.sharpness)
        return replace(
            policy,
            weights=(*policy.weights[:-1], policy.weights[-1] * sharp),
            biases=(*policy.biases[:-1], policy.biases[-1] * sharp),
        )
    except InputError as error:
        raise _diverged(learner, error) from error


def _diverged(learner: Any, error: Exception) -> Exception:
    """What to say of a learner whose weights are no numbers any more; else the error itself."""
    if all(bool(value.isfinite().all()) for value in learner.policy.state_dict().values()):
        return error
    return DivergedError(
        f"the learner has diverged after {learner.num_timesteps:,} steps, its weights are no "
        "numbers any more; try another seed"
    )


def try_agent(
    env_id: EnvironmentOrId,
    agent: Agent,
    shield: Shield | None,
    *,
    episodes: int,
    max_steps: int | None = None,
    progress: Progress | None = None,
) -> Trial:
    """Play the episodes by which learners are judged.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: Who acts.
        shield: In force, or None.
        episodes: How many, on seeds from `seeds.TRIAL`.
        max_steps: After which one that has not ended is cut off; `episodes.MAX_STEPS` where None.
        progress: Called with (episodes done, `episodes`); returning False stops.

    Returns:
        What came of them.

    Raises:
        CancelledError: If `progress` returned False.
    """
    played = rollout(
        env_id,
        agent,
        shield=shield,
        episodes=episodes,
        seed=seeds.TRIAL,
        keep_steps=False,
        max_steps=max_steps,
        progress=progress,
    )
    steps = float(played.lengths.sum())
    return Trial(
        returns=tuple(played.returns.tolist()),
        crashes=int(played.failed.sum()),
        intervention_rate=float(played.interventions.sum()) / steps,
        coverage=float(played.covered.sum()) / steps,
        cut=int((played.cut & ~played.failed).sum()),
        failed=tuple(played.failed.tolist()) if played.failures_known else (),
        costs=() if np.isnan(played.costs).any() else tuple(played.costs.tolist()),
        freedom=None if shield is None else float((played.freedom * played.lengths).sum()) / steps,
    )
