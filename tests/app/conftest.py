"""What tests of several pages share."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from threading import Thread, current_thread
from typing import Any

import pytest
from streamlit.components.v2 import manifest_scanner
from streamlit.testing.v1 import app_test

from sarl_core.rendering import gif_and_mp4
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.state import library as state
from tests.app.mined_file import MinedFiles, mined_files
from tests.app.screens import ROUTER


@pytest.fixture(scope="session", autouse=True)
def one_server() -> Iterator[None]:
    """What a server does once, Streamlit's tests do at each visit, and more slowly than the rest.

    It reads what is said of all installed packages, for components, and compiles the pages. The
    pages' folder stays on the import path (as app.py has it): an import in another thread finds
    nothing in the moment in which it is taken away.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [*sys.path, str(ROUTER.parent)])
        scan = cache(manifest_scanner.scan_component_manifests)
        patch.setattr(manifest_scanner, "scan_component_manifests", scan)
        patch.setattr(app_test, "ScriptCache", cache(app_test.ScriptCache))
        yield


@pytest.fixture(autouse=True)
def not_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trees without each fold are not grown beside every page that a test opens."""
    monkeypatch.setattr(cross_fitting, "DRAWING", 3_600.0)


@pytest.fixture
def elsewhere(not_elsewhere: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Trees without each fold are grown as soon as a page is open."""
    monkeypatch.setattr(cross_fitting, "DRAWING", 0.0)


@pytest.fixture(autouse=True)
def thin_films(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a film every twentieth picture is encoded: as long as all of them takes nothing else."""
    schedule = gif_and_mp4.schedule
    monkeypatch.setattr(gif_and_mp4, "schedule", lambda *film: schedule(*film)[::20])


@pytest.fixture(autouse=True)
def own_main() -> Iterator[None]:
    """A page that ran passes for the program, and processes that start later would run it."""
    main = sys.modules["__main__"]
    yield
    sys.modules["__main__"] = main


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


@pytest.fixture(scope="session")
def mined(tmp_path_factory: pytest.TempPathFactory) -> MinedFiles:
    """What a cluster leaves of steps that are not here."""
    return mined_files(tmp_path_factory.mktemp("mined"))
