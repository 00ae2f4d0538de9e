"""A running dashboard and a browser to look at it with."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from sarl_core.serving.limits import VARIABLE, ServerLimits
from tests.browser.walking import RUNS

ROOT = Path(__file__).parents[2]
CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
PATIENCE = 60_000  # milliseconds; long, because nothing here measures time
expect.set_options(timeout=PATIENCE)


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Where a dashboard runs, started as a user would start it."""
    with dashboard(tmp_path_factory.mktemp("server")) as url:
        yield url


@contextmanager
def dashboard(folder: Path, **variables: str) -> Iterator[str]:
    """A dashboard of its own.

    Args:
        folder: For its log, and what it takes for the user's home.
        variables: Of its environment.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    log = folder / "log.txt"
    # A library of its own: what other tests of this process keep would be there again.
    own = {"HOME": str(folder), "SARL_LIBRARY": str(folder / "library")}
    # And each test a visitor of its own, whom the work that another test left does not keep back.
    own[VARIABLE] = ServerLimits().to_text()
    with log.open("wb") as out:
        server = subprocess.Popen(
            [sys.executable, "-m", "streamlit", "run", "app.py", "--server.port", str(port)],
            cwd=ROOT,
            stdout=out,
            stderr=subprocess.STDOUT,
            env=os.environ | own | variables,
        )
        try:
            url = f"http://127.0.0.1:{port}"
            _wait(url, server, log)
            yield url
        finally:
            server.terminate()
            server.wait(30)
    text = log.read_text()
    assert "Traceback" not in text, text


def _wait(url: str, server: subprocess.Popen[bytes], log: Path) -> None:
    for _ in range(600):
        assert server.poll() is None, log.read_text()
        try:
            with urllib.request.urlopen(f"{url}/_stcore/health") as answer:
                if answer.read() == b"ok":
                    return
        except (urllib.error.URLError, ConnectionError):
            pass
        time.sleep(0.1)
    raise AssertionError(log.read_text())


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """A browser without a screen."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def windows(chromium: Browser, address: str) -> Iterator[BrowserContext]:
    """Where windows are opened: what they all load, as Streamlit's scripts, is loaded once."""
    context = chromium.new_context(
        base_url=address, viewport={"width": 1440, "height": 900}, accept_downloads=True
    )
    context.add_init_script(RUNS)
    yield context
    context.close()


@pytest.fixture
def screen(windows: BrowserContext) -> Iterator[Page]:
    """A window of its own for each test; addresses are relative to the dashboard."""
    page = windows.new_page()
    page.set_default_timeout(PATIENCE)
    yield page
    for window in windows.pages:
        window.close()
    windows.clear_cookies()  # whoever comes next is another visitor
    windows.set_offline(False)
