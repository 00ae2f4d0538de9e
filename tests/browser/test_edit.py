"""The pages Edit and Compare in a browser: edit, take it back, save, compare."""

from __future__ import annotations

import json
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.browser.walking import metric, no_trace, parameters, rules_choice, settle, visit


def press(screen: Page, name: str) -> None:
    screen.get_by_role("button", name=name, exact=True).click()
    settle(screen)


def test_rules_are_edited_saved_and_compared(screen: Page, tmp_path: Path) -> None:
    visit(screen, "/edit?data=cartpole", "Edit")
    press(screen, "Switch off")
    expect(screen.get_by_role("button", name="Undo: switch off")).to_be_visible()
    changed = metric(screen, "Decided differently")
    assert changed != "0"
    press(screen, "Pin")
    screen.get_by_label("Number").fill("0.0512345678")
    screen.get_by_label("Number").press("Enter")
    expect(screen.get_by_label("Number")).to_have_value("0.0512345678")
    expect(screen.get_by_text("The rule has no action; choose what it says")).to_be_visible()
    settle(screen)
    says = screen.get_by_role("combobox", name="Then")
    says.evaluate("box => box.scrollIntoView({block: 'center'})")  # a scrolled list closes
    says.click()
    screen.get_by_role("option", name="push left").click()
    expect(screen.get_by_text("It would decide")).to_be_visible()
    press(screen, "Add the rule")
    expect(screen.get_by_role("button", name="Undo: add a rule")).to_be_visible()
    assert parameters(screen)["rule"] == "manual.1"
    press(screen, "Move up")
    undo = screen.get_by_role("button", name="Undo: move R")
    moved = undo.inner_text().partition("Undo: ")[2].strip()
    undo.click()  # a rule has its number wherever it stands
    expect(screen.get_by_role("button", name=f"Redo: {moved}")).to_be_visible()
    settle(screen)
    with screen.expect_download() as started:
        screen.get_by_role("button", name="Rule file").click()
    path = tmp_path / "edited.json"
    started.value.save_as(path)
    rules = json.loads(path.read_text())["rules"]
    (by_hand,) = (rule for rule in rules if rule["origin"] == "manual")
    assert by_hand["id"] == "manual.1"
    assert by_hand["conditions"][0]["threshold"] == 0.0512345678
    (off,) = (rule for rule in rules if not rule["enabled"])
    assert off["pinned"]
    # The edits are still there on another page, and go into a comparison.
    screen.get_by_role("link", name="Compare with the unedited set").click()
    expect(screen.get_by_role("heading", name="Compare", level=1)).to_be_visible()
    expect(screen.locator(".st-key-confusion table")).to_be_visible()
    settle(screen)
    expect(
        screen.get_by_text("Before the edits says").or_(screen.get_by_text("edited says")).first
    ).to_be_visible()
    expect(screen.get_by_text("1 rule added, none removed, 1 rule changed")).to_be_visible()
    screen.get_by_role("link", name="Rules", exact=True).click()
    expect(rules_choice(screen)).to_have_value("At the thresholds, with 3 edits")
    expect(screen.locator(".st-key-sentence")).to_be_visible()
    settle(screen)
    screen.get_by_role("link", name="Edit", exact=True).click()
    expect(screen.get_by_role("button", name="Undo: add a rule")).to_be_visible()
    no_trace(screen)


def test_another_set_is_compared_and_a_link_shows_the_same(screen: Page) -> None:
    visit(screen, "/compare?data=cartpole", "Compare")
    table = screen.locator(".st-key-confusion table")
    expect(table).to_be_visible()
    expect(table).to_contain_text("unfiltered says")
    screen.get_by_role("combobox", name="Rule sets").click()
    screen.get_by_role("option", name="compact", exact=True).click()
    screen.keyboard.press("Escape")
    screen.get_by_role("combobox", name="in force against").click()
    screen.get_by_role("option", name="compact", exact=True).click()
    expect(table).to_contain_text("compact says")
    settle(screen)
    now = table.inner_text()
    assert parameters(screen)["sets"] == "in force|unfiltered|compact"
    visit(screen, screen.url, "Compare")
    expect(table).to_be_visible()
    assert table.inner_text() == now
    no_trace(screen)
