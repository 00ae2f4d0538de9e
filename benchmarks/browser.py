"""What an analyst waits for: a moved slider, until the figures on screen have followed."""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, sync_playwright

from benchmarks.chromium import ARGUMENTS, CHROMIUM, PATIENCE, dashboard, opened
from benchmarks.data import demonstrations
from benchmarks.measure import Row, duration
from sarl_core import Demonstrations, save_demonstrations

MANY = 1_000_000

# From the key to the frame in which the four numbers and the ring in both maps are new.
WATCH = """
() => {
  const numbers = () => [...document.querySelectorAll('[data-testid=stMetricValue]')]
    .map(one => one.innerText).join('|');
  const rings = () => [...document.querySelectorAll('[class*=st-key-box_]')]
    .map(one => { const ring = getComputedStyle(one, '::after');
                  return ring.left + ' ' + ring.top; }).join('|');
  window.followed = () => new Promise(done => {
    const before = [numbers(), rings()];
    window.addEventListener('keydown', () => {
      const start = performance.now();
      const look = () => {
        const now = [numbers(), rings()];
        if (now[0] !== before[0] && now[0].split('|').length === 4 && now[1] !== before[1])
          requestAnimationFrame(() => done(performance.now() - start));
        else if (performance.now() - start > 5000) done(null);
        else requestAnimationFrame(look);
      };
      requestAnimationFrame(look);
    }, {once: true, capture: true});
  });
}
"""

# When the four numbers stood on screen. Whoever asks from outside looks twice a second only.
FIRST_NUMBERS = """
window.numbers = new Promise(done => {
  const watch = new MutationObserver(() => {
    const four = [...document.querySelectorAll('[data-testid=stMetricValue]')];
    if (four.length < 4 || four.some(one => one.innerText === '')) return;
    watch.disconnect();
    requestAnimationFrame(() => setTimeout(() => done(Date.now() / 1000)));
  });
  watch.observe(document, {subtree: true, childList: true, characterData: true});
});
"""


def slider(quick: bool) -> Iterable[Row]:
    """Moves of the slider of support, at the shipped size and at a million steps."""
    moves = 20 if quick else 40
    with opened() as (page, address, folder):
        file = folder / "million.parquet"
        save_demonstrations(_many(demonstrations(), MANY), file)
        page.goto(f"{address}/thresholds")
        yield _row(page, f"{len(demonstrations()):,} steps", moves, 0.15)
        page.goto(f"{address}/demonstrations")
        page.get_by_text("Use your own demonstrations").first.click()
        page.locator("input[type=file]").set_input_files(file)
        page.get_by_text(f"{MANY:,} steps").first.wait_for()
        page.get_by_role("link", name="Thresholds").first.click()
        yield _row(page, f"{MANY:,} steps", moves, 0.3)


def cold_start(quick: bool) -> Iterable[Row]:
    """From starting the dashboard's process to the first numbers on Thresholds."""
    times = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        for _ in range(2 if quick else 5):
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            page.set_default_timeout(PATIENCE)
            page.add_init_script(FIRST_NUMBERS)
            with tempfile.TemporaryDirectory() as name:
                started = time.time()
                with dashboard(Path(name)) as address:
                    page.goto(f"{address}/thresholds")
                    times.append(page.evaluate("() => window.numbers") - started)
            page.close()
    yield Row(
        "cold start to the first numbers on Thresholds",
        "-",
        "seconds",
        statistics.median(times),
        4.0,
        f"median of {len(times)} starts, {duration(min(times))} to {duration(max(times))}",
    )


def _row(page: Page, size: str, moves: int, reach: float) -> Row:
    times = _follow(page, moves)
    return Row(
        f"slider to changed figures, {size}",
        "-",
        "seconds",
        statistics.median(times),
        reach,
        f"median of {len(times)} moves, {duration(min(times))} to {duration(max(times))}",
    )


def _follow(page: Page, moves: int) -> list[float]:
    """Seconds from each key to the changed figures."""
    page.locator(".st-key-maps .js-plotly-plot .heatmaplayer image").nth(1).wait_for()
    page.wait_for_timeout(3000)
    page.evaluate(WATCH)
    page.get_by_role("slider", name="Minimum support").focus()
    times = []
    for move in range(moves + 2):
        page.evaluate("() => { window.waiting = window.followed(); }")
        page.keyboard.press("ArrowLeft" if move % 20 < 10 else "ArrowRight")
        took = page.evaluate("() => window.waiting")
        # A step may change no rule; and the first moves find a server that has just woken up.
        if took is not None and move >= 2:
            times.append(took / 1000)
        page.wait_for_timeout(300)
    if len(times) < moves // 2:
        raise RuntimeError(f"only {len(times)} of {moves} moves changed the figures")
    return times


def _many(few: Demonstrations, steps: int) -> Demonstrations:
    """The same demonstrations over and over, each time with a little noise of its own."""
    times = -(-steps // len(few))
    rng = np.random.default_rng(0)
    noise = 0.01 * few.observations.std(axis=0)
    return replace(
        few,
        observations=np.concatenate(
            [
                few.observations + rng.normal(0, noise, few.observations.shape).astype(np.float32)
                for _ in range(times)
            ]
        )[:steps],
        actions=np.concatenate([few.actions] * times)[:steps],
        episodes=np.concatenate(
            [few.episodes + turn * (int(few.episodes.max()) + 1) for turn in range(times)]
        )[:steps],
        steps=None,
        rewards=None,
        terminated=None,
        truncated=None,
    )
