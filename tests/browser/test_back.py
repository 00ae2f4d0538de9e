"""One change is one address to go back to, and going back takes the change back."""

from __future__ import annotations

import re
from pathlib import Path

from playwright.sync_api import Page, WebSocketRoute, expect
from streamlit.proto.BackMsg_pb2 import BackMsg

from sarl_core import load_demonstrations, save_demonstrations
from tests.browser.walking import addresses, metric, no_trace, parameters, settle, visit

MOMENTS = 200  # that lie close together
DATA = Path(__file__).parents[2] / "data" / "demonstrations"


def go(screen: Page, page: str) -> None:
    """Follow the navigation."""
    screen.get_by_test_id("stSidebar").get_by_role("link", name=page, exact=True).click()
    expect(screen.get_by_role("heading", name=page, level=1)).to_be_visible()
    settle(screen)


def test_a_moved_slider_leaves_no_address_without_it(screen: Page) -> None:
    visit(screen, "/thresholds?data=cartpole", "Thresholds")
    before = addresses(screen)
    screen.get_by_role("slider", name="Minimum support").press("ArrowRight")
    settle(screen)
    support = parameters(screen)["support"]
    go(screen, "Rules")
    assert addresses(screen) == before + 1
    assert parameters(screen)["support"] == support
    go(screen, "Thresholds")
    go(screen, "Audit")
    for page in ("Thresholds", "Rules", "Thresholds"):
        screen.go_back()
        expect(screen.get_by_role("heading", name=page, level=1)).to_be_visible()
        settle(screen)
        assert parameters(screen)["support"] == support
    screen.get_by_role("button", name="Unfiltered", exact=True).click()
    settle(screen)
    assert (parameters(screen)["support"], parameters(screen)["confidence"]) == ("0", "1")
    screen.go_back()
    settle(screen)
    assert parameters(screen)["support"] == support
    assert "confidence" not in parameters(screen)
    no_trace(screen)


def test_thresholds_go_back_on_pages_without_sliders(screen: Page) -> None:
    visit(screen, "/rules?data=cartpole&support=0.05", "Rules")
    in_force = screen.get_by_test_id("stSidebar").get_by_text("Support at least")
    go(screen, "Thresholds")
    screen.get_by_role("button", name="Unfiltered", exact=True).click()
    settle(screen)
    go(screen, "Rules")
    expect(in_force).to_contain_text(re.compile(r"Support at least 0(?!\.)"))
    slider = screen.get_by_role("slider", name="Minimum support")
    for support in ("0", "0.05"):
        screen.go_back()
        expect(slider).to_have_attribute("aria-valuetext", support)
        settle(screen)
    screen.go_back()
    expect(screen.get_by_role("heading", name="Rules", level=1)).to_be_visible()
    expect(in_force).to_contain_text("Support at least 0.05")
    assert parameters(screen)["support"] == "0.05"
    no_trace(screen)


def test_an_upload_is_one_address(screen: Page, tmp_path: Path) -> None:
    few = load_demonstrations(DATA / "pendulum.parquet").select(range(5))
    path = tmp_path / "few.parquet"
    save_demonstrations(few, path)
    visit(screen, "/demonstrations?data=cartpole&support=0.01", "Demonstrations")
    before = addresses(screen)
    screen.locator("input[type=file]").first.set_input_files(path)
    expect(screen.get_by_test_id("stSidebar").get_by_text(f"{len(few):,} steps")).to_be_visible()
    screen.wait_for_function("location.search.length > 40")
    settle(screen)
    assert addresses(screen) == before + 1
    go(screen, "Audit")
    before = addresses(screen)
    screen.locator("input[type=file]").first.set_input_files(path)
    screen.wait_for_function("location.search.includes('log=')")
    settle(screen)
    assert addresses(screen) == before + 1
    no_trace(screen)


def typed(screen: Page, text: str) -> None:
    """Give the last feature a name, as its row takes it."""
    table = screen.get_by_test_id("stDataFrame").first
    table.dblclick(position={"x": 120, "y": 150})
    screen.locator("textarea.gdg-input, .gdg-input").last.fill(text)
    screen.keyboard.press("Enter")
    expect(screen.get_by_text(f"If the {text} is")).to_be_visible()
    settle(screen)


def names(screen: Page) -> str:
    """How a rule reads on the page Names."""
    return screen.get_by_text("If the ").last.inner_text()


def test_going_back_takes_names_back_and_forward_gives_them_again(screen: Page) -> None:
    visit(screen, "/names?data=cartpole", "Names")
    before, plain = addresses(screen), names(screen)
    typed(screen, "place")
    screen.wait_for_function("location.search.includes('wording=')")
    settle(screen)
    assert addresses(screen) == before + 1
    named = names(screen)
    assert "place" in named
    screen.go_back()
    settle(screen)
    assert "wording" not in parameters(screen)
    assert names(screen) == plain
    screen.go_forward()
    settle(screen)
    assert names(screen) == named
    go(screen, "Rules")
    assert "place" in screen.locator(".st-key-sentence").first.inner_text()
    for _ in range(2):
        screen.go_back()
        settle(screen)
    assert "wording" not in parameters(screen)
    assert names(screen) == plain
    no_trace(screen)


def test_a_choice_stands_though_a_timer_asks_for_a_run_with_what_was_before(screen: Page) -> None:
    """What the page asks for by itself, it asks with what the sliders are at until it hears more.

    It matters in the moment between a click's callback and the run that this asks for.
    """
    timed: list[bytes] = []

    def between(browser: WebSocketRoute) -> None:
        server = browser.connect_to_server()

        def ask(message: str | bytes) -> None:
            assert isinstance(message, bytes)
            server.send(message)
            asked = BackMsg.FromString(message).rerun_script
            if asked.is_auto_rerun:
                timed.append(message)
            if any(
                one.id.endswith("-unfiltered") and one.trigger_value
                for one in asked.widget_states.widgets
            ):
                for _ in range(MOMENTS):
                    server.send(timed[-1])

        browser.on_message(ask)

    screen.route_web_socket(re.compile("_stcore/stream"), between)
    # It is not known yet what these rules are worth elsewhere: the page looks again and again.
    visit(screen, "/thresholds?data=pendulum&divider=11&support=0.05", "Thresholds")
    slider = screen.get_by_role("slider", name="Minimum support")
    expect(slider).to_have_attribute("aria-valuetext", "0.05")
    before = int(metric(screen, "Rules").replace(",", ""))
    for _ in range(100):
        if not timed:
            screen.wait_for_timeout(100)
    assert timed
    screen.get_by_role("button", name="Unfiltered", exact=True).click()
    expect(slider).to_have_attribute("aria-valuetext", "0")
    settle(screen)
    assert int(metric(screen, "Rules").replace(",", "")) > 10 * before
    assert parameters(screen)["support"] == "0"
    no_trace(screen)
