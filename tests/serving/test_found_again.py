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
