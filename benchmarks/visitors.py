"""What colleagues wait for who use one server at a time, and what is left when they have gone."""

from __future__ import annotations

import re
import statistics
import tempfile
import time
import urllib.request
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

from benchmarks.chromium import ARGUMENTS, CHROMIUM, PATIENCE, WATCH, dashboard, settle
from benchmarks.data import demonstrations
from benchmarks.measure import Row, duration
from sarl_core import save_demonstrations

VISITORS = 20
EACH = 4.0  # seconds between two moves of one visitor
UPLOADS = 50
GONE = 30.0  # seconds after which nobody comes back, and what was made for them is let go of
_WATCHED = ["[data-testid=stMetricValue]", "[class*=st-key-box_]"]
_SEEN = ["--disable-renderer-backgrounding", "--disable-backgrounding-occluded-windows"]


def sliders(quick: bool) -> Iterable[Row]:
    """Moves of twenty visitors, each with a page of its own, while rules are improved."""
    moves = 4 if quick else 10
    with _server() as (address, browser, log):
        worker = _page(browser, f"{address}/improve?data=cartpole&rounds=200&max_rules=5")
        worker.get_by_test_id("stMain").get_by_role("button", name="Run", exact=True).click()
        worker.get_by_text("Round 1 of 200").first.wait_for()
        pages = [_page(browser, f"{address}/thresholds") for _ in range(VISITORS)]
        for page in pages:
            settle(page)
            page.get_by_role("slider", name="Minimum support").focus()
        times: list[float] = []
        for move in range(moves + 1):
            for page in pages:
                begun = time.perf_counter()
                if move:
                    times += _answer(page)
                page.evaluate(
                    "watched => { window.waiting = window.released(watched, 8000); }", _WATCHED
                )
                page.keyboard.press("ArrowLeft" if move % 10 < 5 else "ArrowRight")
                time.sleep(max(EACH / VISITORS - (time.perf_counter() - begun), 0.0))
        at_work = _metric(address, "sarl_jobs_running")
        errors = sum(page.get_by_test_id("stException").count() for page in pages)
        fine = at_work == 1 and not errors and "Traceback" not in log.read_text()
    if len(times) < moves * VISITORS // 2:
        raise RuntimeError(f"only {len(times)} of {moves * VISITORS} moves changed the figures")
    times.sort()
    yield Row(
        f"slider to changed figures, {VISITORS} visitors while one job runs, slowest 5 % left out",
        "-",
        "seconds",
        times[int(0.95 * (len(times) - 1))],
        1.0,
        f"{len(times)} moves that changed figures, one of each visitor every {EACH:g} s; median "
        f"{duration(statistics.median(times))}, longest {duration(times[-1])}; all browsers on "
        f"the same machine; {errors} errors",
        fine,
    )


def uploads(quick: bool) -> Iterable[Row]:
    """Memory of the server after many uploads, each by another visitor who then goes."""
    with tempfile.TemporaryDirectory() as name, _server() as (address, browser, _):
        file = Path(name) / "upload.parquet"
        few = demonstrations()
        before, most = 0.0, 0.0
        count = 10 if quick else UPLOADS
        for turn in range(count + 1):
            # Other data each time: the same would be found again.
            save_demonstrations(replace(few, observations=few.observations + turn / 1000), file)
            page = _page(browser, f"{address}/demonstrations")
            page.get_by_text("Use your own demonstrations").first.click()
            page.locator("input[type=file]").set_input_files(file)
            page.get_by_text("Read 15,000 steps").first.wait_for()
            page.goto(f"{address}/thresholds")
            settle(page)
            page.context.close()
            if turn == 0:  # the first loads what stays
                time.sleep(GONE)
                before = _metric(address, "sarl_memory_bytes")
            most = max(most, _metric(address, "sarl_memory_bytes"))
        time.sleep(GONE)
        after = _metric(address, "sarl_memory_bytes")
    yield Row(
        f"memory after {count} uploads, their visitors gone",
        "after the first",
        "share",
        after / before,
        1.25,
        f"{after / 1e6:,.0f} MB, {before / 1e6:,.0f} MB after the first, {most / 1e6:,.0f} MB "
        "at most; with the server's processes",
    )


@contextmanager
def _server() -> Iterator[tuple[str, Browser, Path]]:
    """Address of a dashboard, a browser, and the dashboard's log."""
    with (
        tempfile.TemporaryDirectory() as name,
        dashboard(Path(name)) as address,
        sync_playwright() as playwright,
    ):
        arguments = [*ARGUMENTS, *_SEEN]
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=arguments)
        yield address, browser, Path(name) / "log.txt"
        browser.close()


def _page(browser: Browser, address: str) -> Page:
    """A visitor: a browser's profile, and a page in it."""
    page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
    page.set_default_timeout(2 * PATIENCE)
    page.add_init_script(WATCH)
    page.goto(address)
    page.get_by_role("heading", level=1).first.wait_for()
    return page


def _answer(page: Page) -> list[float]:
    """Seconds until the figures had followed the last move; none where it changed none."""
    answer, _ = page.evaluate("() => window.waiting")
    return [] if answer is None else [answer / 1000]


def _metric(address: str, name: str) -> float:
    with urllib.request.urlopen(f"{address}/metrics") as answer:
        text = answer.read().decode()
    return float(re.findall(rf"^{name} (\S+)$", text, re.MULTILINE)[0])
