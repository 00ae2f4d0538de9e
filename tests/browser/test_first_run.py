"""The Overview in a browser: its film, the first run, and how a "?" leads to the words."""

from __future__ import annotations

from itertools import pairwise

from playwright.sync_api import Page, expect

from sarl_dashboard.components.journey.first_run import STEPS
from tests.browser.walking import addresses, no_trace, parameters, settle, visit


def test_the_first_run_goes_from_the_overview_to_a_replay_and_back(screen: Page) -> None:
    visit(screen, "/", "Overview")
    source = screen.get_by_test_id("stImage").locator("img").first.get_attribute("src")
    assert source is not None
    film = screen.request.get(source).body()
    assert film.startswith(b"GIF89a")  # as it was made: a picture that is made smaller stands still
    assert b"NETSCAPE2.0" in film
    before = addresses(screen)
    screen.get_by_role("link", name="Begin the first run").click()
    for number, step in enumerate(STEPS):
        expect(screen.get_by_role("heading", name=step.page, level=1, exact=True)).to_be_visible()
        settle(screen)
        expect(screen.locator(".st-key-first_run")).to_contain_text(step.what)
        for name, value in step.query.items():
            if (name, value) not in (("data", "lunar_lander"), ("set", "thresholds")):
                assert parameters(screen).get(name, "novice") == value
        assert addresses(screen) == before + number + 1  # Back leads from step to step
        no_trace(screen)
        screen.locator(".st-key-first_run_on").locator("a, button").click()
    expect(screen.get_by_role("heading", name="Overview", level=1)).to_be_visible()
    settle(screen)
    expect(screen.locator(".st-key-first_run")).to_have_count(0)
    again = screen.locator(".st-key-first_run_again")  # no longer what is to be done first
    expect(again).to_contain_text("Begin the first run")


def test_what_is_done_is_a_list_whose_lines_lie_below_each_other(screen: Page) -> None:
    for width in (1440, 400):
        screen.set_viewport_size({"width": width, "height": 900})
        visit(screen, "/", "Overview")
        boxes = [link.bounding_box() for link in screen.locator(".st-key-stages a").all()]
        assert len(boxes) == 7
        for above, below in pairwise(boxes):
            assert above is not None
            assert below is not None
            assert above["height"] >= 24  # to be hit with a finger
            assert above["y"] + above["height"] <= below["y"] + 1


def test_a_question_mark_leads_to_the_words(screen: Page) -> None:
    visit(screen, "/thresholds?data=cartpole", "Thresholds")
    # The first of a slider: the page also holds marks that only show on a narrow screen.
    screen.get_by_test_id("stMain").get_by_test_id("stTooltipIcon").locator(
        "visible=true"
    ).first.hover()
    with screen.context.expect_page() as opening:
        screen.get_by_role("link", name="All words").click()
    words = opening.value
    meaning = words.get_by_role("dialog").get_by_text("share of all demonstrated states")
    expect(meaning).to_be_visible()
    expect(screen.get_by_role("heading", name="Thresholds", level=1)).to_be_visible()
