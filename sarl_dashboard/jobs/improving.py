"""Improving rules beside the page: what it depends on, the work itself, and what came of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Lock

import streamlit as st

from sarl_core.agents.agent import Agent
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.improving.aggregation import Aggregation, Round, aggregate
from sarl_core.improving.gaps import Gaps, gaps_so_far
from sarl_core.improving.plan import Plan
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.progress import CancelledError
from sarl_dashboard.byte_cache import Kept
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.jobs.processes import processes

KEPT = 6  # a finished run holds up to some ten megabytes of demonstrations
_SOON = 0.03  # share of the work from which on the rest can be guessed


@dataclass(frozen=True, eq=False)
class Order:
    """Everything that a run depends on.

    Attributes:
        key: Digest of it; equal keys give equal results.
        start: What the expert has shown so far.
        env_id: Environment.
        plan: How many rules, rounds and episodes.
        expert: Makes who is asked; None where there is nobody.
        rules: Without an expert, the rules whose gaps are looked for.
        command: The same on the command line.
    """

    key: str
    start: Demonstrations
    env_id: str
    plan: Plan
    expert: Callable[[], Agent] | None
    rules: RuleSet | None
    command: str


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of an order.

    Attributes:
        order: What was asked for.
        rounds: Those that were finished.
        improved: The best rules; None where no round was finished, or nobody was asked.
        gaps: States that need a demonstration, where nobody was asked.
    """

    order: Order
    rounds: tuple[Round, ...] = ()
    improved: Aggregation | None = None
    gaps: Gaps | None = None

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to see."""
        return not self.rounds and self.gaps is None


@st.cache_resource
def kept_outcomes() -> Kept[Outcome]:
    """Outcomes of finished runs by their order's key."""
    return Kept(KEPT)


@st.cache_resource
def _one_at_a_time() -> Lock:
    """Runs take minutes of all processors: one is finished sooner than two side by side."""
    return Lock()


class Working(Job):
    """A run, beside the page.

    Attributes:
        order: What was asked for.
        outcome: What is known so far.
    """

    def __init__(self, order: Order) -> None:
        self.order = order
        self.outcome = Outcome(order)
        # Streamlit's caches are asked here: the work's own thread has no session.
        self._kept, self._lock = kept_outcomes(), _one_at_a_time()
        self._processes = processes()
        self._began = time.monotonic()
        super().__init__(self._in_turn, order.plan.rounds * order.plan.episodes)

    @property
    def stopping(self) -> bool:
        """Whether it was called off and what it has finished is still being gathered."""
        return self._cancelled and not self._finished

    def _in_turn(self, _: Job) -> None:
        with self._turn() as mine:
            if not mine:
                return
            self._began = time.monotonic()
            try:
                finished = self._find_gaps() if self.order.expert is None else self._improve()
            except CancelledError:
                return
        if finished:
            self._kept.put(self.order.key, self.outcome)

    @contextmanager
    def _turn(self) -> Iterator[bool]:
        """Wait for other visitors' runs; False where this one is no longer wanted by then."""
        while not self._lock.acquire(timeout=0.3):
            self.text = "Waiting until another run has ended …"
            if not self.wanted():
                yield False
                return
        try:
            yield True
        finally:
            self._lock.release()

    def _improve(self) -> bool:
        order = self.order
        assert order.expert is not None
        self.text = "Growing the first trees …"

        def progress(done: int, total: int) -> bool:
            self.done, self.total = done, total
            self.text = self._phase() + self._time_left()
            return self.wanted()

        def watch(finished: Round) -> None:
            self.outcome = Outcome(order, (*self.outcome.rounds, finished))
            self.text = self._phase() + self._time_left()

        found = aggregate(
            order.start,
            order.plan,
            env_id=order.env_id,
            expert=order.expert(),
            jobs=self._processes.workers,
            executor=self._processes,
            progress=progress,
            watch=watch,
        )
        self.outcome = Outcome(order, found.rounds, found)
        return found.is_finished

    def _phase(self) -> str:
        plan, finished = self.order.plan, len(self.outcome.rounds)
        if finished < plan.rounds:
            return f"Round {finished + 1} of {plan.rounds}: the rules act, the expert answers"
        if self.done > self.total - plan.report:
            return "The best rules on fresh episodes"
        if plan.generations:
            return "Choosing the best round and refining its rules"
        return "Choosing the best round on other episodes"

    def _time_left(self) -> str:
        if self.share < _SOON:
            return " …"
        left = (time.monotonic() - self._began) * (1 / self.share - 1)
        if left < 50:
            return f" · about {max(5, 5 * round(left / 5))} s left"
        return f" · about {counted(max(1, round(left / 60)), 'minute')} left"

    def _find_gaps(self) -> bool:
        order = self.order
        assert order.rules is not None

        def progress(done: int, total: int) -> bool:
            self.done = done
            self.text = f"{done} of {counted(total, 'episode')}{self._time_left()}"
            return self.wanted()

        progress(0, order.plan.episodes)
        for found in gaps_so_far(
            order.env_id,
            order.rules,
            episodes=order.plan.episodes,
            seed=order.plan.seed,
            jobs=self._processes.workers,
            executor=self._processes,
            progress=progress,
        ):
            self.outcome = Outcome(order, gaps=found)
        return True
