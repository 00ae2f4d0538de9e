"""Episodes of agents with and without shields: run in processes, kept for whoever asks again.

An episode depends on its environment, agent, rules and seed, and on nothing else. So what is kept
under the digest of these are the episodes themselves, as many as there are: more of them continue
where the last ones ended, and fewer are the first of them.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import cast

import streamlit as st

from sarl_core.agents.agent import Agent
from sarl_core.errors import SarlError
from sarl_core.rollouts.episodes import Episodes, join
from sarl_core.rollouts.player import check_environment
from sarl_core.rollouts.tasks import Task, run_tasks
from sarl_core.shielding.shield import Shield
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.jobs.processes import processes
from sarl_dashboard.text import digest_of

MOST_RESULTS = 1_000  # a hundred episodes take about 10 kB


@dataclass(frozen=True, eq=False)
class Row:
    """One row of a comparison: whose episodes they are, and how to run them.

    Attributes:
        key: Digest of everything the episodes depend on, their number left out.
        name: On screen.
        env_id: Environment.
        seed: Of the first episode.
        agent: Makes the agent.
        shield: Makes the shield, or gives None.
    """

    key: str
    name: str
    env_id: str
    seed: int
    agent: Callable[[], Agent]
    shield: Callable[[], Shield | None]


def row_key(env_id: str, agent: str, rules: str, projection: str, seed: int) -> str:
    """Digest of what episodes depend on.

    Args:
        env_id: Environment.
        agent: Tells the agent from all others, by content.
        rules: Tells the rules, "" for none.
        projection: How they replace a continuous action; "centre" where there are none.
        seed: Of the first episode.

    Returns:
        Hexadecimal digits.
    """
    return digest_of(repr((env_id, agent, rules, projection, seed)).encode())


class Results:
    """Episodes by their key, and why there are none; shared between sessions."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._episodes: OrderedDict[str, Episodes] = OrderedDict()
        self._cuts: dict[str, Episodes] = {}

    def get(self, key: str, most: int) -> Episodes | None:
        """The first of the episodes that are kept.

        Args:
            key: Of a row.
            most: How many at most.

        Returns:
            None if there are none. The same object as the last time if nothing has changed.
        """
        with self._lock:
            found = self._episodes.get(key)
            if found is None:
                return None
            self._episodes.move_to_end(key)
            if len(found) <= most:
                return found
            cut = self._cuts.get(key)
            if cut is None or len(cut) != most:
                cut = self._cuts[key] = found.part(0, most)
            return cut

    def add(self, row: Row, episodes: Episodes) -> None:
        """Keep more episodes of a row.

        Args:
            row: Whose they are.
            episodes: Those that follow the kept ones. Some may be kept already, when two visitors
                asked for the same.
        """
        with self._lock:
            kept = self._episodes.get(row.key)
            following = row.seed + (len(kept) if kept is not None else 0)
            known = following - int(episodes.seeds[0])
            if not 0 <= known < len(episodes):
                return
            fresh = episodes.part(known, len(episodes))
            self._episodes[row.key] = fresh if kept is None else join([kept, fresh])
            self._episodes.move_to_end(row.key)
            while len(self._episodes) > MOST_RESULTS:
                gone, _ = self._episodes.popitem(last=False)
                self._cuts.pop(gone, None)


@st.cache_resource
def results() -> Results:
    """What has been run so far."""
    return Results()


class Comparing(Job):
    """Episodes of several rows, run one row after the other.

    Attributes:
        problems: By key, why a row's episodes cannot be run; the others are run all the same.
    """

    def __init__(self, rows: Sequence[Row], episodes: int) -> None:
        self.problems: dict[str, SarlError] = {}
        # Two names may mean the same, as "filtered" and these very thresholds.
        self._rows = tuple({row.key: row for row in reversed(rows)}.values())[::-1]
        self._episodes = episodes
        # Streamlit's caches are asked here: the work's own thread has no session.
        self._results, self._processes = results(), processes()
        super().__init__(self._compare, len(self._rows) * episodes)

    @property
    def rows(self) -> tuple[Row, ...]:
        """What was asked for."""
        return self._rows

    @property
    def episodes(self) -> int:
        """How many of each row."""
        return self._episodes

    def _compare(self, _: Job) -> None:
        todo, tasks = [], []
        for row in self._rows:
            have = self._results.get(row.key, self._episodes)
            count = len(have) if have is not None else 0
            self.done += count
            if count < self._episodes:
                self.text = f"Preparing {row.name} …"
                try:
                    tasks.append(self._task(row, count))
                    todo.append(row)
                except SarlError as error:
                    self.problems[row.key] = error
                    self.done += self._episodes - count
            if not self.wanted():
                return
        self.text = "Starting …"
        work = run_tasks(tasks, self._processes)
        for index, found in work:
            row = todo[index]
            if isinstance(found, SarlError):
                self.problems[row.key] = found
                continue
            self._results.add(row, found)
            self.done += len(found)
            self.text = f"{row.name}: {self._count(row)} of {self._episodes} episodes"
            if not self.wanted():
                work.close()
                return

    def _count(self, row: Row) -> int:
        have = self._results.get(row.key, self._episodes)
        return len(have) if have is not None else 0

    def _task(self, row: Row, have: int) -> Task:
        agent, shield = row.agent(), row.shield()
        check_environment(row.env_id, shield)
        return Task(row.env_id, agent, shield, row.seed + have, self._episodes - have)


def job(name: str) -> Comparing | None:
    """The work that this visitor asked for last.

    Args:
        name: Of the place on screen.

    Returns:
        None if nothing was asked for.
    """
    return cast("Comparing | None", st.session_state.get(f"_job_{name}"))


def working(name: str) -> bool:
    """Whether it goes on.

    Args:
        name: Of the place on screen.
    """
    asked = job(name)
    return asked is not None and asked.running


def known(rows: Sequence[Row], episodes: int) -> list[Episodes | None]:
    """What has been run of some rows, by whomever.

    Args:
        rows: What is looked at.
        episodes: How many of each.

    Returns:
        One entry a row.
    """
    return [results().get(row.key, episodes) for row in rows]
