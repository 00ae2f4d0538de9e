"""The page Paper in a browser: a figure, one of its parts, and a page to take along."""

from __future__ import annotations

import shutil
from pathlib import Path

from playwright.sync_api import Page, expect
from plotly.offline import get_plotlyjs

from sarl_core.paper.sheets import SCRIPT
from tests.browser.walking import no_trace, parameters, settle, visit

PAPER = Path(__file__).parents[2] / "data" / "paper"


def test_a_figure_is_looked_at_and_taken_along(screen: Page, tmp_path: Path) -> None:
    visit(screen, "/paper?figure=Figure+2", "Paper")
    expect(screen.get_by_role("heading", name="Figure 2. Number of rules")).to_be_visible()
    expect(screen.locator(".js-plotly-plot")).to_have_count(2)
    screen.get_by_role("radio", name="Bipedal Walker", exact=True).click()
    expect(screen.get_by_text("Number of rules, Bipedal Walker", exact=True)).to_be_visible()
    settle(screen)
    assert parameters(screen)["figure"] == "Figure 2"
    assert parameters(screen)["part_2"] == "Bipedal Walker"
    no_trace(screen)
    with screen.expect_download() as started:
        screen.get_by_role("button", name="Page (HTML)").click()
    path = tmp_path / "figure_2.html"
    started.value.save_as(path)
    # It needs nothing beside it, and no network.
    screen.context.set_offline(True)
    screen.goto(path.as_uri())
    expect(screen.get_by_role("heading", name="Figure 2. Number of rules")).to_be_visible()
    expect(screen.locator(".js-plotly-plot .main-svg").first).to_be_visible()
    expect(screen.locator(".js-plotly-plot").nth(7)).to_be_visible()


def test_a_page_in_a_clone_shows_its_picture_until_the_script_is_back(
    screen: Page, tmp_path: Path
) -> None:
    for name in ("table_1.html", "table_1.png"):
        shutil.copy(PAPER / name, tmp_path)
    address = (tmp_path / "table_1.html").as_uri()
    picture = screen.get_by_role("img", name="Table 1. The two named settings", exact=True)
    screen.goto(address)
    expect(picture).to_be_visible()
    screen.wait_for_function("document.querySelector('.still img').naturalWidth > 1000")
    expect(screen.get_by_text("is not beside this page")).to_be_visible()
    expect(screen.locator(".row:visible")).to_have_count(0)
    (tmp_path / SCRIPT).write_text(get_plotlyjs(), encoding="utf-8")
    screen.goto(address)
    expect(screen.locator(".js-plotly-plot .main-svg").first).to_be_visible()
    expect(picture).not_to_be_visible()
