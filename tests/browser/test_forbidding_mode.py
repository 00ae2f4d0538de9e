from __future__ import annotations

from playwright.sync_api import Page, expect

from tests.browser.walking import metric, no_trace, parameters, settle, visit


def test_a_clicked_cell_puts_rules_that_forbid_in_force_everywhere(screen: Page) -> None:
    visit(screen, "/thresholds?data=cartpole", "Thresholds")
    screen.get_by_text("Rules that forbid").click()
    screen.wait_for_function("() => location.search.includes('mode=forbid')")
    settle(screen)
    freedom = screen.locator(".st-key-map_freedom .js-plotly-plot .heatmaplayer image")
    freedom.wait_for()
    box = freedom.bounding_box()
    assert box is not None
    screen.mouse.click(box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"])
    screen.wait_for_function("() => location.search.includes('epsilon=')")
    settle(screen)
    chosen = parameters(screen)
    epsilon = screen.get_by_role("slider", name="Epsilon").get_attribute("aria-valuetext")
    assert epsilon == chosen["epsilon"]
    count = metric(screen, "Rules")
    screen.get_by_role("link", name="Rules", exact=True).click()
    settle(screen)
    assert parameters(screen)["mode"] == "forbid"
    assert parameters(screen)["epsilon"] == chosen["epsilon"]
    expect(screen.get_by_text(f"{count} rules.")).to_be_visible()
    no_trace(screen)
    screen.get_by_role("link", name="Thresholds", exact=True).click()
    settle(screen)
    expect(screen.get_by_role("slider", name="Epsilon")).to_be_visible()
    assert metric(screen, "Rules") == count
    no_trace(screen)
