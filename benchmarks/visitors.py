"""What colleagues wait for who use one server at a time, and what is left when they have gone."""

from __future__ import annotations

import re
import statistics
import time
import urllib.request
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from threading import Event

from playwright.sync_api import Browser, Page

from benchmarks.chromium import (
    PATIENCE,
    WATCH,
    Release,
    answers,
    served,
    settle,
)
from benchmarks.data import demonstrations
from benchmarks.measure import Row, duration
from benchmarks.visitor_client import VisitorClient
from sarl_core import save_demonstrations

VISITORS = 20
EACH = 4.0  # seconds between two moves of one visitor
UPLOADS = 50
GONE = 30.0  # seconds after which nobody comes back, and what was made for them is let go of
PAGE, QUERY, SLIDER = "thresholds", "data=cartpole", "Minimum support"
LONG = "/improve?data=cartpole&rounds=200&max_rules=5"
_WATCHED = ["[data-testid=stMetricValue]", "[class*=st-key-box_]"]


def sliders(quick: bool) -> Iterable[Row]:
    """Moves of twenty visitors while rules are improved: one in a browser, the others without."""
    with served() as (browser, address, folder), ExitStack() as opened:
        worker = opened_page(browser, address)
        begin_work(worker, address + LONG)
        worker.context.close()
        page = opened_page(browser, f"{address}/{PAGE}?{QUERY}")
        clients = [
            opened.enter_context(VisitorClient(address, PAGE, QUERY, SLIDER))
            for _ in range(VISITORS - 1)
        ]
        in_browser, others = moved(page, clients, 20 if quick else 60)
        at_work = metric(address, "sarl_jobs_running")
        errors = sum(client.errors for client in clients)
        errors += page.get_by_test_id("stException").count()
        fine = at_work == 1 and not errors and "Traceback" not in (folder / "log.txt").read_text()
    yield from move_rows(in_browser, others, errors, fine)


def begin_work(page: Page, address: str) -> None:
    """Work that takes long; its page is closed, and it goes on."""
    page.goto(address)
    page.get_by_test_id("stMain").get_by_role("button", name="Run", exact=True).wait_for()
    settle(page)
    page.get_by_test_id("stMain").get_by_role("button", name="Run", exact=True).click()
    page.get_by_text(re.compile(r"Round \d+ of 200")).first.wait_for()
    page.close()


def moved(
    page: Page, clients: Sequence[VisitorClient], moves: int
) -> tuple[list[float], list[float]]:
    """Seconds that moves took: of the page in a browser, and of those without, beside it."""
    ended = Event()
    with ThreadPoolExecutor(len(clients)) as threads:
        at_others = [
            threads.submit(_moves, client, place, ended) for place, client in enumerate(clients)
        ]
        try:
            in_browser = answers(page, _aim, _WATCHED, moves)
        finally:
            ended.set()
    times = sorted(answer.answer for answer in in_browser)
    return times, sorted(took for one in at_others for took in one.result())


def move_rows(
    in_browser: Sequence[float], others: Sequence[float], errors: int, fine: bool
) -> Iterable[Row]:
    """What moves took, as rows of the table."""
    for what, seconds, who in (
        ("slider to changed figures", in_browser, "one of 20 visitors, in a browser"),
        ("slider to the server's answer", others, "the 19 others, each every 4 s"),
    ):
        yield Row(
            f"{what}, 20 visitors while one job runs, 95 of 100 moves",
            "-",
            "seconds",
            seconds[int(0.95 * (len(seconds) - 1))],
            1.0,
            f"{len(seconds)} moves of {who}; median {duration(statistics.median(seconds))}, "
            f"longest {duration(seconds[-1])}; {errors} errors",
            fine,
        )


def _moves(client: VisitorClient, place: int, ended: Event) -> list[float]:
    """Seconds that each move took; visitors do not move all at once."""
    ended.wait(EACH * place / VISITORS)
    times, step = list[float](), 0
    while not ended.is_set():
        step += 1
        times.append(client.move(step % 5))
        ended.wait(max(EACH - times[-1], 0.0))
    return times[1:]  # the first finds a server that has just woken up


def _aim(page: Page, move: int) -> Release:
    page.get_by_role("slider", name=SLIDER).focus()
    key = "ArrowLeft" if move % 20 < 10 else "ArrowRight"
    return lambda: page.keyboard.press(key)


def uploads(quick: bool) -> Iterable[Row]:
    """Memory of the server after many uploads, each by another visitor who then goes."""
    with served() as (browser, address, folder):
        file = folder / "upload.parquet"
        few = demonstrations()
        before, most = 0.0, 0.0
        count = 10 if quick else UPLOADS
        for turn in range(count + 1):
            # Other data each time: the same would be found again.
            save_demonstrations(replace(few, observations=few.observations + turn / 1000), file)
            page = opened_page(browser, f"{address}/demonstrations")
            page.get_by_text("Use your own demonstrations").first.click()
            page.locator("input[type=file]").set_input_files(file)
            page.get_by_text("Read 15,000 steps").first.wait_for()
            page.goto(f"{address}/thresholds")
            settle(page)
            page.context.close()
            if turn == 0:  # the first loads what stays
                time.sleep(GONE)
                before = metric(address, "sarl_memory_bytes")
            most = max(most, metric(address, "sarl_memory_bytes"))
        time.sleep(GONE)
        after = metric(address, "sarl_memory_bytes")
        fine = "Traceback" not in (folder / "log.txt").read_text()
    yield Row(
        f"memory after {count} uploads, their visitors gone",
        "after the first",
        "share",
        after / before,
        1.25,
        f"{after / 1e6:,.0f} MB, {before / 1e6:,.0f} MB after the first, {most / 1e6:,.0f} MB "
        "at most; with the server's processes",
        fine,
    )


def opened_page(browser: Browser, address: str) -> Page:
    """A visitor: a browser's profile, and a page in it."""
    page = browser.new_context(viewport={"width": 1440, "height": 900}).new_page()
    page.set_default_timeout(2 * PATIENCE)
    page.add_init_script(WATCH)
    page.goto(address)
    page.get_by_role("heading", level=1).first.wait_for()
    return page


def metric(address: str, name: str) -> float:
    """A number that the dashboard tells whoever watches it."""
    with urllib.request.urlopen(f"{address}/metrics") as answer:
        text = answer.read().decode()
    return float(re.findall(rf"^{name} (\S+)$", text, re.MULTILINE)[0])
