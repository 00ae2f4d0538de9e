"""Rounds of probes: where the rules lead, each action is tried, and rules are made of all outcomes.

What an agent gets into depends on what it may do. So its states are probed under the rules of the
round before, and of the first round in turns with the expert. The best round is the one in which
the shielded agent fails least, in other episodes; it is reported on a third kind.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from numbers import Real
from pathlib import Path

import numpy as np

from sarl_core.agents.agent import Agent, EpisodicAgent
from sarl_core.demonstrations.derived import DerivedFeature
from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.environments.failures import failure_known, no_failures_text
from sarl_core.errors import InputError, require, require_whole
from sarl_core.improving.probing.outcomes import Outcomes, probed
from sarl_core.improving.probing.probe_rules import probe_rules
from sarl_core.improving.questions import answered
from sarl_core.mining.combining.candidates import candidates, pairs_of_like_kind
from sarl_core.mining.environment_actions import environment_dimensions
from sarl_core.mining.labels import MAX_DIVIDER, LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.processes import executor_of, run_each
from sarl_core.progress import Progress, part_of
from sarl_core.rollouts import seeds
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield

_FEWEST = 15  # states: a share of fewer is none
_IN_TURNS = 4  # of so many episodes one is played in turns with the expert, in later rounds too


@dataclass(frozen=True)
class ProbePlan:
    """What is to be probed, and what is made of it.

    Attributes:
        rounds: How many.
        episodes: Of each round.
        states: Probed in an episode, at most.
        steps: How long an action is done before the expert has the controls.
        leaves: Most of each tree.
        risk: An action is forbidden where the expert failed after it in more than this share of
            the states.
        combine: Whether rules may ask about combinations of two features.
        divider: Number of intervals of continuous dimensions.
        validation: Episodes by which a round is chosen.
        report: Episodes of the report.
        seed: Another one gives other episodes.
        max_steps: After which an episode is cut off; None for `episodes.MAX_STEPS`.
    """

    rounds: int = 8
    episodes: int = 200
    states: int = 8
    steps: int = 10
    leaves: int = 24
    risk: float = 0.2
    combine: bool = True
    divider: int = 2
    validation: int = 200
    report: int = 1_000
    seed: int = 0
    max_steps: int | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be done.

        Raises:
            InputError: If a number is out of range.
        """
        for name, value, least in (
            ("number of rounds", self.rounds, 1),
            ("number of episodes", self.episodes, 1),
            ("number of states", self.states, 1),
            ("number of steps", self.steps, 1),
            ("number of leaves", self.leaves, 2),
            ("divider", self.divider, 2),
            ("number of validation episodes", self.validation, 1),
            ("number of report episodes", self.report, 1),
            ("max_steps", 1 if self.max_steps is None else self.max_steps, 1),
        ):
            require_whole(name, value, least)
        seeds.require_seed(self.seed, seeds.LARGEST_RUN)
        require(self.risk, Real, "the risk must be a number", "give a share, as 0.2")
        if not 0.0 < self.risk < 1.0:
            raise InputError(f"the risk is {self.risk}; give a share above 0 and below 1, as 0.2")
        for name, value, most in (
            ("episodes", self.episodes, seeds.MOST_EPISODES_A_ROUND),
            ("rounds", self.rounds, seeds.MOST_ROUNDS),
            ("validation episodes", self.validation, seeds.MOST_VALIDATION),
            ("report episodes", self.report, seeds.MOST_VALIDATION),
            ("intervals", self.divider, MAX_DIVIDER),
        ):
            if value > most:
                raise InputError(f"there are {value:,} {name}; give at most {most:,}")


@dataclass(frozen=True)
class ProbeRound:
    """What one round brought.

    Attributes:
        number: Counted from 1.
        states: Probed so far, those of earlier rounds included.
        rule_set: Made of all of them.
        played: The shielded agent in the validation episodes.
    """

    number: int
    states: int
    rule_set: RuleSet
    played: Episodes

    @property
    def freedom(self) -> float:
        """What its rules left the agent to choose from, mean over the steps."""
        return float(self.played.summary()["freedom"])

    @property
    def score(self) -> tuple[float, float]:
        """What it is chosen by: the fewest failures, of equals the most freedom."""
        return -float(self.played.failed.sum()), self.freedom


@dataclass(frozen=True)
class Probing:
    """Finished rounds, and the best of them.

    Attributes:
        plan: What was to be done.
        rounds: All of them.
        chosen: The best.
        reported: The agent under its rules, in episodes that nothing was chosen by.
        outcomes: What came of all probes.
    """

    plan: ProbePlan
    rounds: tuple[ProbeRound, ...]
    chosen: ProbeRound
    reported: Episodes
    outcomes: Outcomes

    @property
    def rule_set(self) -> RuleSet:
        """The rules of the best round."""
        return self.chosen.rule_set


def probe(
    env_id: EnvironmentOrId,
    plan: ProbePlan,
    *,
    agent: str | Path | Agent = "novice",
    expert: str | Path | Agent = "expert",
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
    watch: Callable[[ProbeRound], None] | None = None,
) -> Probing:
    """Find out what an expert does not recover from, and forbid it.

    Args:
        env_id: What ``gymnasium.make`` takes; its failures are known, and it repeats itself on one
            seed.
        plan: How much.
        agent: Who is to be protected.
        expert: Who recovers: a trained policy, or an agent of the caller's own.
        jobs: Processes; changes the speed, never the result.
        executor: Whose processes they are; this machine's where not given.
        progress: Called with (episodes done, in all); returning False stops.
        watch: Called after every round.

    Returns:
        The rules, and what they achieve.

    Raises:
        InputError: If something does not fit, the failures of the environment are not known, it
            does not repeat itself, or no state was worth a probe.
        CancelledError: If `progress` returned False.
    """
    if not failure_known(env_id):
        raise InputError(f"{no_failures_text(env_id)}; say what a failure is with --failure")
    player, recovering = make_agent(agent, env_id), make_agent(expert, env_id)
    workers = executor_of(jobs, executor)
    if any(isinstance(one, EpisodicAgent) for one in (player, recovering)):
        workers = None  # they play in this process
    total = plan.rounds * (plan.episodes + plan.validation) + plan.report
    begun, finished = 0, list[ProbeRound]()
    shield: Shield | None = None
    parts: list[Outcomes] = []

    def rest(count: int) -> Progress:
        nonlocal begun
        before, begun = begun, begun + count
        return part_of(progress, before, total)

    def shielded(rules: RuleSet, first: int, count: int) -> Episodes:
        return rollout(
            env_id,
            player,
            shield=Shield(rules),
            episodes=count,
            seed=seeds.of_run(first, plan.seed),
            jobs=jobs,
            executor=workers,
            keep_steps=False,
            max_steps=plan.max_steps,
            progress=rest(count),
        )

    for number in range(1, plan.rounds + 1):
        first = seeds.of_run(seeds.ROUNDS, plan.seed) + (number - 1) * seeds.SEEDS_A_ROUND
        tasks = [
            (env_id, player, recovering, shield if place % _IN_TURNS else None, first + place, plan)
            for place in range(plan.episodes)
        ]
        parts += run_each(_probed, tasks, executor=workers, progress=rest(plan.episodes))
        outcomes = Outcomes.join(parts)
        if len(outcomes) < _FEWEST:
            raise InputError(
                f"the expert came by in {len(outcomes)} states of {plan.episodes} episodes, "
                "too few to learn from; give an expert that does not fail, or more episodes"
            )
        rules = _rules(env_id, recovering, outcomes, plan)
        shield = Shield(rules)
        played = shielded(rules, seeds.VALIDATION, plan.validation)
        finished.append(ProbeRound(number, len(outcomes), rules, played))
        if watch is not None:
            watch(finished[-1])
    best = max(finished, key=lambda one: one.score)
    return Probing(
        plan,
        tuple(finished),
        best,
        shielded(best.rule_set, seeds.REPORT, plan.report),
        outcomes,
    )


def _probed(
    env_id: EnvironmentOrId,
    agent: Agent,
    expert: Agent,
    shield: Shield | None,
    seed: int,
    plan: ProbePlan,
) -> Outcomes:
    """Probe one episode, in a process."""
    return probed(
        env_id,
        agent,
        expert,
        shield,
        seed,
        dimensions=_dimensions(env_id, plan.divider),
        states=plan.states,
        steps=plan.steps,
        max_steps=plan.max_steps,
    )


def _dimensions(env_id: EnvironmentOrId, divider: int) -> tuple[LabelledDimension, ...]:
    """The action dimensions and their labels, by the environment's bounds."""
    description = describe_environment(env_id)
    bounds = (description.action_low, description.action_high)
    if any(one is not None and not np.isfinite(one).all() for one in bounds):
        raise InputError(
            f"actions of {env_id} have no bounds, so they cannot be divided and tried; give an "
            "environment with bounds, as by gymnasium's ClipAction or RescaleAction"
        )
    return environment_dimensions(description, None, divider=divider)


def _rules(env_id: EnvironmentOrId, expert: Agent, outcomes: Outcomes, plan: ProbePlan) -> RuleSet:
    """The rules that follow from all outcomes."""
    pairs = answered(
        env_id,
        expert,
        outcomes.observations,
        outcomes.actions,
        outcomes.episodes,
        outcomes.steps,
    )
    if plan.combine and (of_like_kind := pairs_of_like_kind(pairs)):
        pairs = pairs.deriving([DerivedFeature(one) for one in candidates(pairs, of_like_kind)])
    return probe_rules(
        pairs,
        outcomes,
        leaves=plan.leaves,
        risk=plan.risk,
        divider=plan.divider,
        seed=plan.seed,
    )
