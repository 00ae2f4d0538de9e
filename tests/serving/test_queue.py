"""Whose turn it is, with stand-ins for work."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import psutil
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core.errors import WorkError
from sarl_core.serving.limits import VARIABLE, ServerLimits
from sarl_dashboard import session
from sarl_dashboard.jobs import queue as module
from sarl_dashboard.jobs.queue import MOST_WAITING, JobKind, JobQueue

STUDIES = JobKind("studies", 2)


@pytest.fixture(autouse=True)
def limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, ServerLimits(jobs=3, jobs_each=2).to_text())


def work(visitor: str, kind: JobKind | None = None, **more: Any) -> Any:
    usual = {"key": object(), "author": visitor, "page": "Measure", "address": "", "share": 0.0}
    state = {"cancelled": False, "error": None, "began": time.monotonic()}
    return SimpleNamespace(visitor=visitor, kind=kind, **(usual | state | more))


def begun(queue: JobQueue, *jobs: Any) -> list[str]:
    said = []
    for job in jobs:
        queue.enter(job)
        said.append(queue.obstacle(job))
    return said


def test_who_is_at_a_limit_of_ones_own_is_told_which_and_when_there_is_room() -> None:
    queue = JobQueue()
    half = {"share": 0.5}
    assert begun(queue, work("Ada", **half), work("Ada", page="Improve")) == ["", ""]
    queue.running[0].began -= 300
    (said,) = begun(queue, work("Ada"))
    assert said == (
        "Waiting: you run 2 jobs (Measure, Improve), as many as one visitor may; the next has "
        "about 5 minutes left"
    )
    assert begun(queue, work("Bob")) == [""]  # whom that does not keep back


def test_who_is_at_the_limit_of_all_is_told_ones_place_and_by_whom() -> None:
    queue = JobQueue()
    begun(queue, work("Ada"), work("Ada"), work("Bob"))
    *_, said = begun(queue, work("Cy"), work("Bob"), work("Dot"))
    assert "1 job before this one; 3 jobs go on (2 of Ada, 1 of Bob), as many as" in said


def test_of_a_server_that_takes_one_job_one_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, ServerLimits(jobs=1, jobs_each=1).to_text())
    *_, said = begun(JobQueue(), work("Ada"), work("Bob"))
    assert said == "Waiting: 1 job goes on (1 of Ada), as many as this server takes"


def test_visitors_of_one_author_are_others_to_each_other() -> None:
    queue = JobQueue()
    begun(queue, work("one", author="Ada"), work("one", author="Ada"), work("two", author="Ada"))
    (said,) = begun(queue, work("two", author="Ada"))
    assert "(2 of others, 1 of yours)" in said


@pytest.mark.parametrize(
    ("author", "shown"),
    [
        ("Ada <ada@example.org>", "Ada"),
        ("Ada Lovelace (account 3f9a1c20b7d4)", "Ada Lovelace"),
        ("ada@example.org", "others"),
        ("ada@home <ada@example.org>", "others"),
        ("ada at example.org (account 3f9a1c20b7d4)", "others"),
    ],
)
def test_who_waits_is_not_told_addresses_of_others(author: str, shown: str) -> None:
    queue = JobQueue()
    begun(queue, work("one", author=author), work("Bob"), work("Cy"))
    (said,) = begun(queue, work("Dot"))
    assert f"3 jobs go on (1 of {shown}, 1 of Bob, 1 of Cy), as many" in said


def test_who_runs_less_comes_first() -> None:
    queue = JobQueue()
    running = [work("Ada"), work("Bob"), work("Cy")]
    begun(queue, *running)
    early, late = work("Ada"), work("Dot")
    begun(queue, early, late)
    queue.leave(running[1])
    assert queue.obstacle(early).startswith("Waiting: 1 job before this one")
    assert queue.obstacle(late) == ""


def test_of_what_takes_the_machine_one_visitor_does_one_and_all_do_two() -> None:
    queue = JobQueue()
    assert begun(queue, work("Ada", STUDIES), work("Bob", STUDIES)) == ["", ""]
    own, other, same = work("Ada", STUDIES), work("Cy", STUDIES), work("Dot", STUDIES)
    same.key = queue.running[0].key
    said = begun(queue, own, other, same)
    assert "you run one on Measure already" in said[0]
    assert "2 studies go on (1 of Ada, 1 of Bob)" in said[1]
    assert said[2] == ""  # who waits for the same study takes no more of the machine
    queue.leave(queue.running[1])
    assert queue.obstacle(other) == ""


def test_nothing_begins_while_memory_is_short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, ServerLimits(memory_gib=1.0).to_text())
    monkeypatch.setattr(module, "memory_used", lambda: 2 * 2**30)
    queue = JobQueue()
    (said,) = begun(queue, work("Ada"))
    assert "uses 2.0 of the 1 GiB that it may (by pages); this begins when it is less" in said
    monkeypatch.setattr(module, "memory_used", lambda: 2**29)
    assert queue.obstacle(queue.waiting[0]) == ""


def test_nobody_waits_for_the_lock_while_memory_is_looked_at(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(VARIABLE, ServerLimits(memory_gib=1.0).to_text())
    queue = JobQueue()
    locked: list[bool] = []

    def looked_at() -> int:
        locked.append(queue._lock.locked())
        return 0

    monkeypatch.setattr(module, "memory_used", looked_at)
    assert begun(queue, work("Ada")) == [""]
    assert locked == [False]


def test_what_processes_share_counts_once_and_not_at_every_look(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks = []

    def looked_at() -> Any:
        looks.append(True)
        process = SimpleNamespace(
            memory_full_info=lambda: SimpleNamespace(pss=5),
            memory_info=lambda: SimpleNamespace(rss=9),
            children=lambda recursive: [gone, hidden],
        )

        def fails(error: type[psutil.Error]) -> Any:
            raise error(1)

        gone = SimpleNamespace(memory_full_info=lambda: fails(psutil.NoSuchProcess))
        hidden = SimpleNamespace(
            memory_full_info=lambda: fails(psutil.AccessDenied),
            memory_info=lambda: SimpleNamespace(rss=100),
        )
        return process

    monkeypatch.setattr(session, "_measured", None)
    monkeypatch.setattr(session.psutil, "Process", looked_at)
    monkeypatch.setattr(session.psutil, "LINUX", True)
    assert session.memory_used() == session.memory_used() == 105
    assert len(looks) == 1


def test_nobody_lets_any_number_wait() -> None:
    queue = JobQueue()
    begun(queue, *(work("Ada") for _ in range(2 + MOST_WAITING)))  # two of them have begun
    with pytest.raises(WorkError, match="waiting for their turn"):
        queue.enter(work("Ada"))
    queue.enter(work("Bob"))


def test_what_has_ended_is_remembered_and_what_was_called_off_is_not() -> None:
    queue = JobQueue()
    failed, gone = work("Ada", error=WorkError("it failed")), work("Ada", cancelled=True)
    begun(queue, failed, gone)
    queue.leave(failed)
    queue.leave(gone)
    assert [(one.author, one.error) for one in queue.ended] == [("Ada", "it failed")]
    assert not queue.running


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.sampled_from("abcd"), st.booleans(), st.booleans()), max_size=30))
def test_limits_hold_and_all_get_their_turn(events: list[tuple[str, bool, bool]]) -> None:
    queue, jobs = JobQueue(), []
    for visitor, study, ends in events:
        job = work(visitor, STUDIES if study else None)
        jobs.append(job)
        queue.enter(job)
        for waiting in queue.waiting:
            queue.obstacle(waiting)
        running = queue.running
        assert len(running) <= 3
        for name in "abcd":
            mine = [one for one in running if one.visitor == name]
            assert len(mine) <= 2
            assert sum(one.kind is STUDIES for one in mine) <= 1
        assert sum(one.kind is STUDIES for one in running) <= 2
        if ends and running:
            queue.leave(running[0])
    for _ in jobs:
        for running_job in queue.running:
            queue.leave(running_job)
        for waiting in queue.waiting:
            queue.obstacle(waiting)
    assert not queue.waiting
