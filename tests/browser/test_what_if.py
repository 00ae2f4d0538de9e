"""What if, in a browser: a moved slider is answered, and the link says where it stands."""

from __future__ import annotations

import pytest
from playwright.sync_api import Page, expect

from tests.browser.walking import no_trace, parameters, settle, visit


def test_a_slider_moves_the_state_and_a_link_keeps_it(screen: Page) -> None:
    visit(screen, "/what_if?data=cartpole&support=0&confidence=1", "What if")
    decision = screen.locator(".st-key-decision")
    expect(decision).to_contain_text("executed")
    slider = screen.get_by_role("slider", name="pole angle (rad)")
    slider.focus()
    for _ in range(25):
        slider.press("ArrowRight")
    settle(screen)
    screen.wait_for_function("() => new URL(location).searchParams.has('x2')")
    angle = float(parameters(screen)["x2"])
    assert angle > 0
    # Far to one side the shield pushes there, whatever it did before.
    expect(decision).to_contain_text("push right")
    screen.goto(screen.url)
    settle(screen)
    again = screen.get_by_role("slider", name="pole angle (rad)")
    expect(again).to_be_visible()
    assert float(again.input_value()) == pytest.approx(angle)
    expect(decision).to_contain_text("push right")
    no_trace(screen)
