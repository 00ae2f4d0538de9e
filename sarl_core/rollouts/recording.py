"""Recording demonstrations: an agent acts, and every step is written down."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from sarl_core.agents.agent import Agent
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId, as_environment
from sarl_core.errors import InputError, require_whole
from sarl_core.progress import Progress, report
from sarl_core.rollouts.failures import rate_text
from sarl_core.rollouts.player import EpisodeArrays, EpisodeFaultError, play
from sarl_core.rollouts.statistics import rate_of
from sarl_core.rollouts.steps import concatenate
from sarl_core.rollouts.trial import make_agent

SHIPPED = {
    "CartPole-v1": "cartpole",
    "LunarLander-v3": "lunar_lander",
    "LunarLanderContinuous-v3": "lunar_lander_continuous",
    "Pendulum-v1": "pendulum",
    "BipedalWalker-v3": "bipedal_walker",
}  # by trained policies; the driver of Driving-v0 is a script
SHIPPED_STEPS = 15_000  # the paper's amount

_BATCH = 16
_FEWEST = 2  # steps that demonstrations have


class RecordingFaultError(InputError):
    """The agent or the environment failed, or gave what is no number, while it was recorded.

    Attributes:
        recorded: The steps before it.
    """

    def __init__(self, message: str, recorded: Demonstrations) -> None:
        super().__init__(message)
        self.recorded = recorded


def record(
    env_id: EnvironmentOrId,
    agent: str | Path | Agent,
    *,
    steps: int,
    seed: int = 0,
    stochastic: bool = False,
    progress: Progress | None = None,
) -> Demonstrations:
    """Run an agent, episode after episode, and keep what it saw and did.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: An agent, or what `make_agent` takes.
        steps: How many; the last episode stops there, unfinished.
        seed: The episodes use seed, seed + 1, ...
        stochastic: Whether a trained policy is sampled, as the paper's were.
        progress: Called with (steps done, in all); returning False stops.

    Returns:
        Exactly `steps` state-action pairs, with the names, units and bounds of the
        environment. The first N steps do not depend on how many are asked for.

    Raises:
        InputError: If a number is out of range or the agent does not fit the environment.
        RecordingFaultError: If an agent of the caller's own, or the environment, fails after two
            steps or more, or an observation or a reward is no finite number.
        CancelledError: If `progress` returned False.
    """
    require_whole("steps", steps, 1)
    actor = make_agent(agent, env_id, stochastic=stochastic, seed=seed)
    outcomes: list[EpisodeArrays] = []
    episodes = done = 0
    report(progress, 0, steps)
    while done < steps:
        # Whole episodes side by side, as many as are likely to be needed.
        count = 1 if not episodes else min(_BATCH, 1 + (steps - done) * episodes // done)
        seeds = np.arange(seed + episodes, seed + episodes + count, dtype=np.int64)
        # One step more than is kept, so that this limit never shows in the recording.
        try:
            outcomes.append(
                play(env_id, actor, None, seeds, batch=count, max_steps=steps + 1, keep_steps=True)
            )
        except EpisodeFaultError as error:
            outcomes += [] if error.played is None else [error.played]
            if (done := sum(int(outcome.lengths.sum()) for outcome in outcomes)) < _FEWEST:
                raise
            _require_numbers(env_id, actor.name, seed, outcomes, min(done, steps))
            part = _demonstrations(env_id, actor.name, seed, outcomes, min(done, steps))
            raise RecordingFaultError(str(error), part) from error
        episodes += count
        done += int(outcomes[-1].lengths.sum())
        _require_numbers(env_id, actor.name, seed, outcomes, min(done, steps))
        report(progress, min(done, steps), steps)
    return _demonstrations(env_id, actor.name, seed, outcomes, steps)


def _require_numbers(
    env_id: EnvironmentOrId, agent: str, seed: int, outcomes: list[EpisodeArrays], steps: int
) -> None:
    """Stop at the first of some steps that no demonstrations can hold, and keep those before it."""
    table = outcomes[-1].steps
    if table is None:
        return
    before = sum(int(outcome.lengths.sum()) for outcome in outcomes[:-1])
    values = np.column_stack([table.observation, table.reward])[: steps - before]
    rows, columns = np.nonzero(~np.isfinite(values))
    if not len(rows):
        return
    row, column = int(rows[0]), int(columns[0])
    names = describe_environment(env_id).feature_names
    fault = "not a number (NaN)" if np.isnan(values[row, column]) else "infinite"
    what = f"a reward that is {fault}"
    if column < len(names):
        # The player makes what is no observation of the space a row of NaN.
        whole = len(names) > 1 and np.isnan(values[row, :-1]).all()
        what = (
            "what is no observation of its space"
            if whole
            else f"an observation {names[column]!r} that is {fault}"
        )
    played = sum(len(outcome.lengths) for outcome in outcomes[:-1]) + int(table.episode[row])
    sentence = (
        f"{env_id} gives {what} at step {table.step[row]} of the episode with seed "
        f"{seed + played}; mend it, or put a wrapper around it that does"
    )
    if before + row < _FEWEST:
        raise InputError(sentence)
    raise RecordingFaultError(
        sentence, _demonstrations(env_id, agent, seed, outcomes, before + row)
    )


def _demonstrations(
    env_id: EnvironmentOrId, agent: str, seed: int, outcomes: list[EpisodeArrays], steps: int
) -> Demonstrations:
    description = describe_environment(env_id)

    table = concatenate([outcome.steps for outcome in outcomes if outcome.steps is not None])
    table = table.take(slice(steps))
    lengths = np.concatenate([outcome.lengths for outcome in outcomes])
    ends = np.cumsum(lengths) - 1
    terminated, truncated = np.zeros((2, int(lengths.sum())), dtype=np.bool_)
    terminated[ends] = np.concatenate([outcome.terminated for outcome in outcomes])
    truncated[ends] = np.concatenate([outcome.truncated for outcome in outcomes])
    episodes = np.repeat(np.arange(len(lengths)), lengths)[:steps]
    notes: tuple[str, ...] = ()
    if as_environment(env_id).failure:  # who says what a failure is wants to know of them
        failed = np.bincount(episodes, weights=table.failed) > 0
        ended = np.bincount(episodes, weights=(terminated | truncated)[:steps]) > 0
        notes = (f"failures while recording: {rate_text(rate_of(failed, ~failed & ~ended))}",)
    return Demonstrations(
        observations=table.observation,
        actions=table.executed[:, 0] if description.action_shape == () else table.executed,
        episodes=episodes,
        rewards=table.reward,
        terminated=terminated[:steps],
        truncated=truncated[:steps],
        steps=table.step,
        feature_names=description.feature_names,
        feature_units=description.feature_units,
        action_names=description.action_names,
        label_names=description.label_names,
        label_first=description.label_first,
        env_id=str(env_id),
        agent=agent,
        seed=seed,
        notes=notes,
        **_bounds(env_id),
    )


def _bounds(env_id: EnvironmentOrId) -> dict[str, Any]:
    """Bounds of the action space; none where a side is open, so that the data's are taken."""
    description = describe_environment(env_id)
    low, high = description.action_low, description.action_high
    if low is None or high is None or not np.isfinite([*low, *high]).all():
        return {}
    return {"action_low": low, "action_high": high, "bounds_from": "action space"}
