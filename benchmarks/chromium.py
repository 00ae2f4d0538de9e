"""A dashboard as a user starts it, a browser to look at it with, and a watch to time it by."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from playwright.sync_api import Browser, Page, sync_playwright

ROOT = Path(__file__).resolve().parents[1]
CHROMIUM = "/usr/bin/chromium"
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
PATIENCE = 60_000  # milliseconds: a tree over a million states grows for a while
TABLES = "tables"  # stands for all tables among what is watched: they are drawn, not written
WARM = 2  # moves that do not count: the first find a server that has just woken up

# From the press of a key or of the pointer (where it makes a click, its release follows at once) to
# the frame in which what is watched has changed for the last time; how long that takes for the
# answer, and for all of the page. The browser itself tells what has changed, since reading the page
# in every frame would take longer than most answers; what is written again as it was counts too.
# Classes are left out: Streamlit marks all that a run may change with one as the run begins, takes
# it off at its end, and nothing looks different for it within these times.
# Tables are watched as they draw their text: what they tell screen readers follows a fifth of a
# second later.
WATCH = """
(() => {
  const seen = ['d', 'height', 'src', 'style', 'transform', 'value', 'width', 'x', 'y'];
  let drawn = 0;
  const write = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y, ...rest) {
    const cells = this.canvas.cells ??= new Map();
    const place = Math.round(x) + ' ' + Math.round(y);
    if (cells.get(place) !== text) { cells.set(place, text); drawn += 1; }
    return write.call(this, text, x, y, ...rest);
  };
  const within = (node, chosen) =>
    node.nodeType === 1 && (node.matches(chosen) || node.querySelector(chosen) !== null);
  window.released = (answer, most) => new Promise(done => {
    const tables = answer.includes('tables');
    const chosen = answer.filter(one => one !== 'tables').join(',') || 'nothing';
    let changed = [false, false], pending = [false, false];
    let before = 0, start = null, last = [null, null];
    const watch = new MutationObserver(records => {
      changed[1] = true;
      changed[0] ||= records.some(({target, addedNodes, removedNodes}) =>
        (target.nodeType === 1 ? target : target.parentElement)?.closest(chosen)
        || [...addedNodes, ...removedNodes].some(node => within(node, chosen)));
    });
    const look = () => {
      const now = performance.now() - start;
      if (drawn !== before) { changed = [changed[0] || tables, true]; before = drawn; }
      // What changed before a frame is on screen as the next one begins.
      last = last.map((then, which) => pending[which] ? now : then);
      [pending, changed] = [changed, [false, false]];
      const state = document.querySelector('[data-test-script-state]');
      const idle = state.getAttribute('data-test-script-state') === 'notRunning';
      const quiet = !pending[1] && now - (last[1] ?? 0) > 500;
      if (idle && quiet || now > most) { watch.disconnect(); done(last); }
      else requestAnimationFrame(look);
    };
    const begin = () => {
      window.removeEventListener('keydown', begin, true);
      window.removeEventListener('pointerdown', begin, true);
      start = performance.now();
      before = drawn;
      watch.observe(document.querySelector('[data-testid=stMainBlockContainer]'),
        {subtree: true, childList: true, characterData: true, attributeFilter: seen});
      requestAnimationFrame(look);
    };
    window.addEventListener('keydown', begin, true);
    window.addEventListener('pointerdown', begin, true);
  });
})()
"""


Release = Callable[[], None]
Aim = Callable[[Page, int], Release]


class Answer(NamedTuple):
    """What one press took, in seconds.

    Attributes:
        answer: Until what was watched was new.
        page: Until nothing on the page changed any more.
    """

    answer: float
    page: float


@contextlib.contextmanager
def served() -> Iterator[tuple[Browser, str, Path]]:
    """A browser, the address of a dashboard that was just started, and a folder for files."""
    with (
        tempfile.TemporaryDirectory() as name,
        dashboard(Path(name)) as address,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser, address, Path(name)
        browser.close()


@contextlib.contextmanager
def opened() -> Iterator[tuple[Page, str, Path]]:
    """A window, the address of a dashboard that was just started, and a folder for files."""
    with served() as (browser, address, folder):
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.set_default_timeout(PATIENCE)
        page.add_init_script(WATCH)
        yield page, address, folder


@contextlib.contextmanager
def dashboard(folder: Path) -> Iterator[str]:
    """A dashboard started as a user would start it."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with (folder / "log.txt").open("wb") as log:
        server = subprocess.Popen(
            [sys.executable, "-m", "streamlit", "run", "app.py", "--server.port", str(port)],
            cwd=ROOT,
            stdout=log,
            stderr=subprocess.STDOUT,
            env=os.environ | {"HOME": str(folder)},
        )
        try:
            address = f"http://127.0.0.1:{port}"
            for _ in range(300):
                with contextlib.suppress(urllib.error.URLError, ConnectionError):
                    urllib.request.urlopen(f"{address}/_stcore/health").close()
                    break
                time.sleep(0.1)
            yield address
        finally:
            server.terminate()
            server.wait(30)


def settle(page: Page) -> None:
    """Wait until the page's script has ended, and what it sent is drawn."""
    for _ in range(2):
        page.wait_for_timeout(400)
        page.wait_for_function(
            "() => document.querySelector('[data-test-script-state]')"
            "?.getAttribute('data-test-script-state') === 'notRunning'"
        )
    page.wait_for_timeout(800)


def answers(
    page: Page, aim: Aim, watched: Sequence[str], moves: int, *, warm: int = WARM
) -> list[Answer]:
    """Move a control again and again, and time what follows.

    Args:
        page: Ready for it.
        aim: Given the page and the number of the move, does all that comes before the release of
            the key or the pointer, and returns what releases it.
        watched: Selectors within the page, or `TABLES`; their change is the answer.
        moves: How often, beside those that do not count.
        warm: Moves that do not count.

    Returns:
        Of the moves that changed what is watched.

    Raises:
        RuntimeError: If most moves changed nothing.
    """
    settle(page)
    found = []
    for move in range(moves + warm):
        release = aim(page, move)
        page.wait_for_timeout(100)
        page.evaluate(
            "watched => { window.waiting = window.released(watched, 8000); }", list(watched)
        )
        release()
        answer, whole = page.evaluate("() => window.waiting")
        if answer is not None and move >= warm:
            found.append(Answer(answer / 1000, whole / 1000))
    if len(found) < moves // 2:
        raise RuntimeError(f"only {len(found)} of {moves} moves changed what is watched")
    return found
