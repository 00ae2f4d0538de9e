"""Thousands of rules and hundreds of features, a page at a time."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from playwright.sync_api import Locator, Page, expect

from sarl_core import Demonstrations
from sarl_core.demonstrations.formats import save_demonstrations
from tests.browser.walking import no_trace, parameters, settle, visit


def upload(screen: Page, demonstrations: Demonstrations, folder: Path) -> str:
    """Bring demonstrations, and say what they are called in addresses."""
    path = folder / "large.parquet"
    save_demonstrations(demonstrations, path)
    visit(screen, "/demonstrations?data=upload", "Demonstrations")
    screen.locator("input[type=file]").first.set_input_files(path)
    expect(screen.get_by_text("Mean length")).to_be_visible()
    settle(screen)
    return parameters(screen)["data"]


def turn(screen: Page, page: int) -> None:
    pages(screen).get_by_role("button", name=str(page)).click()
    settle(screen)


def pages(screen: Page) -> Locator:
    return screen.get_by_test_id("stPagination")


def test_thousands_of_rules_are_turned_over_and_the_chosen_one_stays(
    screen: Page, tmp_path: Path
) -> None:
    rng = np.random.default_rng(0)  # of what is drawn by chance nearly every state is a rule
    states = rng.normal(size=(3_000, 2)).astype(np.float32)
    data = upload(
        screen,
        Demonstrations(states, rng.integers(0, 8, 3_000), np.repeat(np.arange(3), 1_000)),
        tmp_path,
    )
    visit(screen, f"/rules?data={data}&support=0&confidence=1", "Rules")
    expect(screen.get_by_text(re.compile(r"Rows 1 to 2,000\."))).to_be_visible()
    # What stands above the table is there, so that it does not move any more.
    expect(screen.get_by_text(re.compile("judged by rules mined without it"))).to_be_visible()
    settle(screen)
    sentence = screen.locator(".st-key-sentence").get_by_role("heading").first.inner_text()
    turn(screen, 2)
    expect(screen.get_by_text(re.compile(r"Rows 2,001 to "))).to_be_visible()
    assert parameters(screen)["rules_page"] == "2"
    assert screen.locator(".st-key-sentence").get_by_role("heading").first.inner_text() == sentence
    # The rule that follows stands on the first one.
    screen.get_by_role("button", name="Next rule").click()
    settle(screen)
    expect(screen.get_by_text(re.compile(r"Rows 1 to 2,000\."))).to_be_visible()
    assert "rules_page" not in parameters(screen)
    assert screen.locator(".st-key-sentence").get_by_role("heading").first.inner_text() != sentence
    no_trace(screen)


def test_hundreds_of_features_are_searched_and_turned_over(screen: Page, tmp_path: Path) -> None:
    states = np.random.default_rng(0).normal(size=(60, 300)).astype(np.float32)
    upload(
        screen,
        Demonstrations(
            states,
            (states[:, 0] > 0).astype(np.int64),
            np.repeat(np.arange(3), 20),
            feature_names=[f"sensor {place:03d}" for place in range(300)],
        ),
        tmp_path,
    )
    title = screen.locator("strong", has_text=re.compile(r"^sensor \d+$"))
    expect(title).to_have_count(12)
    turn(screen, 25)
    expect(title).to_have_text([f"sensor {place}" for place in range(288, 300)])
    assert parameters(screen)["feature_page"] == "25"
    screen.get_by_role("textbox", name="Search for features").fill("007")
    screen.get_by_role("textbox", name="Search for features").press("Enter")
    expect(title).to_have_text(["sensor 007"])
    expect(pages(screen)).to_have_count(0)
    no_trace(screen)
