"""Agents compared, each with a shield and without, on the same seeds (the paper's Fig. 5 to 7)."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sarl_core.agents.agent import Agent
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError
from sarl_core.progress import Progress, part_of
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Outside, Shield
from sarl_core.studies.shield_effect import shield_effect

if TYPE_CHECKING:
    import pandas as pd

    from sarl_core.mining.rule_set import RuleSet


@dataclass(frozen=True)
class Arm:
    """One way to act that is compared with others.

    Attributes:
        name: What it is called on screen; unique within a comparison.
        agent: What `make_agent` takes: a name, a path, or an agent.
        rules: In force as a shield, None for no shield.
        projection: How the shield replaces a continuous action.
        stochastic: Whether a trained policy is sampled.
        outside: Whether rules act in states outside the data they were mined from.
    """

    name: str
    agent: str | Path | Agent
    rules: RuleSet | None = None
    projection: Projection = "centre"
    stochastic: bool = False
    outside: Outside = "act"


@dataclass(frozen=True)
class Comparison:
    """A arms on the same seeds.

    Attributes:
        env_id: Environment.
        seed: Of the first episode.
        arms: What was compared.
        episodes: E episodes of each arm, in the arms' order; their steps are not kept.
    """

    env_id: str
    seed: int
    arms: tuple[Arm, ...]
    episodes: tuple[Episodes, ...]

    def to_frame(self) -> pd.DataFrame:
        """One row an arm, as `comparison_row` gives it."""
        import pandas as pd

        return pd.DataFrame(
            [
                comparison_row(arm, episodes, self.alone(place))
                for place, (arm, episodes) in enumerate(zip(self.arms, self.episodes, strict=True))
            ]
        )

    def alone(self, place: int) -> Episodes | None:
        """The same agent's episodes without a shield.

        Args:
            place: Of a shielded arm.

        Returns:
            As many on the same seeds; None where they were not run, or the arm has no shield.
        """
        arm, own = self.arms[place], self.episodes[place]
        if arm.rules is None:
            return None
        for other, episodes in zip(self.arms, self.episodes, strict=True):
            same = other.agent is arm.agent or (
                isinstance(other.agent, (str, Path)) and other.agent == arm.agent
            )
            if (
                same
                and other.rules is None
                and other.stochastic == arm.stochastic
                and np.array_equal(episodes.seeds, own.seeds)
            ):
                return episodes
        return None


def compare(
    env_id: EnvironmentOrId,
    arms: Sequence[Arm],
    *,
    episodes: int = 100,
    seed: int = 0,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Run the same episodes with every arm.

    Args:
        env_id: What ``gymnasium.make`` takes.
        arms: At least one, with names of their own.
        episodes: How many each, E.
        seed: Episode i of every arm starts from seed + i and draws the same random numbers.
        jobs: Processes; changes the speed, never the result.
        executor: Whose processes they are; this machine's where not given.
        progress: Called with (episodes done, in all, over all arms); returning False stops.

    Returns:
        The comparison; the same arguments give the same one, bit for bit.

    Raises:
        InputError: If there is no arm, two share a name, a number is out of range, or an arm
            does not fit the environment.
        CancelledError: If `progress` returned False; nothing is kept here. Who wants to keep
            finished arms runs them one by one with `compare_arm`.
    """
    names = [arm.name for arm in arms]
    if not arms:
        raise InputError("there is nothing to compare; choose at least one agent and shield")
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two of the compared arms are called {twice!r}; give each its own name")
    total = len(arms) * episodes
    played = tuple(
        compare_arm(
            env_id,
            arm,
            episodes=episodes,
            seed=seed,
            jobs=jobs,
            executor=executor,
            progress=part_of(progress, index * episodes, total),
        )
        for index, arm in enumerate(arms)
    )
    return Comparison(str(env_id), seed, tuple(arms), played)


def compare_arm(
    env_id: EnvironmentOrId,
    arm: Arm,
    *,
    episodes: int = 100,
    seed: int = 0,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Episodes:
    """Run the episodes of one arm.

    Args:
        env_id: What ``gymnasium.make`` takes.
        arm: Agent and shield.
        episodes: How many, E.
        seed: Of the first.
        jobs: Processes.
        executor: Whose processes they are; this machine's where not given.
        progress: Called with (episodes done, E); returning False stops.

    Returns:
        The episodes, without their steps.

    Raises:
        InputError: If a number is out of range, or agent, rules and environment do not fit.
        CancelledError: If `progress` returned False.
    """
    shield = (
        None
        if arm.rules is None
        else Shield(arm.rules, projection=arm.projection, outside=arm.outside)
    )
    return rollout(
        env_id,
        arm.agent,
        shield=shield,
        episodes=episodes,
        seed=seed,
        stochastic=arm.stochastic,
        jobs=jobs,
        executor=executor,
        keep_steps=False,
        progress=progress,
    )


def comparison_row(arm: Arm, episodes: Episodes, alone: Episodes | None = None) -> dict[str, Any]:
    """What one arm's episodes say, for a table.

    Args:
        arm: The arm.
        episodes: Its E episodes.
        alone: Those of the same agent without a shield, on the same seeds, where they were run.

    Returns:
        `arm`, `agent`, `rules` (their number, None without a shield), `episodes`, the statistics
        of `Episodes.summary` (without a shield, `intervention_rate`, `coverage` and
        `outside_rate` are None), `crash_rate` and, in words, `failure`, what one is, None where
        they are not known, and of `ShieldEffect`
        `return_difference`, `difference_low`, `difference_high`, `return_p`, `failure_p` and
        `effect`, None where the episodes without a shield are not given.
    """
    effect = None if alone is None else shield_effect(alone, episodes)
    row: dict[str, Any] = {
        "arm": arm.name,
        "agent": episodes.agent,
        "rules": None if arm.rules is None else len(arm.rules),
        "episodes": len(episodes),
        **episodes.summary(),
        "crash_rate": None if episodes.failures is None else episodes.failures.rate,
        "failure": episodes.failure or None,
    }
    if arm.rules is None:
        row |= {"intervention_rate": None, "coverage": None, "outside_rate": None}
    known = effect is not None and effect.failures is not None
    return row | {
        "return_difference": None if effect is None else effect.returns.mean,
        "difference_low": None if effect is None else effect.returns.low,
        "difference_high": None if effect is None else effect.returns.high,
        "return_p": None if effect is None else effect.return_p,
        "failure_p": effect.failure_p if effect is not None and known else None,
        "effect": None if effect is None else effect.effect,
    }
