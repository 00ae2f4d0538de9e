"""Makes the pictures of the guide from the product itself: `python -m docs.scripts.pictures`.

The GIFs, the crane's pictures and the proof's come from the command line; the screenshots from a
dashboard started for them.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Locator, Page, Playwright, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "pictures"
WIDTH, HEIGHT = 1440, 900
SETTLED = 3000  # milliseconds for the charts to come to rest

SCREENS = {
    # file: (address, colour scheme, what must be on the page)
    "thresholds.png": ("thresholds", "light", "judged by rules mined without it"),
    "thresholds_dark.png": ("thresholds", "dark", "judged by rules mined without it"),
    "rules.png": ("rules", "light", "judged by rules mined without it"),
    "demonstrations.png": ("demonstrations", "light", "Return of each episode"),
    "evidence.png": ("evidence?holdout=0.4", "light", "judged by rules mined without it"),
    "what_if.png": ("what_if?data=cartpole&confidence=0.9", "light", "The least change that"),
}
TOGETHER = "data=cartpole&combine=1,3"  # the cart's velocity and the pole's


def sarl(*arguments: str, folder: Path = ROOT) -> None:
    """Run a command of the product in a folder."""
    python(folder, "-m", "sarl_core", *arguments)


def python(folder: Path, *arguments: str) -> None:
    """Run Python in a folder, with the product where it looks for modules."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, check=True)


def render(env_id: str, rules: str, out: Path, *options: str, seed: int = 100_000) -> None:
    """A novice under shipped rules, on a seed that nothing was chosen by."""
    sarl(
        "render",
        "--env",
        env_id,
        "--agent",
        "novice",
        "--rules",
        f"data/rules/{rules}.json",
        "--seed",
        str(seed),
        "--out",
        str(out),
        *options,
    )


def replay() -> None:
    """The GIF: a novice in Lunar Lander, side by side."""
    render("LunarLander-v3", "lunar_lander_few_combined", PICTURES / "replay.gif", "--side-by-side")


def driving() -> None:
    """The GIF of the motorway, side by side, on the first seed on which the novice crashes."""
    out = PICTURES / "driving.gif"
    render("Driving-v0", "driving_compact", out, "--side-by-side", seed=100_001)


def walker() -> None:
    """The GIF of Bipedal Walker: the first ten seconds, every third picture, made smaller."""
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "walker.gif"
        render("BipedalWalker-v3", "bipedal_walker_compact", whole)
        _smaller(whole, PICTURES / "walker.gif", range(0, 500, 3), (420, 409), colours=128)


def overview() -> None:
    """What the page Overview shows: the GIF of `replay`, every third picture, made smaller."""
    out = ROOT / "data" / "replays" / "lunar_lander.gif"
    out.parent.mkdir(exist_ok=True)
    with Image.open(PICTURES / "replay.gif") as film:
        count = film.n_frames
    numbers = [*range(0, count - 1, 3), count - 1]
    _smaller(PICTURES / "replay.gif", out, numbers, (760, 365), colours=48, at_the_end=2000)


def _smaller(
    whole: Path,
    out: Path,
    numbers: Sequence[int],
    size: tuple[int, int],
    *,
    colours: int,
    at_the_end: int = 60,
) -> None:
    """Some pictures of a GIF as another one, in fewer colours, each for three of the original.

    The last stands for `at_the_end` milliseconds, so that one sees how it ended.
    """
    with Image.open(whole) as film:
        pictures = []
        for number in numbers:
            film.seek(number)
            pictures.append(film.convert("RGB").resize(size, Image.Resampling.LANCZOS))
            pictures[-1].info.clear()  # the colour that was transparent is none of the new ones
    palette = pictures[50].quantize(colours)
    first, *others = (one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures)
    first.save(
        out,
        save_all=True,
        append_images=others,
        duration=[60] * len(others) + [at_the_end],
        loop=0,
        optimize=True,
    )


def crane() -> None:
    """The pictures of the first walk: the threshold plane, and the head of the audit."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        python(folder, str(ROOT / "examples" / "crane.py"))
        thresholds = ("--support", "0.005", "--confidence", "0.95")
        sarl("landscape", "crane.csv", "--out", "plane.png", folder=folder)
        sarl("mine", "crane.csv", *thresholds, "--out", "crane_rules.json", folder=folder)
        sarl("audit", "crane_rules.json", "crane_night_shift.csv", "--out", ".", folder=folder)
        with Image.open(folder / "plane.png") as plane:
            plane.convert("RGB").quantize(64).save(PICTURES / "crane_thresholds.png", optimize=True)
        with sync_playwright() as playwright:
            browser = _chromium(playwright)
            page = browser.new_page(viewport={"width": 1000, "height": 760})
            page.goto((folder / "audit.html").as_uri())
            page.screenshot(path=PICTURES / "crane_audit.png")
            browser.close()


def proof() -> None:
    """From where it is proved that Cart Pole's pole stays up."""
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        python(Path(name), str(ROOT / "examples" / "prove_cartpole.py"))
        browser = _chromium(playwright)
        page = browser.new_page(viewport={"width": 900, "height": 560})
        page.goto((Path(name) / "proved_cartpole.html").as_uri())
        page.wait_for_timeout(SETTLED)
        page.screenshot(path=PICTURES / "proved.png")
        browser.close()
    with Image.open(PICTURES / "proved.png") as picture:
        picture.convert("RGB").quantize(64).save(PICTURES / "proved.png", optimize=True)


def screenshots() -> None:
    """Every screen of `SCREENS`."""
    with dashboard() as (browser, address):
        for name, (path, scheme, words) in SCREENS.items():
            with window(browser, scheme) as page:
                page.goto(f"{address}/{path}")
                page.get_by_text(words).first.wait_for(timeout=300_000)
                page.wait_for_timeout(SETTLED)
                page.screenshot(path=PICTURES / name)


def combinations() -> None:
    """A combination of Cart Pole's largest rule, and where features are chosen."""
    with dashboard() as (browser, address):
        for scheme, ending in (("light", ""), ("dark", "_dark")):
            with window(browser, scheme, height=3000) as page:
                page.goto(f"{address}/rules?{TOGETHER}")
                top = page.get_by_text("What it asks of two features together")
                bottom = page.locator(".sarl-features").nth(1)
                bottom.wait_for(timeout=300_000)
                page.wait_for_timeout(SETTLED)
                picture = PICTURES / f"combination{ending}.png"
                _part(page, top, bottom, picture, width=350)
                page.goto(f"{address}/thresholds?{TOGETHER}")
                page.get_by_text("judged by rules mined without it").first.wait_for(timeout=300_000)
                page.get_by_role("button", name="Features to combine").click()
                page.wait_for_timeout(SETTLED)
                top = page.locator(".st-key-combining")
                bottom = page.get_by_test_id("stPopoverBody")
                picture = PICTURES / f"combinations_switch{ending}.png"
                _part(page, top, bottom, picture, width=760)


def _part(page: Page, top: Locator, bottom: Locator, picture: Path, *, width: int) -> None:
    """A picture of a page from one thing down to another one, in few colours."""
    first, last = top.bounding_box(), bottom.bounding_box()
    assert first is not None
    assert last is not None
    x, y = first["x"] - 12, first["y"] - 12
    height = last["y"] + last["height"] + 12 - y
    page.screenshot(path=picture, clip={"x": x, "y": y, "width": width, "height": height})
    with Image.open(picture) as shot:
        shot.convert("RGB").quantize(64).save(picture, optimize=True)


@contextmanager
def window(browser: Browser, scheme: str, height: int = HEIGHT) -> Iterator[Page]:
    """A window of a browser in light or dark."""
    context = browser.new_context(
        viewport={"width": WIDTH, "height": height},
        color_scheme="dark" if scheme == "dark" else "light",
    )
    yield context.new_page()
    context.close()


@contextmanager
def dashboard() -> Iterator[tuple[Browser, str]]:
    """A browser, and the address of a dashboard that runs as long."""
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
            browser = _chromium(playwright)
            _wait(f"http://127.0.0.1:{port}/_stcore/health", browser.new_page())
            yield browser, f"http://127.0.0.1:{port}"
            browser.close()
    finally:
        server.terminate()
        server.wait(30)


def _chromium(playwright: Playwright) -> Browser:
    return playwright.chromium.launch(
        executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
    )


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
    overview()
    driving()
    walker()
    crane()
    proof()
    screenshots()
    combinations()
