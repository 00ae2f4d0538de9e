"""A formula that is typed on the page Names, and the rules that then ask about it."""

from __future__ import annotations

from playwright.sync_api import Page, expect

from tests.browser.walking import no_trace, settle, visit

FORMULA = "pole_angle + 0.3 * pole_angular_velocity"
GOOD = f"lean soon [rad] = {FORMULA}"


def test_a_formula_is_checked_as_it_is_typed_and_rules_ask_about_it(screen: Page) -> None:
    visit(screen, "/names?data=cartpole", "Names")
    box = screen.get_by_label("Formula", exact=True)
    # No key but those of the text is pressed: what is typed is read when one pauses.
    box.press_sequentially("lean [rad] = pole_angel / 2")
    expect(screen.get_by_text("did you mean 'pole angle'")).to_be_visible()
    expect(screen.get_by_role("button", name="Add the formula")).to_be_disabled()
    box.fill(GOOD)
    expect(screen.get_by_text("did you mean 'pole angle'")).to_have_count(0)
    settle(screen)
    add = screen.get_by_role("button", name="Add the formula")
    expect(add).to_be_enabled()
    expect(screen.get_by_test_id("stPlotlyChart")).to_have_count(1)
    expect(screen.get_by_text("adds rad and rad/s")).to_be_visible()
    settle(screen)
    add.click()
    expect(screen.get_by_role("button", name="Remove")).to_be_visible()
    expect(screen.get_by_text(FORMULA, exact=True)).to_be_visible()
    expect(screen.get_by_text("1 formula among the features")).to_be_visible()
    settle(screen)
    screen.get_by_role("link", name="Rules", exact=True).click()
    expect(screen.get_by_text("From the root to the rule")).to_be_visible()
    expect(screen.locator(".sarl-place em").filter(has_text="lean soon").first).to_be_visible()
    no_trace(screen)
