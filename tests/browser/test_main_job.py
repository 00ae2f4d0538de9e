"""The main job in a browser: demonstrations in, rules out, a shielded replay as a GIF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence
from playwright.sync_api import Page, expect

from sarl_core.demonstrations.formats import load_demonstrations
from tests.bad_inputs import ROWS, changed, csv_bytes
from tests.browser.test_replay_steps import SEED
from tests.browser.walking import PATIENCE, metric, no_trace, parameters, settle, visit


def upload(screen: Page, name: str, content: bytes) -> None:
    screen.get_by_test_id("stFileUploaderDropzoneInput").set_input_files(
        {"name": name, "mimeType": "text/csv", "buffer": content}
    )
    expect(screen.get_by_text(name, exact=True).first).to_be_visible()
    settle(screen)


def test_an_uploaded_csv_is_shown_and_chosen(screen: Page) -> None:
    visit(screen, "/demonstrations?data=upload", "Demonstrations")
    upload(screen, "mine.csv", csv_bytes(*ROWS))
    expect(screen.get_by_test_id("stMetricValue").first).to_have_text("5")
    assert metric(screen, "Episodes") == "2"
    assert len(parameters(screen)["data"]) == 26  # it is kept, and the address names it
    no_trace(screen)


def test_a_bad_csv_is_one_sentence_and_the_earlier_set_stays_and_is_downloaded(
    screen: Page, tmp_path: Path
) -> None:
    visit(screen, "/demonstrations?data=cartpole", "Demonstrations")
    screen.get_by_text("Use your own demonstrations").click()
    upload(screen, "broken.csv", changed(2, "0,1,0.25,abc,1"))
    alert = screen.get_by_test_id("stAlert")
    expect(alert).to_contain_text("'abc'")
    expect(alert).to_contain_text("row 2")
    assert metric(screen, "Steps") == "15,000"
    assert parameters(screen)["data"] == "cartpole"
    for label, extension in (("Parquet", "parquet"), ("CSV", "csv")):
        with screen.expect_download() as started:
            screen.get_by_test_id("stDownloadButton").filter(has_text=label).click()
        path = tmp_path / f"again.{extension}"
        started.value.save_as(path)
        assert len(load_demonstrations(path)) == 15_000
    no_trace(screen)


def test_a_clicked_cell_moves_the_sliders(screen: Page) -> None:
    visit(screen, "/thresholds?data=cartpole", "Thresholds")
    before = metric(screen, "Rules")
    plot = screen.locator(".js-plotly-plot .nsewdrag").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    screen.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.3 * box["height"])
    screen.wait_for_timeout(300)
    screen.mouse.click(box["x"] + 0.3 * box["width"], box["y"] + 0.3 * box["height"])
    screen.wait_for_function("() => location.search.includes('support=')")
    settle(screen)
    chosen = parameters(screen)
    shown = screen.get_by_role("slider", name="Minimum support").get_attribute("aria-valuetext")
    assert shown is not None
    assert float(shown) == float(chosen["support"])
    assert metric(screen, "Rules") != before
    no_trace(screen)


def test_a_rule_is_opened(screen: Page) -> None:
    visit(screen, "/rules?data=cartpole", "Rules")
    table = screen.get_by_test_id("stDataFrame").first
    table.scroll_into_view_if_needed()
    box = table.bounding_box()
    assert box is not None
    screen.mouse.click(box["x"] + 10, box["y"] + 36 * 3 - 18)  # the box before the second row
    screen.wait_for_function("() => location.search.includes('rule=')")
    settle(screen)
    expect(screen.get_by_role("heading", name="From the root to the rule")).to_be_visible()
    no_trace(screen)


def replay(screen: Page, query: str) -> None:
    visit(screen, f"/replay?{query}", "Replay")  # it is run unasked
    expect(screen.get_by_role("heading", name="Step by step")).to_be_visible(timeout=PATIENCE)
    settle(screen)


def test_a_gif_and_an_mp4_are_made_and_downloaded(screen: Page, tmp_path: Path) -> None:
    replay(screen, f"data=cartpole&agent=novice&rules=filtered&seed={SEED}")
    steps = int(metric(screen, "Length with rules").replace(",", ""))
    with screen.expect_download() as started:
        screen.get_by_role("button", name="Download GIF").click()
    path = tmp_path / "replay.gif"
    started.value.save_as(path)
    with Image.open(path) as picture:
        assert picture.n_frames > 10
        assert picture.info["loop"] == 0
        frames = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(picture)]
        durations = []
        for number in range(picture.n_frames):
            picture.seek(number)
            durations.append(picture.info["duration"])
    # CartPole draws 50 pictures a second, and one more for the last state.
    assert sum(durations) == pytest.approx(1000 * (steps + 1) / 50, abs=20)
    assert len(np.unique(frames[0].reshape(-1, 3), axis=0)) > 5
    half = frames[-1].shape[1] // 2  # with the rules and without, beside each other, to the end
    assert (frames[-1][:, :half] != frames[-1][:, -half:]).any()
    assert any((frame != frames[0]).any() for frame in frames[1:])
    with screen.expect_download() as started:
        screen.get_by_role("button", name="Download MP4").click()
    path = tmp_path / "replay.mp4"
    started.value.save_as(path)
    assert path.read_bytes()[4:8] == b"ftyp"
    no_trace(screen)


def test_a_link_brings_every_choice_back(screen: Page) -> None:
    visit(
        screen,
        "/replay?data=pendulum&divider=3&agent=expert&rules=filtered&seed=7"
        "&projection=clip&env=Pendulum-v1",
        "Replay",
    )
    for value in ("Pendulum-v1", "expert", "filtered", "clip"):
        assert (
            screen.get_by_test_id("stSelectbox").filter(has_text=value).count()
            or screen.locator(f"input[value='{value}']").count()
        ), value
    assert screen.get_by_role("spinbutton", name="Seed").input_value() == "7"
    no_trace(screen)
