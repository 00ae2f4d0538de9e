"""Improving rules beside the page: what it depends on, the work itself, and what came of it."""

from __future__ import annotations

import time
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import streamlit as st

from sarl_core import __version__
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import SarlError
from sarl_core.improving.aggregation import Aggregation, AggregationRound, aggregate
from sarl_core.improving.gaps import Gaps, gaps_so_far
from sarl_core.improving.outcome_files import (
    aggregation_contents,
    aggregation_from,
    gaps_contents,
    gaps_from,
)
from sarl_core.improving.plan import Plan
from sarl_core.library.items import Kind
from sarl_core.limits import limited_bytes
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.processes import workers_of
from sarl_dashboard.cache import key_of
from sarl_dashboard.jobs.episodes import AgentMaker
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.jobs.processes import processes
from sarl_dashboard.jobs.queue import JobKind
from sarl_dashboard.memory_cache import BoundedCache
from sarl_dashboard.state import library
from sarl_dashboard.text import digest_of

MOST_OUTCOMES = 6  # a finished run holds up to some ten megabytes of demonstrations
_KIND: Kind = "improvement"
_RUNS = JobKind("runs of Improve")  # each takes minutes of all processors
_SOON = 0.03  # share of the work from which on the rest can be guessed


@dataclass(frozen=True, eq=False)
class ImprovementOrder:
    """Everything that a run depends on.

    Attributes:
        start: What the expert has shown so far.
        env_id: Environment.
        plan: How many rules, rounds and episodes.
        expert: Makes who is asked; None where there is nobody.
        rules: Without an expert, the rules whose gaps are looked for.
        command: The same on the command line.
    """

    start: Demonstrations
    env_id: EnvironmentOrId
    plan: Plan
    expert: AgentMaker | None
    rules: RuleSet | None
    command: str

    @cached_property
    def key(self) -> object:
        """Equal keys give equal results."""
        expert = self.expert.digest if self.expert is not None else None
        return key_of((self.start, self.env_id, self.plan, expert, self.rules))

    @cached_property
    def digest(self) -> str:
        """The same for a library, which outlives this process; other versions run anew."""
        return digest_of(repr((__version__, self.key)).encode())


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of an order.

    Attributes:
        order: What was asked for.
        rounds: Those that were finished.
        improved: The best rules; None where no round was finished, or nobody was asked.
        gaps: States that need a demonstration, where nobody was asked.
    """

    order: ImprovementOrder
    rounds: tuple[AggregationRound, ...] = ()
    improved: Aggregation | None = None
    gaps: Gaps | None = None

    @property
    def is_finished(self) -> bool:
        """Whether all of it was done."""
        if self.gaps is not None:
            return self.gaps.episodes >= self.order.plan.episodes
        return self.improved is not None and self.improved.is_finished

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to see."""
        return not self.rounds and self.gaps is None


@st.cache_resource
def outcome_cache() -> BoundedCache[Outcome]:
    """Outcomes of finished runs by their order's key."""
    return BoundedCache(MOST_OUTCOMES)


def known_outcome(order: ImprovementOrder) -> Outcome | None:
    """What came of an order before, in this process or by the library; it may be unfinished.

    Args:
        order: What is asked for.

    Returns:
        None where nothing did.
    """
    finished = outcome_cache().get(order.key)
    if finished is not None:
        return finished
    outcome = None
    with suppress(SarlError):  # what cannot be read is run again
        for paths in library.stored_work(_KIND, order.digest):
            files = {role: limited_bytes(path) for role, path in paths.items()}
            if order.expert is None:
                outcome = Outcome(order, gaps=gaps_from(files))
            else:
                improved = aggregation_from(files, order.plan)
                outcome = Outcome(order, improved.rounds, improved)
            outcome_cache().put(order.key, outcome)
    return outcome


def keep_outcome(outcome: Outcome) -> None:
    """Keep what came of an order, so that a link to it opens it.

    Args:
        outcome: Finished or not; one without rules and states is not kept.

    Raises:
        SarlError: If it cannot be kept.
    """
    order, improved, gaps = outcome.order, outcome.improved, outcome.gaps
    if improved is not None:
        contents = aggregation_contents(improved)
        amount = len(improved.rounds) + improved.is_finished
    elif gaps is not None:
        contents, amount = gaps_contents(gaps), gaps.episodes
    else:
        return
    library.keep_work(_KIND, str(order.env_id), order.digest, contents, amount)


def improving(order: ImprovementOrder) -> Job[Outcome]:
    """Improve rules, or find their gaps where there is nobody to ask.

    Args:
        order: What is asked for.
    """
    cache, executor = outcome_cache(), processes()

    def work(job: Job[Outcome]) -> None:
        run = _ImprovementRun(job, order, executor, time.monotonic())
        outcome, finished = run.find_gaps() if order.expert is None else run.improve()
        job.result = outcome
        if finished:
            cache.put(order.key, outcome)
        with suppress(SarlError):  # here it is all the same; a page says that keeping fails
            keep_outcome(outcome)

    total = order.plan.rounds * order.plan.episodes
    return Job(order.key, work, total, Outcome(order), lasts=True, kind=_RUNS)


@dataclass
class _ImprovementRun:
    """A run, and what it tells of itself meanwhile."""

    job: Job[Outcome]
    order: ImprovementOrder
    executor: Executor
    began: float
    rounds: tuple[AggregationRound, ...] = ()

    def improve(self) -> tuple[Outcome, bool]:
        """What came of asking the expert, and whether it was finished."""
        order, job = self.order, self.job
        assert order.expert is not None
        job.text = "Growing the first trees …"

        def progress(done: int, total: int) -> bool:
            wanted = job.progress(done, total)
            job.text = self._phase() + self._time_left()
            return wanted

        def watch(finished: AggregationRound) -> None:
            self.rounds = (*self.rounds, finished)
            job.result = Outcome(order, self.rounds)
            job.text = self._phase() + self._time_left()

        improved = aggregate(
            order.start,
            order.plan,
            env_id=order.env_id,
            expert=order.expert(),
            jobs=workers_of(self.executor),
            executor=self.executor,
            progress=progress,
            watch=watch,
        )
        return Outcome(order, improved.rounds, improved), improved.is_finished

    def find_gaps(self) -> tuple[Outcome, bool]:
        """States that need a demonstration; always finished, unless it was called off."""
        order, job = self.order, self.job
        assert order.rules is not None
        outcome = Outcome(order)

        def progress(done: int, total: int) -> bool:
            job.done = done
            job.text = f"{done} of {counted(total, 'episode')}{self._time_left()}"
            return job.wanted()

        progress(0, order.plan.episodes)
        for gaps in gaps_so_far(
            order.env_id,
            order.rules,
            episodes=order.plan.episodes,
            seed=order.plan.seed,
            jobs=workers_of(self.executor),
            executor=self.executor,
            progress=progress,
        ):
            job.result = outcome = Outcome(order, gaps=gaps)
        return outcome, True

    def _phase(self) -> str:
        plan, finished = self.order.plan, len(self.rounds)
        if finished < plan.rounds:
            return f"Round {finished + 1} of {plan.rounds}: the rules act, the expert answers"
        if self.job.done > self.job.total - plan.report:
            return "The best rules on fresh episodes"
        if plan.turns:
            return "Choosing the best round and refining its rules"
        return "Choosing the best round on other episodes"

    def _time_left(self) -> str:
        if self.job.share < _SOON:
            return " …"
        left = (time.monotonic() - self.began) * (1 / self.job.share - 1)
        if left < 50:
            return f" · about {max(5, 5 * round(left / 5))} s left"
        return f" · about {counted(max(1, round(left / 60)), 'minute')} left"
