"""What dividing continuous actions costs an expert, before any rule.

The paper leaves open whether finer intervals would help where its rules failed. Here the expert
itself acts, and every action is replaced as a shield would that asks for the expert's own interval
each time. What is lost then is lost to the intervals, and not to the rules.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.agents.spaces import Actions
from sarl_core.decimals import decimal_text
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError
from sarl_core.mining.quantisation import (
    SNAPPINGS,
    STUDIED_DIVIDERS,
    Quantisation,
    Snapping,
    quantise,
    snap,
)
from sarl_core.progress import Progress, report
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.rollouts.trial import make_agent


@dataclass(frozen=True, eq=False)
class SnappedAgent:
    """An agent whose continuous actions are snapped to what stands for their interval.

    Attributes:
        agent: Chooses the actions.
        divided: One entry an action dimension, all with the same divider.
        snapping: How.
    """

    agent: Agent
    divided: tuple[Quantisation, ...]
    snapping: Snapping

    @property
    def name(self) -> str:
        """The agent's name, and what is done to it."""
        return f"{self.agent.name}, {self.divided[0].divider} intervals, {self.snapping}"

    @property
    def n_uniforms(self) -> int:
        """As many as the agent needs."""
        return self.agent.n_uniforms

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        """See `Agent.act`."""
        chosen = np.asarray(self.agent.act(observations, uniforms), dtype=np.float32)
        columns = [
            snap(chosen[:, index], each.dimension, each.targets(self.snapping))
            for index, each in enumerate(self.divided)
        ]
        return np.stack(columns, axis=1)


@dataclass(frozen=True, eq=False)
class SnappedEpisodes:
    """Episodes of the snapped expert.

    Attributes:
        divider: Number of intervals of each action dimension.
        snapping: How its actions were snapped.
        episodes: E of them, without their steps.
    """

    divider: int
    snapping: Snapping
    episodes: Episodes


@dataclass(frozen=True, eq=False)
class DividerStudy:
    """What several dividers cost.

    Attributes:
        env_id: Environment.
        seed: Of the first episode.
        dividers: As asked for.
        quantisations: From the demonstrations alone: for each action dimension one a divider.
        unchanged: E episodes of the expert as it is.
        snapped: For each divider one entry a way to snap, in the order asked for. Snapped by
            ``clip``, an action stays as it is, whatever the divider: those are the unchanged
            episodes.
    """

    env_id: str
    seed: int
    dividers: tuple[int, ...]
    quantisations: tuple[tuple[Quantisation, ...], ...]
    unchanged: Episodes
    snapped: tuple[SnappedEpisodes, ...]

    def of(self, divider: int, snapping: Snapping) -> Episodes | None:
        """The episodes of one combination.

        Args:
            divider: Number of intervals.
            snapping: How actions are snapped.

        Returns:
            None if it was not studied.
        """
        return next(
            (
                each.episodes
                for each in self.snapped
                if (each.divider, each.snapping) == (divider, snapping)
            ),
            None,
        )


def study_divider(
    env_id: EnvironmentOrId,
    agent: str | Path | Agent,
    demonstrations: Demonstrations,
    *,
    dividers: Sequence[int] = STUDIED_DIVIDERS,
    projections: Sequence[Snapping] = SNAPPINGS,
    episodes: int = 100,
    seed: int = 0,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> DividerStudy:
    """Snap an expert's actions and see what it still achieves.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: The expert, as `make_agent` takes it.
        demonstrations: Of this environment; they give the intervals, and for ``expert`` the
            median value in each (its centre where there is none).
        dividers: Numbers of intervals.
        projections: Ways to snap.
        episodes: How many for each combination, E; all on the same seeds.
        seed: Of the first.
        jobs: Processes.
        executor: Whose processes they are; this machine's where not given.
        progress: Called with (episodes done, in all); returning False stops.

    Returns:
        The study. ``clip`` costs no episodes of its own.

    Raises:
        InputError: If actions are discrete, or demonstrations, agent and environment do not fit.
        CancelledError: If `progress` returned False.
    """
    expert = make_agent(agent, env_id, seed=seed)
    quantisations = quantise(demonstrations, dividers)
    variants = snapped_agents(env_id, expert, quantisations, projections)
    total = episodes * (1 + len(variants))
    done = 0

    def run(actor: Agent) -> Episodes:
        nonlocal done
        played = rollout(
            env_id,
            actor,
            episodes=episodes,
            seed=seed,
            jobs=jobs,
            executor=executor,
            keep_steps=False,
            progress=lambda now, _: report(progress, done + now, total),
        )
        done += episodes
        return played

    unchanged = run(expert)
    known = {(each.divided[0].divider, each.snapping): run(each) for each in variants}
    return DividerStudy(
        str(env_id),
        seed,
        tuple(dividers),
        quantisations,
        unchanged,
        tuple(
            SnappedEpisodes(divider, snapping, known.get((divider, snapping), unchanged))
            for divider in dividers
            for snapping in projections
        ),
    )


def snapped_agents(
    env_id: EnvironmentOrId,
    agent: Agent,
    quantisations: Sequence[Sequence[Quantisation]],
    projections: Sequence[Snapping] = SNAPPINGS,
) -> tuple[SnappedAgent, ...]:
    """The agents that `study_divider` runs beside the unchanged one.

    Args:
        env_id: Environment.
        agent: The expert.
        quantisations: As `quantise` gives them.
        projections: Ways to snap; ``clip`` changes nothing and is left out.

    Returns:
        One a divider and way to snap, the dividers one after the other.

    Raises:
        InputError: If the demonstrated actions are not those of the environment.
    """
    _check_actions(env_id, [divided[0] for divided in quantisations])
    by_divider = list(zip(*quantisations, strict=True))
    return tuple(
        SnappedAgent(agent, tuple(divided), snapping)
        for divided in by_divider
        for snapping in projections
        if snapping != "clip"
    )


def _check_actions(env_id: EnvironmentOrId, dimensions: Sequence[Quantisation]) -> None:
    description = describe_environment(env_id)
    if description.action_low is None or description.action_high is None:
        raise InputError(
            f"{env_id} takes discrete actions and the demonstrated ones are continuous; give "
            "demonstrations of this environment"
        )
    if len(dimensions) != len(description.action_low):
        raise InputError(
            f"the demonstrations have {len(dimensions)} action dimensions and {env_id} takes "
            f"{len(description.action_low)}; give demonstrations of this environment"
        )
    bounds = zip(dimensions, description.action_low, description.action_high, strict=True)
    for each, low, high in bounds:
        edges = each.dimension.edges
        if each.dimension.bounds_from == "action space" and (edges[0], edges[-1]) != (low, high):
            raise InputError(
                f"the demonstrated {each.dimension.name} goes from {decimal_text(edges[0])} to "
                f"{decimal_text(edges[-1])} and that of {env_id} from {decimal_text(low)} to "
                f"{decimal_text(high)}; give demonstrations of this environment"
            )
