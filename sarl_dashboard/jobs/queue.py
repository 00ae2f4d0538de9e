"""Whose turn it is: long work of all visitors begins when there is room for it."""

from __future__ import annotations

import logging
import re
import time
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from threading import Lock
from typing import TYPE_CHECKING, Any

from sarl_core.errors import WorkError
from sarl_core.mining.language import counted
from sarl_core.serving.limits import ServerLimits
from sarl_dashboard.session import memory_used

if TYPE_CHECKING:
    from sarl_dashboard.jobs.job import Job

_LOGGER = logging.getLogger(__name__)
MOST_WAITING = 20  # of one visitor; each is a thread
_MOST_ENDED = 100  # that are remembered, of all visitors
_MARK = re.compile(r" (<[^<>]*>|\(account \w+\))$")  # behind a name, as `session.signed_in` has it
_ADDRESS = re.compile(r"@| at \S+\.")
_KNOWN_FROM = 0.03  # share of some work from which on the rest can be guessed


@dataclass(frozen=True)
class JobKind:
    """Work that takes so much of the machine that one visitor does one of it at a time.

    Attributes:
        noun: What several of it are called.
        most: That go on at once, of all visitors; None for no other limit than that of all work.
    """

    noun: str
    most: int | None = None


@dataclass(frozen=True)
class EndedJob:
    """Work that has come to its end.

    Attributes:
        visitor: Who began it, as `session.visitor` tells visitors apart.
        author: The same, by name.
        page: Title of the page where it was begun.
        address: Of that page, as it was then.
        ended: Seconds of `time.time`.
        error: Why it ended early; "" if it did not.
    """

    visitor: str
    author: str
    page: str
    address: str
    ended: float
    error: str


class JobQueue:
    """The long work of all visitors: what goes on, and what waits for its turn.

    Attributes:
        ended_in_all: How much has come to its end since the server began.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._waiting: list[Job[Any]] = []
        self._running: list[Job[Any]] = []
        self._ended: deque[EndedJob] = deque(maxlen=_MOST_ENDED)
        self.ended_in_all = 0

    @property
    def running(self) -> tuple[Job[Any], ...]:
        """What goes on."""
        with self._lock:
            return tuple(self._running)

    @property
    def waiting(self) -> tuple[Job[Any], ...]:
        """What waits, in the order in which it was begun."""
        with self._lock:
            return tuple(self._waiting)

    @property
    def ended(self) -> tuple[EndedJob, ...]:
        """What has come to its end, the latest first."""
        with self._lock:
            return tuple(reversed(self._ended))

    def enter(self, job: Job[Any]) -> None:
        """Let work wait for its turn.

        Raises:
            WorkError: If too much of the same visitor waits already.
        """
        with self._lock:
            if sum(other.visitor == job.visitor for other in self._waiting) >= MOST_WAITING:
                raise WorkError(
                    f"{MOST_WAITING} jobs of yours are waiting for their turn already; cancel one "
                    "on the page Library, or wait until one has begun"
                )
            self._waiting.append(job)

    def obstacle(self, job: Job[Any]) -> str:
        """Why work cannot begin yet; "" where it begins now.

        Args:
            job: That has entered.
        """
        limits = ServerLimits.of_process()
        shortage = memory_shortage()  # before the lock: to look takes its time
        with self._lock:
            said = _obstacle(job, self._waiting, self._running, limits, shortage)
            if not said:
                self._waiting.remove(job)
                self._running.append(job)
                job.began = time.monotonic()
                _LOGGER.info("job began", extra={"page": job.page, "author": job.author})
            return said

    def leave(self, job: Job[Any]) -> None:
        """Let work go, were it in the middle."""
        with self._lock:
            for jobs in (self._waiting, self._running):
                if job in jobs:
                    jobs.remove(job)
            self.ended_in_all += 1
            error = str(job.error) if job.error is not None else ""
            seconds = round(time.monotonic() - job.began, 1)
            said = {"page": job.page, "author": job.author, "seconds": seconds, "error": error}
            _LOGGER.info("job cancelled" if job.cancelled else "job ended", extra=said)
            if not job.cancelled:
                began = job.visitor, job.author, job.page, job.address
                self._ended.append(EndedJob(*began, time.time(), error))


@cache
def queue() -> JobQueue:
    """The queue of this server."""
    return JobQueue()


def memory_shortage() -> str:
    """Why nothing large can be read at present; "" where it can."""
    most = ServerLimits.of_process().memory_gib
    if most is None or (used := memory_used() / 2**30) < most:
        return ""
    return f"this server uses {used:.1f} of the {most:g} GiB that it may"


def _obstacle(
    job: Job[Any],
    waiting: Sequence[Job[Any]],
    running: Sequence[Job[Any]],
    limits: ServerLimits,
    shortage: str,
) -> str:
    """Why work cannot begin yet: which limit, who has reached it, and when there is room."""
    own = [other for other in running if other.visitor == job.visitor]
    if len(own) >= limits.jobs_each:
        return _sentence(
            f"you run {counted(len(own), 'job')} ({_pages(own)}), as many as one visitor may",
            own,
        )
    if mine := _alike(job, running):
        return _sentence(f"you run one on {_pages(mine)} already, as many as one visitor may", mine)
    before = _before(job, waiting, running, limits)
    ahead = f"{counted(before, 'job')} before this one; " if before else ""
    if len(running) >= limits.jobs:
        go_on = "goes on" if len(running) == 1 else "go on"
        return _sentence(
            f"{ahead}{counted(len(running), 'job')} {go_on} ({_whose(running, job)}), as many as "
            "this server takes",
            running,
        )
    if job.kind is not None and _is_full(job, running):
        alike = [other for other in running if other.kind == job.kind]
        return _sentence(
            f"{ahead}{len(alike)} {job.kind.noun} go on ({_whose(alike, job)}), as many as this "
            "server takes",
            alike,
        )
    if shortage:
        whose = f"{counted(len(running), 'job')}: {_whose(running, job)}" if running else "by pages"
        return _sentence(f"{ahead}{shortage} ({whose}); this begins when it is less", running)
    return f"Waiting: {ahead[:-2]}" if before else ""


def _before(
    job: Job[Any],
    waiting: Sequence[Job[Any]],
    running: Sequence[Job[Any]],
    limits: ServerLimits,
) -> int:
    """How many come first: those of visitors who run less, and among equals those who came first.

    Work that waits for other work of the same visitor, or of the same kind, keeps nobody else back.
    """
    busy = Counter(other.visitor for other in running)
    full = _is_full(job, running)

    def competes(other: Job[Any]) -> bool:
        if busy[other.visitor] >= limits.jobs_each or _alike(other, running):
            return False
        if full:
            return other.kind == job.kind and _is_full(other, running)
        return not _is_full(other, running)

    line = [other for other in waiting if competes(other)]
    line.sort(key=lambda other: busy[other.visitor])  # stable
    return line.index(job)


def _alike(job: Job[Any], running: Sequence[Job[Any]]) -> list[Job[Any]]:
    """Work of the same visitor of which one goes on at a time."""
    if job.kind is None:
        return []
    return [one for one in running if (one.kind, one.visitor) == (job.kind, job.visitor)]


def _is_full(job: Job[Any], running: Sequence[Job[Any]]) -> bool:
    """Whether as much of some kind goes on as may; two who wait for the same are one."""
    if job.kind is None or job.kind.most is None:
        return False
    alike = {other.key for other in running if other.kind == job.kind}
    return job.key not in alike and len(alike) >= job.kind.most


def _sentence(said: str, running: Sequence[Job[Any]]) -> str:
    """With the time after which there is room, where that can be guessed."""
    rest = [left for other in running if (left := _seconds_left(other)) is not None]
    if not rest:
        return f"Waiting: {said}"
    minutes = min(rest) / 60
    when = f"about {counted(round(minutes), 'minute')}" if minutes >= 1.5 else "about a minute"
    return f"Waiting: {said}; the next has {when} left"


def _seconds_left(job: Job[Any]) -> float | None:
    if job.share < _KNOWN_FROM:
        return None
    return (time.monotonic() - job.began) * (1 / job.share - 1)


def _pages(jobs: Sequence[Job[Any]]) -> str:
    return ", ".join(dict.fromkeys(job.page for job in jobs if job.page))


def _whose(jobs: Sequence[Job[Any]], job: Job[Any]) -> str:
    """By whom, as "2 of yours, 1 of Bob"."""
    names = Counter(
        "yours"
        if other.visitor == job.visitor
        else "others"
        if other.author == job.author
        else _name_alone(other.author)
        for other in jobs
    )
    return ", ".join(f"{number} of {name}" for name, number in names.items())


def _name_alone(author: str) -> str:
    """What strangers are told of who somebody is: no address and no account."""
    name = _MARK.sub("", author)
    return "others" if _ADDRESS.search(name) else name
