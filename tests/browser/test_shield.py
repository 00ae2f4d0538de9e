"""The page Measure in a browser: run, look, change, download, come back."""

from __future__ import annotations

import csv
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.browser.walking import no_trace, parameters, settle, visit

PATIENCE = 240_000  # milliseconds; the processes that run episodes may have to start first


def test_a_comparison_is_run_changed_downloaded_and_found_again(
    screen: Page, tmp_path: Path
) -> None:
    visit(screen, "/measure?data=cartpole&episodes=2&first_seed=8000", "Measure")
    expect(screen.get_by_text("press Run")).to_be_visible()
    screen.get_by_role("button", name="Run", exact=True).click()
    expect(screen.get_by_text("all done already")).to_be_visible(timeout=PATIENCE)
    settle(screen)
    expect(screen.get_by_text("the typical return of the novice rises")).to_be_visible()
    expect(screen.locator(".js-plotly-plot")).to_have_count(3)
    traces = screen.locator(".js-plotly-plot").nth(1).locator(".scatterlayer .trace")
    expect(traces).to_have_count(6)
    with screen.expect_download() as started:
        screen.get_by_test_id("stDownloadButton").click()
    path = tmp_path / "comparison.csv"
    started.value.save_as(path)
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [row["arm"] for row in rows][:3] == [
        "novice, no shield",
        "novice, filtered",
        "novice, unfiltered",
    ]
    assert {row["seed"] for row in rows} == {"8000"}
    assert rows[0]["flips_per_second"] == ""  # without a shield nothing switches
    assert 0 <= float(rows[2]["flips_per_second"]) <= 50
    # Without the expert: at once, and a link shows the same.
    screen.get_by_text("expert", exact=True).first.click()
    expect(screen.get_by_text("2 episodes for each of 3 settings")).to_be_visible()
    settle(screen)
    assert parameters(screen)["agents"] == "novice"
    visit(screen, screen.url, "Measure")
    expect(traces).to_have_count(3)
    no_trace(screen)


def test_a_page_that_is_loaded_anew_goes_on_looking_at_its_work(screen: Page) -> None:
    # Enough work for minutes, on any machine.
    query = "data=bipedal_walker&episodes=1000&agents=novice&shields=no+shield&first_seed=9000"
    visit(screen, f"/measure?{query}", "Measure")
    screen.get_by_role("button", name="Run", exact=True).click()
    expect(screen.get_by_text("of 1000 episodes").first).to_be_visible(timeout=PATIENCE)
    screen.reload()
    expect(screen.get_by_text("of 1000 episodes").first).to_be_visible(timeout=PATIENCE)
    screen.get_by_role("button", name="Cancel").click()
    expect(screen.get_by_text("Cancelled.")).to_be_visible()
    settle(screen)
    visit(screen, screen.url, "Measure")
    expect(screen.get_by_text("of these 1,000 are done, and Run goes on there")).to_be_visible()
    no_trace(screen)
