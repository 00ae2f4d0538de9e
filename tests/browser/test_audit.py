"""From a log to the rule that it broke, and to what would have been allowed."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import Page, expect

from tests.browser.walking import metric, no_trace, parameters, settle, visit

LOG = Path(__file__).parents[2] / "data" / "demonstrations" / "cartpole.parquet"


def test_a_break_leads_to_its_rule_and_to_what_if(screen: Page) -> None:
    visit(screen, "/audit?data=cartpole&support=0.01&confidence=0.9", "Audit")
    screen.locator("input[type=file]").first.set_input_files(LOG)
    expect(screen.get_by_text("Longest stretches of breaks")).to_be_visible()
    settle(screen)
    assert int(metric(screen, "Broken").replace(",", "")) > 0
    expect(screen.get_by_text("broken", exact=True).last).to_be_visible()
    screen.get_by_role("link", name="What if, with this state").click()
    expect(screen.get_by_role("heading", name="What if", level=1)).to_be_visible()
    settle(screen)
    assert {"x0", "x1", "x2", "x3"} & set(parameters(screen))
    no_trace(screen)
    screen.get_by_role("link", name="Audit", exact=True).click()
    expect(screen.get_by_role("heading", name="Audit", level=1)).to_be_visible()
    settle(screen)
    screen.locator("input[type=file]").first.set_input_files(LOG)
    link = screen.get_by_role("link", name="Open R")
    expect(link).to_be_visible()
    settle(screen)
    name = link.inner_text().strip().removeprefix("Open ").split()[-1]
    link.click()
    expect(screen.get_by_role("heading", name="Rules", level=1)).to_be_visible()
    settle(screen)
    expect(screen.get_by_text(f"{name} · support")).to_be_visible()
    no_trace(screen)
