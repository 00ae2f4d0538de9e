"""Holding episodes out, in a browser: every page follows, and a link brings it back."""

from __future__ import annotations

from playwright.sync_api import Page, expect

from tests.browser.walking import metric, no_trace, parameters, settle, visit


def test_held_out_episodes_are_chosen_and_every_page_follows(screen: Page) -> None:
    visit(screen, "/evidence?data=cartpole", "Evidence")
    expect(screen.get_by_text("Nothing is held out")).to_be_visible()
    settle(screen)
    slider = screen.get_by_role("slider", name="Share of the episodes held out")
    slider.focus()
    for _ in range(4):
        slider.press("ArrowRight")
    screen.wait_for_function("() => location.search.includes('holdout=0.2')")
    settle(screen)
    expect(screen.get_by_text("6 episodes of 30 held out")).to_be_visible()
    assert metric(screen, "Held-out fidelity").endswith("%")
    screen.get_by_role("link", name="Rules", exact=True).click()
    expect(screen.get_by_role("heading", name="Rules", level=1)).to_be_visible()
    settle(screen)
    expect(screen.get_by_text("not mined from, it was right in").first).to_be_visible()
    assert parameters(screen)["holdout"] == "0.2"
    no_trace(screen)


def test_a_learning_curve_is_called_off(screen: Page) -> None:
    # Long enough that it is not over before a slow browser calls it off.
    visit(screen, "/evidence?data=lunar_lander&about=Learning+curve", "Evidence")
    screen.get_by_role("button", name="Run", exact=True).click()
    screen.get_by_role("button", name="Cancel", exact=True).click()
    expect(screen.get_by_text("Cancelled; nothing was kept.")).to_be_visible()
    no_trace(screen)
