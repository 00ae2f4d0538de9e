"""What tests of several pages share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from threading import Thread, current_thread
from typing import Any

import pytest

from sarl_dashboard.jobs.job import Job
from sarl_dashboard.state import library as state


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A library of each test's own, into which work that it began writes nothing later."""
    work: list[tuple[Job[Any], Thread]] = []
    run = Job._run

    def noted(job: Job[Any]) -> None:
        work.append((job, current_thread()))
        run(job)

    monkeypatch.setattr(Job, "_run", noted)
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "library"))
    monkeypatch.setenv("SARL_AUTHOR", "Ada")
    yield tmp_path / "library"
    for job, thread in work:
        job.cancel()
        thread.join()
    for opened in state._OPENED.values():
        opened.close()
    state._OPENED.clear()
