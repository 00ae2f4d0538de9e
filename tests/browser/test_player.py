"""The film of a replay in a browser: played, stopped and gone through without the server."""

from __future__ import annotations

import re

from playwright.sync_api import Locator, Page, expect

from tests.browser.walking import no_trace, parameters, settle, visit

ADDRESS = "/replay?data=cartpole&rules=filtered&seed=100007"


def film(screen: Page) -> Locator:
    return screen.locator(".st-key-film .player")


def step(screen: Page) -> int:
    return int(film(screen).locator("output").inner_text().split()[1])


def picture(screen: Page) -> str:
    """What is drawn, as text."""
    return str(film(screen).locator("canvas").first.evaluate("part => part.toDataURL()"))


def test_a_film_is_there_unasked_and_begins(screen: Page) -> None:
    visit(screen, ADDRESS, "Replay")
    expect(film(screen)).to_be_visible()
    film(screen).locator("select").select_option("4")
    last = film(screen).get_by_role("slider").get_attribute("max")
    expect(film(screen).locator("output")).to_have_text(f"Step {last} of {last}")
    expect(film(screen).get_by_role("button", name="Play", exact=True)).to_be_visible()
    no_trace(screen)


def test_keys_and_buttons_go_through_the_film_and_the_page_follows(screen: Page) -> None:
    visit(screen, f"{ADDRESS}&step=40", "Replay")
    words = film(screen).locator("output")
    expect(words).to_contain_text("Step 40 of ")  # a link to a step does not run away from it
    settle(screen)
    before = picture(screen)
    film(screen).get_by_role("button", name="One step on").click()
    expect(words).to_contain_text("Step 41 of ")
    assert picture(screen) != before
    screen.keyboard.press("ArrowLeft")
    expect(words).to_contain_text("Step 40 of ")
    assert picture(screen) == before  # going back gives the same picture, pixel by pixel
    screen.keyboard.press("ArrowLeft")
    slider = screen.get_by_role("slider", name="Step")
    expect(slider).to_have_attribute("aria-valuetext", "39")
    settle(screen)
    assert parameters(screen)["step"] == "39"
    screen.get_by_role("button", name="Next change").click()
    expect(slider).not_to_have_attribute("aria-valuetext", "39")
    chosen = slider.get_attribute("aria-valuetext")
    expect(words).to_contain_text(f"Step {chosen} of ")
    no_trace(screen)


def test_it_plays_pauses_and_plays_again_and_again(screen: Page) -> None:
    visit(screen, f"{ADDRESS}&step=1", "Replay")
    place = film(screen).get_by_role("slider", name="Place in the film")
    # So slow that it is not at its end before a slow browser stops it.
    film(screen).locator("select").select_option("0.25")
    place.focus()
    screen.keyboard.press("Space")
    pause = film(screen).get_by_role("button", name="Pause")
    expect(pause).to_be_visible()
    expect(film(screen).locator("output")).not_to_contain_text("Step 1 of ")
    screen.keyboard.press("Space")
    expect(film(screen).get_by_role("button", name="Play", exact=True)).to_be_visible()
    stopped = step(screen)
    slider = screen.get_by_role("slider", name="Step")
    expect(slider).to_have_attribute("aria-valuetext", str(min(stopped, int(last_of(screen)))))
    loop = film(screen).get_by_role("button", name="Loop")
    loop.click()
    expect(loop).to_have_attribute("aria-pressed", "true")
    place.fill(str(place.get_attribute("max")))
    film(screen).get_by_role("button", name="Play", exact=True).click()
    # It began anew; a slow machine sees some of its steps only.
    expect(film(screen).locator("output")).to_contain_text(re.compile(r"Step \d{1,2} of "))
    expect(pause).to_be_visible()
    no_trace(screen)


def last_of(screen: Page) -> str:
    """The last step of the episode that is gone through step by step."""
    return str(screen.get_by_role("slider", name="Step").get_attribute("max") or 10**6)


def test_a_cancel_stays_where_it_is_while_it_is_pressed(screen: Page) -> None:
    visit(screen, "/replay?data=lunar_lander&rules=unfiltered&agent=expert&step=0", "Replay")
    expect(film(screen)).to_be_visible()
    settle(screen)
    screen.get_by_role("spinbutton", name="Seed").fill("100777")
    screen.keyboard.press("Tab")
    settle(screen)
    screen.evaluate(
        """() => {
          window.places = new Set();
          const look = () => {
            const button = document.querySelector('.st-key-cancel_replay button');
            // When the work has ended, it is about to go, and Run takes its place.
            if (button && document.querySelector('[data-testid=stProgress]')) {
              window.places.add(Math.round(button.getBoundingClientRect().x));
            }
            requestAnimationFrame(look);
          };
          look();
        }"""
    )
    run = screen.get_by_role("button", name="Run", exact=True)
    run.click()
    expect(screen.locator(".st-key-cancel_replay button")).to_be_visible()
    expect(run).to_be_visible()
    assert screen.evaluate("window.places.size") == 1
    no_trace(screen)
