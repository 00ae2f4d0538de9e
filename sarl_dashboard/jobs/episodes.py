"""Episodes of agents with and without shields: run in processes, kept for whoever asks again.

An episode depends on its environment, agent, rules and seed, and on nothing else. So what is kept
under the key of these are the episodes themselves, as many as there are: more of them continue
where the last ones ended, and fewer are the first of them.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from threading import Lock
from typing import Protocol

import streamlit as st

from sarl_core import __version__
from sarl_core.agents.agent import Agent
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import SarlError
from sarl_core.mining.rule_set import RuleSet
from sarl_core.rollouts.episodes import Episodes, join
from sarl_core.rollouts.player import check_environment
from sarl_core.rollouts.tasks import Task, run_tasks
from sarl_core.shielding.shield import Outside, Projection, Shield
from sarl_dashboard.cache import key_of
from sarl_dashboard.jobs.job import Job, Place
from sarl_dashboard.jobs.processes import processes
from sarl_dashboard.jobs.queue import queue
from sarl_dashboard.state import library
from sarl_dashboard.text import digest_of

MOST_EPISODES = 10_000  # of a row; no page asks for as many
MOST_RESULTS = 1_000  # a hundred episodes take about 10 kB


class AgentMaker(Protocol):
    """Makes an agent, which may take its time."""

    @property
    def digest(self) -> str:
        """What tells the agent from others in its environment and with its seed."""

    def __call__(self) -> Agent:
        """Make it."""


@dataclass(frozen=True, eq=False)
class Row:
    """One row of a comparison: whose episodes they are, and how to run them.

    Attributes:
        name: On screen.
        env_id: Environment.
        seed: Of the first episode.
        agent: Makes the agent.
        rules: Of the shield; None without one.
        projection: How the shield replaces a continuous action.
        outside: Whether rules act in states outside the data they were mined from.
    """

    name: str
    env_id: EnvironmentOrId
    seed: int
    agent: AgentMaker
    rules: RuleSet | None = None
    projection: Projection = "centre"
    outside: Outside = "act"

    @cached_property
    def key(self) -> object:
        """Of everything that the episodes depend on, their number left out."""
        shield = (self.rules, self.projection, self.outside)
        return key_of((self.env_id, self.seed, self.agent.digest, shield))

    @cached_property
    def digest(self) -> str:
        """The same for a library, which outlives this process; other versions run anew."""
        return digest_of(repr((__version__, self.key)).encode())

    def shield(self) -> Shield | None:
        """Make the shield."""
        if self.rules is None:
            return None
        return Shield(self.rules, projection=self.projection, outside=self.outside)


class Results:
    """Episodes by their key, and why there are none; shared between sessions."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._episodes: OrderedDict[object, Episodes] = OrderedDict()
        self._cuts: dict[object, Episodes] = {}
        self._looked_for: set[object] = set()

    def is_new(self, key: object) -> bool:
        """Whether nothing is kept under a key and nobody has looked in the library for it."""
        with self._lock:
            if key in self._episodes or key in self._looked_for:
                return False
            self._looked_for.add(key)
            return True

    def get(self, key: object, most: int) -> Episodes | None:
        """The first of the episodes that are kept.

        Args:
            key: Of a row.
            most: How many at most.

        Returns:
            None if there are none. The same object as the last time if nothing has changed.
        """
        with self._lock:
            episodes = self._episodes.get(key)
            if episodes is None:
                return None
            self._episodes.move_to_end(key)
            if len(episodes) <= most:
                return episodes
            cut = self._cuts.get(key)
            if cut is None or len(cut) != most:
                cut = self._cuts[key] = episodes.part(0, most)
            return cut

    def add(self, row: Row, episodes: Episodes) -> None:
        """Keep more episodes of a row.

        Args:
            row: Whose they are.
            episodes: Those that follow the kept ones. Some may be kept already, when two visitors
                asked for the same.
        """
        with self._lock:
            before = self._episodes.get(row.key)
            following = row.seed + (len(before) if before is not None else 0)
            already = following - int(episodes.seeds[0])
            if not 0 <= already < len(episodes):
                return
            fresh = episodes.part(already, len(episodes))
            self._episodes[row.key] = fresh if before is None else join([before, fresh])
            self._episodes.move_to_end(row.key)
            while len(self._episodes) > MOST_RESULTS:
                oldest, _ = self._episodes.popitem(last=False)
                self._cuts.pop(oldest, None)


@st.cache_resource
def results() -> Results:
    """What has been run so far."""
    return Results()


@dataclass(frozen=True, eq=False)
class EpisodeBatch:
    """Rows that were asked for together.

    Attributes:
        rows: Each once; two names may mean the same, as "filtered" and these very thresholds.
        episodes: How many of each.
        problems: By key, why a row's episodes cannot be run; the others are run all the same.
    """

    rows: tuple[Row, ...]
    episodes: int
    problems: dict[object, SarlError] = field(default_factory=dict)


COMPARISON = Place[EpisodeBatch]("comparison")  # of the page Measure


def run_batch(rows: Sequence[Row], episodes: int) -> Job[EpisodeBatch]:
    """Run what is missing of the episodes of several rows, one row after the other.

    Args:
        rows: What is looked at.
        episodes: How many of each.
    """
    batch = EpisodeBatch(tuple({row.key: row for row in reversed(rows)}.values())[::-1], episodes)
    known_episodes, executor = results(), processes()
    return Job(
        None,
        lambda job: _run(job, batch, known_episodes, executor),
        len(batch.rows) * episodes,
        batch,
        lasts=True,
    )


def take_up_work(place: Place[EpisodeBatch], rows: Sequence[Row]) -> None:
    """Go on looking at work that was begun before this page was loaded anew, or elsewhere.

    Args:
        place: Of the work.
        rows: What is looked at; work on any of them is meant.
    """
    if place.job is not None:
        return
    keys = {row.key for row in rows}
    for job in (*queue().running, *queue().waiting):
        batch = job.result
        if not isinstance(batch, EpisodeBatch) or not (job.running and job.is_own):
            continue
        if keys & {row.key for row in batch.rows}:
            place.take_up(job)
            return


def _run(
    job: Job[EpisodeBatch], batch: EpisodeBatch, known_episodes: Results, executor: Executor
) -> None:
    def count(row: Row) -> int:
        have = known_episodes.get(row.key, batch.episodes)
        return len(have) if have is not None else 0

    incomplete, tasks = [], []
    for row in batch.rows:
        have = count(row)
        job.done += have
        if have < batch.episodes:
            job.text = f"Preparing {row.name} …"
            try:
                tasks.append(_task(row, have, batch.episodes))
                incomplete.append(row)
            except SarlError as error:
                batch.problems[row.key] = error
                job.done += batch.episodes - have
        if not job.wanted():
            return
    job.text = "Starting …"
    work = run_tasks(tasks, executor)
    for index, outcome in work:
        row = incomplete[index]
        if isinstance(outcome, SarlError):
            batch.problems[row.key] = outcome
            continue
        known_episodes.add(row, outcome)
        job.done += len(outcome)
        job.text = f"{row.name}: {count(row)} of {batch.episodes} episodes"
        if not job.wanted():
            work.close()
            break
    for row in incomplete:
        episodes = known_episodes.get(row.key, MOST_EPISODES)
        if episodes is not None:
            with suppress(SarlError):  # here they are all the same; a page has said that it fails
                library.keep_episodes(episodes, row.name, row.digest)


def _task(row: Row, have: int, episodes: int) -> Task:
    agent, shield = row.agent(), row.shield()
    check_environment(row.env_id, shield)
    return Task(row.env_id, agent, shield, row.seed + have, episodes - have)


def known(rows: Sequence[Row], episodes: int) -> list[Episodes | None]:
    """What has been run of some rows, by whomever.

    Args:
        rows: What is looked at.
        episodes: How many of each.

    Returns:
        One entry a row.
    """
    for row in rows:
        if results().is_new(row.key) and (stored := library.stored_episodes(row.digest)):
            results().add(row, stored)
    return [results().get(row.key, episodes) for row in rows]
