"""Makes the pictures of the README from the product itself: `python docs/pictures.py`.

The GIF comes from the command line; the screenshots from a dashboard started for them.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import urllib.request
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

DOCS = Path(__file__).parent
ROOT = DOCS.parent
WIDTH, HEIGHT = 1440, 900
SETTLED = 3000  # milliseconds for the charts to come to rest

SCREENS = {
    # file: (address, colour scheme, what must be on the page)
    "thresholds.png": ("thresholds", "light", "Mean length of a rule"),
    "thresholds_dark.png": ("thresholds", "dark", "Mean length of a rule"),
    "rules.png": ("rules", "light", "Its place in the tree"),
    "demonstrations.png": ("", "light", "Return of each episode"),
}


def sarl(*arguments: str) -> None:
    """Run a command of the product."""
    subprocess.run([sys.executable, "-m", "sarl_core", *arguments], cwd=ROOT, check=True)


def replay() -> None:
    """The GIF: a novice in Lunar Lander, unfiltered rules, side by side."""
    with tempfile.TemporaryDirectory() as folder:
        rules = str(Path(folder) / "rules.json")
        demonstrations = "data/demonstrations/lunar_lander.parquet"
        sarl("mine", demonstrations, "--support", "0", "--confidence", "1", "--out", rules)
        sarl(
            "render",
            "--env",
            "LunarLander-v3",
            "--agent",
            "novice",
            "--rules",
            rules,
            "--seed",
            "1",
            "--side-by-side",
            "--out",
            str(DOCS / "replay.gif"),
        )


def screenshots() -> None:
    """Every screen of `SCREENS`."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = subprocess.Popen(
        [sys.executable, "-m", "streamlit", "run", "app.py", "--server.port", str(port)],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        env=os.environ,
    )
    try:
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
            )
            _wait(f"http://127.0.0.1:{port}/_stcore/health", browser.new_page())
            for name, (path, scheme, words) in SCREENS.items():
                context = browser.new_context(
                    viewport={"width": WIDTH, "height": HEIGHT}, color_scheme=scheme
                )
                page = context.new_page()
                page.goto(f"http://127.0.0.1:{port}/{path}")
                page.get_by_text(words).first.wait_for(timeout=60_000)
                page.wait_for_timeout(SETTLED)
                page.screenshot(path=DOCS / name)
                context.close()
            browser.close()
    finally:
        server.terminate()
        server.wait(30)


def _wait(address: str, page: Page) -> None:
    for _ in range(300):
        try:
            with urllib.request.urlopen(address):
                return
        except OSError:
            page.wait_for_timeout(100)
    raise SystemExit("the dashboard did not start")


if __name__ == "__main__":
    replay()
    screenshots()
