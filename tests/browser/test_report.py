"""The page Report in a browser: make it, look at it, take it along, open it alone, print it."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import Browser, Page, expect

from tests.browser.walking import no_trace, parameters, settle, visit

PATIENCE = 240_000  # milliseconds; episodes are played for the pictures


def test_a_report_is_made_and_opens_without_the_dashboard(
    screen: Page, chromium: Browser, tmp_path: Path
) -> None:
    visit(screen, "/report?data=cartpole&frames=1", "Report")
    screen.get_by_role("button", name="Make the report").click()
    expect(screen.get_by_text("It opens without a network")).to_be_visible(timeout=PATIENCE)
    settle(screen)
    inside = screen.frame_locator('iframe[src^="data:text/html"]')
    expect(inside.get_by_role("heading", name="Rules for Cart Pole", level=1)).to_be_visible()
    assert parameters(screen)["frames"] == "1"
    with screen.expect_download() as started:
        screen.get_by_role("button", name="Download the report").click()
    path = tmp_path / "report.html"
    started.value.save_as(path)
    no_trace(screen)
    context = chromium.new_context(viewport={"width": 400, "height": 850}, offline=True)
    alone = context.new_page()
    asked: list[str] = []
    alone.on("request", lambda request: asked.append(request.url))
    alone.goto(path.as_uri())
    expect(alone.get_by_role("heading", name="What is not guaranteed")).to_be_visible()
    images = alone.locator("img")
    expect(images).to_have_count(5)
    for number in range(5):
        assert images.nth(number).evaluate("image => image.naturalWidth") == 400
    # Nothing is fetched, and nothing is cut off at the width of a telephone.
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
    assert alone.evaluate("document.documentElement.scrollWidth") == 400
    assert alone.pdf(prefer_css_page_size=True).startswith(b"%PDF")
    context.close()
