"""The switch that lets rules ask about two features together, and what a link says of it."""

from __future__ import annotations

from playwright.sync_api import Browser, Page, expect

from tests.browser.walking import no_trace, parameters, settle, visit

SWITCH = "Combinations of two features"
TWO = "pole angular velocity"
TOGETHER = "What it asks of two features together"


def flip(screen: Page) -> None:
    screen.get_by_test_id("stCheckbox").get_by_text(SWITCH, exact=True).click()
    settle(screen)


def choose(screen: Page, feature: str) -> None:
    """Choose one more of the features that may be combined; the box is open."""
    screen.get_by_test_id("stPopoverBody").get_by_role("combobox").click()
    screen.get_by_role("option", name=feature, exact=True).click()
    settle(screen)


def labels(screen: Page) -> list[str]:
    """What stands beside the path to the rule, in the picture of the tree."""
    return screen.locator(".sarl-place em").all_inner_texts()


def test_rules_ask_about_two_features_together_and_a_link_says_which(
    screen: Page, chromium: Browser
) -> None:
    visit(screen, "/thresholds?data=cartpole", "Thresholds")
    flip(screen)
    expect(screen.get_by_text("Combinations of two features on")).to_be_visible()
    assert parameters(screen)["combine"] == "every"
    asked_about = screen.get_by_text("Rules may ask about")
    every = asked_about.inner_text()
    screen.get_by_role("button", name="Features to combine").click()
    choose(screen, "cart velocity")
    expect(screen.get_by_text("Until there is a second one, all are combined.")).to_be_visible()
    choose(screen, TWO)
    assert parameters(screen)["combine"] == "1,3"
    assert asked_about.inner_text() != every
    screen.keyboard.press("Escape")
    screen.get_by_role("link", name="Rules", exact=True).click()
    expect(screen.get_by_text(TOGETHER)).to_be_visible()
    settle(screen)
    asked = labels(screen)
    assert any(f"of {TWO}" in label for label in asked)
    assert f"of {TWO}" in screen.locator(".sarl-path").inner_text()
    seen = screen.get_by_role("img", name=f"cart velocity across and {TWO} upwards")
    expect(seen).to_have_count(1)
    no_trace(screen)

    other = chromium.new_context(viewport={"width": 1440, "height": 900})
    try:
        same = other.new_page()
        visit(same, screen.url, "Rules")
        expect(same.get_by_text(TOGETHER)).to_be_visible()
        assert labels(same) == asked
        no_trace(same)
    finally:
        other.close()


def test_on_a_telephone_what_the_path_asks_is_read_to_its_end(screen: Page) -> None:
    screen.set_viewport_size({"width": 400, "height": 850})
    visit(screen, "/rules?set=fewest%2C+two+features", "Rules")
    beside = screen.locator(".sarl-place em")
    assert any(len(label) > 50 for label in labels(screen))
    for label in beside.all():
        assert label.evaluate("e => e.scrollHeight <= e.clientHeight + 1")
        assert label.evaluate("e => e.scrollWidth <= e.clientWidth + 1")
