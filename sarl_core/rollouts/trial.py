"""Agents made by name or from a file, with a trial in their environment where that tells more."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent, PolicyAgent, untried_agent
from sarl_core.agents.mlp_policy import Normalisation
from sarl_core.agents.sb3_normalisation import AS_THEY_ARE, TrainingEnd
from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.rollouts.player import EpisodeFaultError, View, play
from sarl_core.rollouts.seeds import require_seed

_EPISODES, _STEPS = 4, 50  # of a trial

_FAR = 8.0  # standard deviations
_ODD_SHARE = 0.1  # of the states; features that hardly vary in training may jump now and then

_LONGEST = 4.0  # a step in training, in the longest of some random ones
_SPREAD = 4.0  # of most normalised values, from one side to the other
_BY_CHANCE = 0.02


def make_agent(
    spec: str | Path | Agent,
    env_id: EnvironmentOrId,
    *,
    stochastic: bool = False,
    seed: int = 0,
    normalise: str | Path | None = None,
) -> Agent:
    """Make the agent that a name or a file stands for.

    Args:
        spec: ``novice`` (uniform random actions), ``untrained`` (fresh PPO weights, sampled),
            ``expert`` (the shipped one of this environment), the path of an `.npz` policy or
            of a Stable-Baselines3 `.zip` with an `MlpPolicy`; an agent is given back as it is.
        env_id: What ``gymnasium.make`` takes.
        stochastic: Whether a trained policy is sampled.
        seed: Of the untrained weights, and of what the agent is to play; the same seed gives the
            same weights.
        normalise: Of a `.zip` that was trained under `VecNormalize`: the `.pkl` with its
            statistics, or ``none`` where its observations were not normalised. Found beside
            the `.zip` where not given and the name leaves no doubt.

    Returns:
        The agent.

    Raises:
        InputError: If the seed is none, there is no such agent, or it does not fit the environment.
        WorkError: If a package that it needs is not installed.
    """
    require_seed(seed)
    agent = untried_agent(spec, env_id, stochastic=stochastic, seed=seed, normalise=normalise)
    if agent is spec or not isinstance(agent, PolicyAgent):
        return agent
    notes = agent.notes
    if agent.doubt is not None:
        notes += _undecided(agent.doubt, env_id)
    if agent.policy.normalisation is not None and spec != "expert":  # whose environment is known
        notes += _unlike(agent, agent.policy.normalisation, env_id)
    return replace(agent, notes=notes, doubt=None)


def _undecided(doubt: TrainingEnd, env_id: EnvironmentOrId) -> tuple[str, ...]:
    """Say so where a model's observations may have been normalised for all that one can see."""
    likely = _is_a_step(doubt, env_id)
    if likely:
        return ()
    what = (
        " does not tell whether its observations were normalised"
        if likely is None
        else ": what it saw last in its training is no step of this one"
    )
    return (
        f"{doubt.path}{what}; if it was trained under a VecNormalize, it acts wrongly here: give "
        f"the .pkl that VecNormalize.save() wrote (--normalise FILE; {AS_THEY_ARE} if it was not)",
    )


def _is_a_step(doubt: TrainingEnd, env_id: EnvironmentOrId) -> bool | None:
    """Whether a model's last observation but one and its last are a step of an environment.

    A step is not much longer than the longest of some random ones, in each feature, or leads to
    where episodes start. None where normalised values would often pass for one.
    """
    last, before = doubt.last, doubt.before
    if last is None or before is None or last.shape != before.shape or last.ndim != 2:
        return None
    if last.shape[1] != len(describe_environment(env_id).feature_names):
        return None
    episodes = _trial(untried_agent("novice", env_id), env_id)
    steps = [np.diff(states.astype(np.float64), axis=0) for states in episodes]
    if not any(len(one) for one in steps):
        return None
    starts = np.array([states[0] for states in episodes], dtype=np.float64)
    reach = _LONGEST * np.abs(np.concatenate(steps)).max(axis=0) + 1e-3
    low, high = np.min(starts, axis=0), np.max(starts, axis=0)
    width = high - low + 1e-3
    starting = ((last >= low - width) & (last <= high + width)).all(axis=1)
    stepping = (np.abs(last - before) <= reach).all(axis=1)
    if not (starting | stepping).all():
        return False
    by_chance = np.where(
        stepping,
        np.minimum(1.0, 2.0 * reach / _SPREAD).prod(),
        np.minimum(1.0, 3.0 * width / _SPREAD).prod(),
    )
    return True if by_chance.prod() <= _BY_CHANCE else None


def _unlike(
    agent: PolicyAgent, normalisation: Normalisation, env_id: EnvironmentOrId
) -> tuple[str, ...]:
    """Say so where the first states that a policy meets are unlike those of its statistics."""
    episodes = _trial(agent, env_id)
    if not episodes:
        return ()
    states = np.concatenate(episodes)
    far = np.abs(normalisation.deviations(states)) > _FAR
    share = float(far.any(axis=1).mean())
    if not share > _ODD_SHARE:
        return ()
    i = int(far.mean(axis=0).argmax())
    names = describe_environment(env_id).feature_names
    return (
        f"the policy {agent.name} meets states in {env_id} unlike those that it was trained on: "
        f"{share:.0%} of its first {len(states)} lie more than {_FAR:g} standard deviations from "
        f"the mean of its training (most often in {names[i]}); check that its statistics and "
        "this environment belong to it",
    )


def _trial(agent: Agent, env_id: EnvironmentOrId) -> list[NDArray[np.float32]]:
    """The states that an agent meets from the start of a few episodes, shape (steps + 1, d) each.

    Fewer where the environment fails: whoever plays there is told so.
    """
    episodes: list[list[NDArray[np.float32]]] = []

    def look(view: View) -> None:
        if view.step == 0:
            episodes.append([])
        episodes[-1].append(view.state)

    with suppress(EpisodeFaultError):
        play(
            env_id,
            agent,
            None,
            np.arange(_EPISODES, dtype=np.int64),
            batch=1,
            max_steps=_STEPS,
            keep_steps=False,
            observer=look,
        )
    return [np.array(states) for states in episodes]
