"""Every page has the address that its name suggests, and is still found at those it once had."""

from __future__ import annotations

from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Page, expect

from tests.browser.walking import metric, no_trace, parameters, visit

PAGES = 20


def test_the_overview_is_where_one_arrives_and_takes_the_data_of_old_links(screen: Page) -> None:
    visit(screen, "/?data=cartpole", "Overview")
    assert urlsplit(screen.url).path == "/"
    assert parameters(screen)["data"] == "cartpole"
    expect(screen.get_by_test_id("stSidebarNavLink")).to_have_count(PAGES)
    expect(screen.get_by_test_id("stSidebarLogo")).to_be_visible()
    no_trace(screen)


def test_the_tab_is_named_after_the_page(screen: Page) -> None:
    visit(screen, "/demonstrations?data=cartpole", "Demonstrations")
    assert metric(screen, "Steps") == "15,000"
    assert screen.title() == "Demonstrations"
    expect(screen.get_by_role("dialog")).to_have_count(0)
    screen.get_by_role("link", name="Next: name features").click()
    expect(screen.get_by_role("heading", name="Names", level=1)).to_be_visible()
    assert screen.title() == "Names"
    assert parameters(screen)["data"] == "cartpole"


@pytest.mark.parametrize(
    ("old", "new", "title", "query"),
    [
        ("carry", "export", "Export", {"carry": "compact"}),
        ("difference", "compare", "Compare", {"first": "unfiltered"}),
        ("shield", "measure", "Measure", {"episodes": "4"}),
        ("ablation", "worth", "Worth of each rule", {"ablation_episodes": "6"}),
    ],
)
def test_a_page_is_found_at_the_address_it_once_had(
    screen: Page, old: str, new: str, title: str, query: dict[str, str]
) -> None:
    asked = {"data": "cartpole", **query}
    visit(screen, f"/{old}?{'&'.join(f'{name}={asked[name]}' for name in asked)}", title)
    assert urlsplit(screen.url).path == f"/{new}"
    assert asked.items() <= parameters(screen).items()
    expect(screen.get_by_test_id("stSidebarNavLink")).to_have_count(PAGES)
    no_trace(screen)
