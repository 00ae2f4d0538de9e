"""A click on a step of what was demonstrated selects it, and leads to its rule."""

from __future__ import annotations

from playwright.sync_api import Page, expect

from tests.browser.walking import no_trace, parameters, settle, visit


def test_a_click_selects_a_step_and_leads_to_what_if(screen: Page) -> None:
    visit(screen, "/episodes?data=cartpole&support=0.01&confidence=0.9&episode=1", "Episodes")
    expect(screen.get_by_alt_text("The environment at step 0", exact=True)).to_be_visible()
    settle(screen)
    for chart in ("episode_strip", "episode_features"):
        box = screen.locator(f".st-key-{chart} .plotly .draglayer").first.bounding_box()
        before = parameters(screen).get("step", "0")
        share = 0.3 if chart == "episode_strip" else 0.7
        assert box is not None
        screen.mouse.click(box["x"] + share * box["width"], box["y"] + box["height"] / 8)
        settle(screen)
        step = parameters(screen)["step"]
        assert step != before
        expect(screen.get_by_text(f"Step {step} of episode 1.")).to_be_visible()
    screen.get_by_role("button", name="Next step").click()
    settle(screen)
    assert parameters(screen)["step"] == str(int(step) + 1)
    screen.get_by_role("link", name="What if, with this state").click()
    expect(screen.get_by_role("heading", name="What if", level=1)).to_be_visible()
    settle(screen)
    assert {"x0", "x1", "x2", "x3"} & set(parameters(screen))
    no_trace(screen)
