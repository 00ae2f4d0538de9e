"""Work that was begun and left, and the page that looks for its own."""

from __future__ import annotations

from threading import Event
from typing import Any

import pytest

from sarl_dashboard.jobs import job as module
from sarl_dashboard.jobs.job import Job, Place


def test_a_page_finds_the_work_that_it_is_about_and_no_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    end, began = Event(), Event()

    def work(_: Job[Any]) -> None:
        began.set()
        end.wait(30)

    place = Place[Any]("found_again")
    begun: list[Job[Any]] = []
    try:
        for key in ("one", None):
            monkeypatch.setattr(module.st, "session_state", {})
            began.clear()
            begun.append(Job(key, work, 1, lasts=True))
            begun[-1].place = place.name
            assert began.wait(30)
        assert not place.find_again("another")
        # Many comparisons have this key: those of other settings, too.
        assert not place.find_again(None)
        assert place.job is None
        assert place.find_again("one")
        assert place.job is begun[0]
        assert begun[0].running
    finally:
        end.set()


def test_another_tab_that_begins_work_lets_that_of_the_first_go_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    end = Event()
    tabs: dict[str, dict[str, Any]] = {name: {} for name in ("closed", "first", "second")}
    place = Place[Any]("two_tabs")

    def open_tab(name: str) -> None:
        monkeypatch.setattr(module.st, "session_state", tabs[name])
        monkeypatch.setattr(module, "_this_session", lambda: name)

    def begin(key: str) -> Job[Any]:
        place.begin(lambda: Job(key, lambda _: end.wait(30), 1, lasts=True))
        assert place.job is not None
        return place.job

    monkeypatch.setattr(Job, "is_left", property(lambda job: job._session == "closed"))
    try:
        open_tab("closed")
        work = begin("long")
        for name in ("first", "second"):  # the first takes it up, the second only looks
            open_tab(name)
            assert place.find_again("long")
            assert place.job is work
            assert work.is_here == (name == "first")
        other = begin("other")
        assert work.running
        open_tab("first")
        another = begin("another")  # in its own place
        assert work.cancelled
        assert other.running
        assert another.running
    finally:
        end.set()
