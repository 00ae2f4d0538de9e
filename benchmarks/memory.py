"""What a million steps take of memory in the dashboard, in all of its processes, beyond idling.

Idle is a dashboard whose libraries are loaded: the pages Demonstrations and Thresholds were looked
at with the shipped set. Pages that processes share are counted once.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from threading import Event, Thread

import psutil
from playwright.sync_api import Page

from benchmarks.chromium import opened, settle
from benchmarks.large import FEATURES, pairs
from benchmarks.measure import Row, duration
from sarl_core import save_demonstrations

ROWS = 1_000_000
DATA = ROWS * (FEATURES * 4 + 3 * 8)  # bytes: states, and an action, an episode and a step each
REACH = 3.0
ELSEWHERE_REACH = 6.0  # of what is made when it is asked for, and which no other page needs
THRESHOLDS = "support=0.001&confidence=0.8"  # a few rules, of an expert that is often undecided
_PERIOD = 0.05  # seconds between two looks
_QUIET = 10.0  # seconds without a change
_SAME = 2_000_000  # bytes
_PATIENCE = 600_000  # milliseconds
_ELSEWHERE = "what rules are worth in other episodes"


@dataclass
class Peak:
    """The most memory that a process and those it started had, while one looked.

    Attributes:
        total: Bytes of all at once.
        parts: Of the processes at that moment, the first one's first.
        last: Bytes at the last look.
        seconds: For how long one looked.
    """

    total: int = 0
    parts: list[int] = field(default_factory=list)
    last: int = 0
    seconds: float = 0.0

    def look(self, process: psutil.Process) -> None:
        """Look once."""
        parts = []
        with suppress(psutil.NoSuchProcess):
            parts = [_own_share(one.pid) for one in (process, *process.children(recursive=True))]
        self.last = sum(parts)
        if self.last > self.total:
            self.total, self.parts = self.last, parts


@contextmanager
def watched(process: psutil.Process) -> Iterator[Peak]:
    """Look again and again, until the work within is done."""
    peak, done, begun = Peak(), Event(), time.monotonic()

    def look() -> None:
        while not done.wait(_PERIOD):
            peak.look(process)

    thread = Thread(target=look)
    thread.start()
    try:
        yield peak
    finally:
        done.set()
        thread.join()
        peak.look(process)
        peak.seconds = time.monotonic() - begun


def whole_way(quick: bool) -> Iterable[Row]:
    """A million steps uploaded, mined and looked at, page after page."""
    with opened() as (page, address, folder):
        page.set_default_timeout(_PATIENCE)
        file = folder / "million.parquet"
        save_demonstrations(pairs(ROWS, seed=0), file)
        server = _server_in(folder)
        for path in ("thresholds", "demonstrations"):
            page.goto(f"{address}/{path}?{THRESHOLDS}")
            settle(page)
        idle = _settled(server)
        steps: list[tuple[str, Callable[[], None]]] = [
            ("upload", partial(_upload, page, file)),
            ("tree and Thresholds", partial(_open, page, "Thresholds", "stMetricValue")),
        ]
        titles = () if quick else ("Rules", "Evidence", "Export", "Episodes", "Report")
        steps += [(title, partial(_open, page, title, "stHeading")) for title in titles]
        if not quick:
            steps.append(("the report is made", partial(_report, page)))
            steps.append((_ELSEWHERE, partial(_worth, page)))
        for what, step in steps:
            with watched(server) as peak:
                step()
                settle(page)
            processes = " + ".join(f"{part / 1e6:,.0f}" for part in peak.parts)
            yield Row(
                f"memory beyond idling, {ROWS:,} x {FEATURES}, {what}",
                f"the data, {DATA / 1e6:,.0f} MB",
                "share",
                (peak.total - idle.total) / DATA,
                ELSEWHERE_REACH if what == _ELSEWHERE else REACH,
                f"{(peak.total - idle.total) / 1e6:,.0f} MB at most ({processes} less "
                f"{idle.total / 1e6:,.0f}), {(peak.last - idle.total) / 1e6:,.0f} MB after it; "
                f"{duration(peak.seconds)}",
            )


def _settled(process: psutil.Process) -> Peak:
    """What is there as soon as that is the same for a while: processes start beside the page."""
    while True:
        before, now = Peak(), Peak()
        before.look(process)
        time.sleep(_QUIET)
        now.look(process)
        if abs(now.total - before.total) < _SAME:
            return now


def _upload(page: Page, file: Path) -> None:
    page.get_by_text("Use your own demonstrations").first.click()
    page.locator("input[type=file]").set_input_files(file)
    page.get_by_test_id("stMetricValue").filter(has_text=f"{ROWS:,}").first.wait_for()


def _open(page: Page, title: str, sign: str) -> None:
    """Open a page of the menu, and wait until it has what it shows."""
    page.get_by_role("link", name=title, exact=True).first.click()
    page.get_by_role("heading", name=title).first.wait_for()
    page.get_by_test_id(sign).first.wait_for()
    page.get_by_role("button", name="Cancel").wait_for(state="detached")


def _report(page: Page) -> None:
    page.get_by_role("button", name="Make the report").click()
    page.get_by_role("button", name="Download the report").wait_for()


def _worth(page: Page) -> None:
    _open(page, "Evidence", "stHeading")
    page.get_by_role("button", name="Find out what they are worth in other episodes").click()
    page.get_by_text("mined without it, they are right in").first.wait_for()


def _server_in(folder: Path) -> psutil.Process:
    """The dashboard that has a folder for its home."""
    for process in psutil.Process().children():
        with suppress(psutil.Error):
            if process.environ().get("HOME") == os.fspath(folder):
                return process
    raise RuntimeError("the dashboard has ended")


def _own_share(pid: int) -> int:
    """Bytes of a process, of what it shares with others its share (Linux)."""
    with suppress(OSError):  # ended meanwhile
        rollup = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
        return 1024 * int(rollup.split("\nPss:")[1].split()[0])
    return 0
