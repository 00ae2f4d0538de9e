"""The steps of a replay in a browser: table, strip, slider, mark and words are one selection."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect

from sarl_core import Shield, load_demonstrations, mine_rules, rollout
from sarl_core.mining.language import number_text
from sarl_core.rendering.overlay import GAP
from sarl_core.rollouts.steps import StepTable
from tests.browser.walking import PATIENCE, metric, no_trace, parameters, settle, visit

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
SEED = 100_007  # of a short episode
ADDRESS = f"/replay?data=cartpole&agent=novice&rules=filtered&seed={SEED}"
ROW = 33  # pixels of a table's rows and of its heading


@pytest.fixture(scope="module")
def wanted() -> StepTable:
    """What the episode is, without the dashboard."""
    rules = mine_rules(
        load_demonstrations(DATA / "cartpole.parquet"), supp_min=0.005, conf_min=0.95
    )
    steps = rollout("CartPole-v1", "novice", shield=Shield(rules), episodes=1, seed=SEED).steps
    assert steps is not None
    return steps


def replay(screen: Page, query: str = "") -> None:
    visit(screen, f"{ADDRESS}{query}", "Replay")  # it is run unasked
    recorder = screen.get_by_role("heading", name="Flight recorder")
    expect(recorder).to_be_visible(timeout=PATIENCE)
    expect(screen.locator(".st-key-recorder_table canvas").first).to_be_visible()
    settle(screen)


def cells(screen: Page) -> Locator:
    """The steps of the flight recorder's rows, as screen readers are told them."""
    return screen.locator(".st-key-recorder_table td[aria-colindex='1']")


def press_row(screen: Page, place: int) -> None:
    """Click the box at the left of a row of the flight recorder, the first being 0."""
    table = screen.locator(".st-key-recorder_table [data-testid=stDataFrameResizable]")
    table.evaluate("box => box.scrollIntoView({block: 'center'})")
    box = table.bounding_box()
    assert box is not None
    screen.mouse.click(box["x"] + 15, box["y"] + ROW * (place + 1.5))


def expect_step(screen: Page, step: int, steps: StepTable) -> None:
    """Slider, picture, words, mark and table are at a step."""
    slider = screen.get_by_role("slider", name="Step")
    expect(slider).to_have_attribute("aria-valuetext", str(step))
    expect(screen.get_by_alt_text(f"The environment at step {step}", exact=True)).to_be_visible()
    settle(screen)
    words = screen.locator(".sarl-step")
    for value in steps.observation[step].tolist():
        expect(words).to_contain_text(number_text(value))
    badge = "No rule applies"
    if steps.rules[step, 0] >= 0:
        badge = "Changed by" if steps.intervened[step] else "Allowed by"
    expect(words.locator(".sarl-badge")).to_contain_text(badge)
    lengths = [
        int(metric(screen, f"Length {which}").replace(",", ""))
        for which in ("with rules", "without")
    ]
    mark = screen.locator(".st-key-timeline").evaluate(
        "box => getComputedStyle(box).getPropertyValue('--mark-across')"
    )
    assert float(mark) == pytest.approx((step + 0.5) / max(lengths), abs=1e-4)
    chosen = screen.locator(".st-key-recorder_table tr[aria-selected='true']")
    expect(chosen).to_have_count(1)
    expect(chosen.locator("td").first).to_have_text(str(step))


def test_a_row_of_the_recorder_is_a_moved_slider(screen: Page, wanted: StepTable) -> None:
    replay(screen, "&step=40")
    expect_step(screen, 40, wanted)
    first = int(cells(screen).first.inner_text())  # of the page of the table that has step 40
    changed = next(
        step
        for step in np.flatnonzero(wanted.intervened).tolist()
        if first <= step < first + 15 and step != 40
    )
    for step in (changed, first):
        press_row(screen, step - first)
        expect_step(screen, step, wanted)
        assert parameters(screen)["step"] == str(step)
    no_trace(screen)


def test_a_click_in_the_strip_takes_the_recorder_along(screen: Page, wanted: StepTable) -> None:
    replay(screen)
    plot = screen.locator(".st-key-strip .nsewdrag").first
    plot.evaluate("box => box.scrollIntoView({block: 'center'})")
    box = plot.bounding_box()
    assert box is not None
    share = 0.6
    # A figure takes a click only where it has seen the pointer first, which nothing on screen
    # tells: click again until it has.
    for offset in range(20):
        x = box["x"] + share * box["width"] + offset % 2
        screen.mouse.move(x, box["y"] + 0.5 * box["height"])
        screen.wait_for_timeout(300)
        screen.mouse.click(x, box["y"] + 0.5 * box["height"])
        screen.wait_for_timeout(1_000)
        if "step" in parameters(screen):
            break
    step = int(parameters(screen)["step"])
    assert abs(step - (share * len(wanted) - 0.5)) <= 2
    expect_step(screen, step, wanted)
    assert step in [int(text) for text in cells(screen).all_inner_texts()]
    no_trace(screen)


def downloaded(screen: Page, key: str) -> bytes:
    with screen.expect_download() as started:
        screen.locator(f".st-key-{key} button").first.click()
    return Path(started.value.path()).read_bytes()


def test_a_fork_is_shown_and_downloaded(screen: Page, wanted: StepTable) -> None:
    replay(screen, "&step=30")
    screen.get_by_role("button", name="Next change").click()
    changes = np.flatnonzero(wanted.intervened)
    step = int(changes[changes > 30][0])
    expect_step(screen, step, wanted)
    screen.get_by_role("button", name=f"Go on without the change at step {step}").click()
    both = screen.get_by_role("img", name="Left: with the change. Right: without it.")
    expect(both).to_be_visible(timeout=PATIENCE)
    settle(screen)
    assert metric(screen, "Return with it") == metric(screen, "Return with rules")
    content = downloaded(screen, "fork_gif")
    assert content[:4] == b"GIF8"
    parts = both.locator("canvas")
    expect(parts).to_have_count(2)
    width = GAP + sum(part.evaluate("part => part.width") for part in parts.all())
    with Image.open(io.BytesIO(content)) as picture:
        assert picture.width == width
        assert picture.n_frames > 10
        picture.seek(picture.n_frames - 1)
        last = np.asarray(picture.convert("RGB")).astype(int)
    half = last.shape[1] // 2  # one branch stands beside the other, and they end apart
    assert (last[:, :half] != last[:, -half:]).any()
    assert downloaded(screen, "fork_mp4")[4:8] == b"ftyp"
    no_trace(screen)


def test_the_filtered_steps_are_downloaded(screen: Page, wanted: StepTable) -> None:
    replay(screen)
    screen.locator(".st-key-only").get_by_text("changed by the rules", exact=True).click()
    caption = screen.get_by_text(re.compile(r"\d+ of \d+ steps: changed by the rules"))
    expect(caption).to_be_visible()
    settle(screen)
    changes = np.flatnonzero(wanted.intervened)
    assert caption.inner_text().startswith(f"{len(changes)} of {len(wanted)} steps")
    readers = {"steps_csv": pd.read_csv, "steps_parquet": pd.read_parquet}
    for key, read in readers.items():
        table = read(io.BytesIO(downloaded(screen, key)))
        assert table["intervened"].all()
        assert table["step"].tolist() == changes.tolist()
        assert set(table["seed"]) == {SEED}
        assert (table["proposed"] != table["executed"]).all()
        observed = table.filter(like="obs_").to_numpy(np.float32)
        assert (observed == wanted.observation[changes]).all()
    no_trace(screen)
