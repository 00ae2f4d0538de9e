"""Data as others have them, through the uploader: to numbers and to rules."""

from __future__ import annotations

from pathlib import Path

from playwright.sync_api import FilePayload, Page, expect

from tests.browser.walking import metric, no_trace, settle, visit
from tests.demonstrations.test_formats_hubs import lerobot, zipped


def upload(screen: Page, *files: tuple[str, bytes]) -> None:
    visit(screen, "/demonstrations?data=upload", "Demonstrations")
    payloads: list[FilePayload] = [
        {"name": name, "mimeType": "application/octet-stream", "buffer": content}
        for name, content in files
    ]
    screen.get_by_test_id("stFileUploaderDropzoneInput").set_input_files(payloads)
    expect(screen.get_by_text(files[-1][0], exact=True).first).to_be_visible()
    settle(screen)


def turn_to(screen: Page, page: str) -> None:
    """Go on to a page of the same session, which has what was uploaded."""
    screen.get_by_role("link", name=page, exact=True).click()
    expect(screen.get_by_role("heading", name=page, level=1)).to_be_visible()
    settle(screen)


def test_a_folder_of_lerobot_as_its_archive(screen: Page, tmp_path: Path) -> None:
    upload(screen, ("push.zip", zipped(lerobot(tmp_path / "push"))))
    expect(screen.get_by_test_id("stMetricValue").first).to_have_text("12")
    assert metric(screen, "Episodes") == "3"
    expect(screen.get_by_text("rules cannot read them").first).to_be_visible()
    no_trace(screen)


def test_several_files_to_rules(screen: Page) -> None:
    files = [
        (f"run_{number}.csv", "".join(f"{x},{int(x > 7)}\n" for x in range(number, 16)))
        for number in (10, 9, 1)
    ]
    upload(screen, *((name, f"gap,action\n{rows}".encode()) for name, rows in files))
    expect(screen.get_by_test_id("stMetricValue").first).to_have_text("28")
    assert metric(screen, "Episodes") == "3"
    turn_to(screen, "Thresholds")
    assert int(metric(screen, "Rules")) > 0
    no_trace(screen)
