"""What axe-core holds against the pages, as they open and after a run, in both themes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import pytest
from axe_playwright_python.base import AXE_SCRIPT
from playwright.sync_api import Browser, Page, expect

from sarl_core import audit, load_demonstrations, make_report, mine_rules
from sarl_core.explaining.exports.audit import audit_html
from sarl_core.explaining.html.rule_matrix import matrix_document, rule_matrix
from tests.browser.walking import no_trace, rest, settle, visit

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
PATIENCE = 240_000  # milliseconds; the processes that run episodes may have to start first
PAGES = {
    "": "Overview",
    "demonstrations": "Demonstrations",
    "names": "Names",
    "episodes": "Episodes",
    "thresholds": "Thresholds",
    "thresholds?mode=forbid": "Thresholds",
    "thresholds?mode=both": "Thresholds",
    "rules": "Rules",
    "evidence": "Evidence",
    "what_if": "What if",
    "edit": "Edit",
    "compare": "Compare",
    "replay": "Replay",
    "measure": "Measure",
    "worth": "Worth of each rule",
    "audit": "Audit",
    "report": "Report",
    "export": "Export",
    "library": "Library",
    "improve": "Improve",
    "learning": "Learning",
    "paper": "Paper",
}
# What Streamlit writes itself, and nothing outside of it can mend.
STREAMLITS = {
    # Sections of its navigation are boxes within one list.
    "list": "[data-testid=stSidebarNavItems]",
    "listitem": "[data-testid=stSidebarNavItems] li",
    # The beginning of a file, on Export and Library; commands are wrapped. Its tabindex is -1, but
    # the Tab key stops there and arrows scroll: browsers (Chromium from 130 on, Firefox) let keys
    # scroll what holds nothing else to stop at, which axe-core does not know.
    "scrollable-region-focusable": "[data-testid=stCode] pre",
}
THEMES: dict[Literal["light", "dark"], list[str] | None] = {
    "light": None,
    "dark": ["color-contrast"],  # all that a theme changes
}
# Of what is serious, and of headings that skip a level: the rule, the element and why. What takes
# most of the time and has no say is left out: what stands in no landmark is moderate, and of the
# thousands of elements in drawings of Plotly axe-core knows no more than that it cannot tell.
HELD_AGAINST = """
async ([streamlits, only]) => {
  const options = {resultTypes: ['violations'], preload: false,
    ...(only ? {runOnly: only} : {rules: {region: {enabled: false}}})};
  const looked = {include: [['html']], exclude: [['.js-plotly-plot .main-svg']]};
  const results = await axe.run(looked, options);
  const serious = results.violations.filter(
    rule => ['serious', 'critical'].includes(rule.impact) || rule.id === 'heading-order');
  return serious.flatMap(rule => rule.nodes
    .filter(node => !(rule.id in streamlits
      && document.querySelector(node.target[0])?.matches(streamlits[rule.id])))
    .map(node => [rule.id, node.html.slice(0, 200), node.failureSummary].join('\\n')));
}
"""


def held_against(
    screen: Page, streamlits: dict[str, str], only: list[str] | None = None
) -> list[str]:
    """What somebody could not read or use on a page as it stands; by some rules, or by all."""
    if not screen.evaluate("'axe' in window"):
        screen.evaluate(AXE_SCRIPT)
    found: list[str] = screen.evaluate(HELD_AGAINST, [streamlits, only])
    return found


def held_in_both_themes(screen: Page) -> dict[str, list[str]]:
    """What is held against a settled page in light and in dark, where there is something.

    It was opened in light, as `screen` is, and is left in light for the page after it.
    """
    found = {}
    for theme, only in THEMES.items():
        if theme != "light":
            screen.emulate_media(color_scheme=theme, reduced_motion="reduce")
            settle(screen)
        if against := held_against(screen, STREAMLITS, only):
            found[f"{screen.url} {theme}"] = against
    screen.emulate_media(color_scheme="light", reduced_motion="reduce")
    return found


def test_everybody_can_use_every_page_as_it_opens(screen: Page) -> None:
    screen.emulate_media(reduced_motion="reduce")
    found = {}
    for path, title in PAGES.items():
        visit(screen, f"/{path}{'&' if '?' in path else '?'}data=cartpole", title)
        rest(screen, patience=PATIENCE)
        found |= held_in_both_themes(screen)
        no_trace(screen)
    assert not found, json.dumps(found, indent=1)


def test_everybody_can_use_what_a_run_adds(screen: Page) -> None:
    # Settings of its own: what is made here, other tests on this server would find made already.
    screen.emulate_media(reduced_motion="reduce")
    visit(screen, "/measure?data=cartpole&episodes=2&first_seed=7000", "Measure")
    screen.get_by_role("button", name="Run", exact=True).click()
    expect(screen.get_by_text("all done already")).to_be_visible(timeout=PATIENCE)
    rest(screen, patience=PATIENCE)
    found = held_in_both_themes(screen)
    visit(screen, "/replay?data=cartpole&agent=novice&rules=filtered&seed=100022", "Replay")
    recorder = screen.get_by_role("heading", name="Flight recorder")
    expect(recorder).to_be_visible(timeout=PATIENCE)
    rest(screen, patience=PATIENCE)
    found |= held_in_both_themes(screen)
    visit(screen, "/report?data=cartpole&frames=0", "Report")
    screen.get_by_role("button", name="Make the report").click()
    expect(screen.get_by_text("It opens without a network")).to_be_visible(timeout=PATIENCE)
    rest(screen, patience=PATIENCE)
    found |= held_in_both_themes(screen)
    assert not found, json.dumps(found, indent=1)


@pytest.fixture(scope="module")
def documents(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """What is handed over as HTML."""
    folder = tmp_path_factory.mktemp("documents")
    demonstrations = load_demonstrations(DATA / "cartpole.parquet")
    rules = mine_rules(demonstrations, supp_min=0.005, conf_min=0.95)
    report = make_report(rules, demonstrations, frames=1)
    written = {
        "report.html": report.html,
        "slides.html": report.slides,
        "matrix.html": matrix_document(rule_matrix(rules)),
        "audit.html": audit_html(audit(rules, demonstrations), title="Cart Pole"),
    }
    for name, document in written.items():
        (folder / name).write_text(document, encoding="utf-8")
    return [folder / name for name in written]


def test_everybody_can_read_what_is_handed_over(chromium: Browser, documents: list[Path]) -> None:
    context = chromium.new_context(viewport={"width": 1440, "height": 900})
    alone = context.new_page()
    found = {}
    for path in documents:
        alone.goto(path.as_uri())
        for theme, only in THEMES.items():
            alone.emulate_media(color_scheme=theme)
            if against := held_against(alone, {}, only):
                found[f"{path.name} {theme}"] = against
    context.close()
    assert not found, json.dumps(found, indent=1)
