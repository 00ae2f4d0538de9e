"""The rules in force in a browser: edited, sent to somebody else, and gone back from."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Browser, Locator, Page, expect

from tests.browser.conftest import dashboard
from tests.browser.walking import no_trace, parameters, rules_choice, settle, visit


def data_choice(screen: Page) -> Locator:
    return screen.get_by_test_id("stSidebar").get_by_role("combobox", name="Data")


def choose(screen: Page, choice: Locator, option: str) -> None:
    choice.click()
    screen.get_by_role("option", name=option, exact=True).click()
    settle(screen)


def go_back(screen: Page, wanted: str) -> None:
    """Back to an address; some choices, as that of other data, write more than one."""
    go(screen, wanted, screen.go_back)


def go(screen: Page, wanted: str, step: Callable[[], object]) -> None:
    """Step by step to an address that has this in it."""
    for _ in range(6):
        step()
        settle(screen)
        if wanted in screen.url:
            return
    raise AssertionError(f"{screen.url} is not {wanted}")


def test_an_edit_is_in_force_at_once_and_in_a_link_for_somebody_else(
    screen: Page, chromium: Browser, address: str
) -> None:
    visit(screen, "/edit?data=cartpole", "Edit")
    expect(rules_choice(screen)).to_have_value("At the thresholds")
    screen.get_by_role("button", name="Switch off").click()
    expect(rules_choice(screen)).to_have_value("At the thresholds, with 1 edit")
    settle(screen)
    named = parameters(screen)["edits"]
    screen.get_by_role("link", name="Rules", exact=True).click()
    expect(screen.get_by_role("heading", name="Rules", level=1)).to_be_visible()
    expect(screen.get_by_text("Switched off: a shield does not use this rule.")).to_be_visible()
    assert parameters(screen)["edits"] == named
    other = chromium.new_context(base_url=address)
    theirs = other.new_page()
    visit(theirs, f"/export?{screen.url.partition('?')[2]}", "Export")
    expect(rules_choice(theirs)).to_have_value("At the thresholds, with 1 edit")
    with theirs.expect_download() as download:
        theirs.get_by_role("button", name="Download .json").click()
    rules = json.loads(download.value.path().read_text())["rules"]
    assert [rule["enabled"] for rule in rules].count(False) == 1
    no_trace(theirs)
    other.close()


def test_edits_that_are_not_here_are_said_and_nothing_takes_their_place(screen: Page) -> None:
    visit(screen, f"/rules?data=cartpole&edits={'a' * 26}", "Rules")
    expect(screen.get_by_text("has nothing with the id")).to_be_visible()
    expect(screen.get_by_test_id("stDataFrame")).to_have_count(0)
    screen.get_by_role("button", name="Go on without them").click()
    expect(screen.get_by_test_id("stDataFrame").first).to_be_visible()
    settle(screen)
    assert "edits" not in parameters(screen)


def test_back_and_forward_bring_data_rules_page_and_selection(screen: Page) -> None:
    visit(screen, "/rules?data=cartpole", "Rules")
    first = screen.locator(".st-key-sentence").first.inner_text()
    screen.get_by_role("button", name="Next rule").click()
    settle(screen)
    second, address = screen.locator(".st-key-sentence").first.inner_text(), screen.url
    assert second != first
    choose(screen, rules_choice(screen), "Compact rules")
    assert parameters(screen)["set"] == "compact"
    choose(screen, data_choice(screen), "Pendulum")
    expect(rules_choice(screen)).to_have_value("At the thresholds")
    screen.get_by_role("link", name="Thresholds", exact=True).click()
    expect(screen.get_by_role("heading", name="Thresholds", level=1)).to_be_visible()
    settle(screen)

    go_back(screen, "/rules?")
    expect(screen.get_by_role("heading", name="Rules", level=1)).to_be_visible()
    expect(data_choice(screen)).to_have_value("Pendulum")
    go_back(screen, "set=compact")
    expect(data_choice(screen)).to_have_value("Cart Pole")
    expect(rules_choice(screen)).to_have_value("Compact rules")
    # A table says what is selected in it once it is there, maybe after the press, and that is an
    # address, too: so it is gone back until the sentence is the other one.
    go_back(screen, address)
    expect(rules_choice(screen)).to_have_value("At the thresholds")
    assert screen.locator(".st-key-sentence").first.inner_text() == second
    while screen.locator(".st-key-sentence").first.inner_text() != first:
        go_back(screen, "/rules?data=cartpole")
    go(screen, address, screen.go_forward)
    assert screen.locator(".st-key-sentence").first.inner_text() == second
    go(screen, "set=compact", screen.go_forward)
    expect(rules_choice(screen)).to_have_value("Compact rules")
    no_trace(screen)


def test_back_goes_through_what_was_on_screen_and_nothing_else(screen: Page) -> None:
    visit(screen, "/edit?data=cartpole&support=0.01", "Edit")
    screen.get_by_role("button", name="Switch off").click()
    expect(rules_choice(screen)).to_have_value("At the thresholds, with 1 edit")
    settle(screen)
    seen = [screen.url]
    for page in ("Rules", "Compare", "What if"):
        screen.get_by_role("link", name=page, exact=True).click()
        expect(screen.get_by_role("heading", name=page, level=1)).to_be_visible()
        settle(screen)
        seen.append(screen.url)
    choose(screen, data_choice(screen), "Pendulum")
    seen.append(screen.url)
    assert all("edits=" in url and "data=cartpole" in url for url in seen[:-1])
    assert "edits=" not in seen[-1]
    for url in reversed(seen[:-1]):
        screen.go_back()
        settle(screen)
        assert screen.url == url
        expect(rules_choice(screen)).to_have_value("At the thresholds, with 1 edit")
    for url in seen[1:]:
        screen.go_forward()
        settle(screen)
        assert screen.url == url
    expect(data_choice(screen)).to_have_value("Pendulum")
    no_trace(screen)


def test_where_edits_cannot_be_kept_it_is_said(chromium: Browser, tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("no library")
    with dashboard(tmp_path, SARL_LIBRARY=str(blocked)) as address:
        context = chromium.new_context(base_url=address)
        screen = context.new_page()
        visit(screen, "/edit?data=cartpole", "Edit")
        screen.get_by_role("button", name="Switch off").click()
        expect(screen.get_by_test_id("stToast")).to_contain_text("kept for this visit only")
        context.close()
