"""Learning in a browser: live curves, and work that goes on when its page is closed."""

from __future__ import annotations

import os
import time
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.browser.walking import PATIENCE, no_trace, visit

# No other study has as many steps, so that its process is known by them.
STEPS = 300_000 + os.getpid() % 100_000


def at_work() -> list[int]:
    """The processes that learn for so many steps; one that is dead and not buried counts too."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().split(b"\0")
        except OSError:  # gone meanwhile
            continue
        if b"--stop-with-input" in words and str(STEPS).encode() in words:
            found.append(int(path.parent.name))
    return found


def wait_until(wanted: int) -> None:
    for _ in range(1200):
        if len(at_work()) == wanted:
            return
        time.sleep(0.1)
    raise AssertionError(at_work())


def test_curves_grow_while_agents_learn_and_what_goes_on_stands_on_library(
    screen: Page,
) -> None:
    visit(screen, f"/learning?data=cartpole&learn_view=Your+own&learn_steps={STEPS}", "Learning")
    screen.get_by_role("button", name="Start").click()
    # Not the Stop that Streamlit shows in its header while a page runs.
    stop = screen.get_by_test_id("stMain").get_by_role("button", name="Stop", exact=True)
    expect(stop).to_be_visible()
    wait_until(1)
    expect(screen.locator(".js-plotly-plot").first).to_be_visible(timeout=2 * PATIENCE)
    expect(screen.get_by_text("No shield, learner 1:").first).to_be_visible()
    no_trace(screen)
    # Other pages answer meanwhile, and the work goes on.
    screen.get_by_role("link", name="Paper", exact=True).click()
    expect(screen.get_by_role("heading", name="Paper", level=1)).to_be_visible()
    assert len(at_work()) == 1
    screen.get_by_role("link", name="Learning", exact=True).click()
    expect(stop).to_be_visible()
    other = screen.context.new_page()
    screen.close()  # without a word
    visit(other, "/library", "Library")
    work = other.get_by_test_id("stMain")
    expect(work.get_by_text("No shield, learner 1:").first).to_be_visible()
    assert len(at_work()) == 1
    with other.context.expect_page() as opened:
        work.get_by_role("link", name="Open", exact=True).first.click()
    again = opened.value.get_by_test_id("stMain")
    expect(again.get_by_role("button", name="Stop", exact=True)).to_be_visible(timeout=PATIENCE)
    no_trace(opened.value)
    work.get_by_role("button", name="Cancel", exact=True).first.click()
    wait_until(0)
    no_trace(other)
