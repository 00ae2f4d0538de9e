"""A name is typed, and goes with the rules into C that the machine's compiler takes."""

from __future__ import annotations

import csv
import subprocess
from pathlib import Path

from playwright.sync_api import Page, expect

from sarl_core import load_demonstrations
from tests.browser.walking import metric, no_trace, parameters, settle, visit


def type_name(screen: Page, row: int, name: str) -> None:
    """Type into the first column of the first table, whose cells are painted, not elements."""
    table = screen.get_by_test_id("stDataFrame").first
    field = screen.locator(".gdg-input")
    for _ in range(
        5
    ):  # a page that runs again, as for what came of work beside it, forgets the cell
        table.click(position={"x": 120, "y": 50 + 33 * row})
        screen.wait_for_timeout(300)  # for the cell to be the chosen one
        screen.keyboard.press("x")  # opens a field to type in
        screen.wait_for_timeout(500)
        if field.is_visible():
            break
        settle(screen)
    expect(field).to_be_visible()
    field.fill(name)
    field.press("Enter")
    settle(screen)


def test_a_name_is_typed_and_carried_away(screen: Page, tmp_path: Path) -> None:
    visit(screen, "/names?data=cartpole", "Names")
    expect(screen.get_by_text("So a rule reads now")).to_be_visible()
    type_name(screen, 2, "lean of the pole")
    expect(screen.get_by_text("the lean of the pole is")).to_be_visible()
    with screen.expect_download() as started:
        screen.get_by_role("button", name="Download as Parquet").click()
    started.value.save_as(tmp_path / "named.parquet")
    named = load_demonstrations(tmp_path / "named.parquet")
    assert named.features[2].name == "lean of the pole"
    type_name(screen, 3, "lean of the pole")
    expect(screen.get_by_text("stands twice, for feature 2 and 3")).to_be_visible()
    type_name(screen, 3, "its speed")
    expect(screen.get_by_text("stands twice")).not_to_be_visible()

    screen.get_by_test_id("stSidebarNavLink").filter(has_text="Export").click()
    expect(screen.get_by_role("heading", name="Export", level=1)).to_be_visible()
    settle(screen)
    assert metric(screen, "Decisions changed") == "0"
    screen.get_by_test_id("stButtonGroup").first.get_by_text("C", exact=True).click()
    expect(screen.get_by_role("button", name="Download .c", exact=True)).to_be_visible()
    settle(screen)
    assert parameters(screen)["format"] == "C"
    for label, name in (("Download .c", "shield.c"), ("Test vectors", "vectors.csv")):
        with screen.expect_download() as started:
            screen.get_by_role("button", name=label, exact=True).click()
        started.value.save_as(tmp_path / name)
    assert "/* lean of the pole */" in (tmp_path / "shield.c").read_text()
    compiled = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-c", "shield.c"]
    subprocess.run(compiled, cwd=tmp_path, check=True)
    with (tmp_path / "vectors.csv").open() as file:
        assert len(list(csv.DictReader(file))) > 30
    no_trace(screen)
