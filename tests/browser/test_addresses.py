"""Every page has the address that its name suggests."""

from __future__ import annotations

from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Page, expect

from tests.browser.walking import metric, no_trace, parameters, visit


@pytest.mark.parametrize("path", ["/", "/demonstrations"])
def test_demonstrations_are_found_at_both_addresses(screen: Page, path: str) -> None:
    visit(screen, f"{path}?data=cartpole", "Demonstrations")
    assert metric(screen, "Steps") == "15,000"
    assert parameters(screen)["data"] == "cartpole"
    assert urlsplit(screen.url).path == "/"
    expect(screen.get_by_role("dialog")).to_have_count(0)
    expect(screen.get_by_test_id("stSidebarNavLink")).to_have_count(18)
    no_trace(screen)


def test_the_page_export_is_found_at_the_address_it_once_had(screen: Page) -> None:
    visit(screen, "/carry?data=cartpole&carry=compact", "Export")
    assert urlsplit(screen.url).path == "/export"
    assert parameters(screen) == {"data": "cartpole", "carry": "compact"}
    expect(screen.get_by_test_id("stSidebarNavLink")).to_have_count(18)
    no_trace(screen)
