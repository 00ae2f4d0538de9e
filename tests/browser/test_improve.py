"""The page Improve in a browser, and the compact rules on the pages that show rules."""

from __future__ import annotations

import json
from pathlib import Path

from playwright.sync_api import Page, expect

from sarl_core import RuleSet, load_demonstrations
from tests.browser.walking import metric, no_trace, parameters, rules_choice, settle, visit

SMALL = "data=cartpole&max_rules=4&rounds=1&round_episodes=2&validation=16"
RULES = Path(__file__).parents[2] / "data" / "rules"


def test_rules_are_improved_and_taken_away(screen: Page, tmp_path: Path) -> None:
    visit(screen, f"/improve?{SMALL}", "Improve")
    expect(screen.get_by_text("press Run")).to_be_visible()
    screen.get_by_role("button", name="Run", exact=True).click()
    expect(screen.get_by_text("All done already")).to_be_visible()
    settle(screen)
    expect(screen.get_by_text("100 fresh episodes").last).to_be_visible()
    expect(screen.locator(".js-plotly-plot .subplot")).to_have_count(4)
    taken = {}
    for label, name in (
        ("Rules", "rules.json"),
        ("Card", "card.json"),
        ("Demonstrations", "d.parquet"),
    ):
        with screen.expect_download() as started:
            screen.get_by_role("button", name=label, exact=True).click()
        taken[label] = tmp_path / name
        started.value.save_as(taken[label])
    rules = RuleSet.load(taken["Rules"])
    card = json.loads(taken["Card"].read_text())
    pairs = load_demonstrations(taken["Demonstrations"])
    assert len(rules) == card["rules"] == int(metric(screen, "Rules")) <= 4
    assert rules.source.digest == card["demonstrations"]["digest"]
    assert len(pairs) == rules.source.steps
    assert "--max-rules 4" in card["command"]
    assert f"{card['reported']['mean']:,.1f}" == metric(screen, "Mean return")
    no_trace(screen)


def test_compact_rules_are_in_force_until_a_threshold_moves(screen: Page) -> None:
    rules = RuleSet.load(RULES / "lunar_lander_compact.json")
    visit(screen, "/thresholds?data=lunar_lander", "Thresholds")
    ring = "getComputedStyle(document.querySelector('.st-key-box_rule_count'), '::after').display"
    assert screen.evaluate(ring) != "none"
    filtered = metric(screen, "Rules")
    screen.get_by_role("button", name="Compact", exact=True).click()
    expect(rules_choice(screen)).to_have_value("Compact rules")
    settle(screen)
    assert metric(screen, "Rules") == str(len(rules))
    assert metric(screen, "Coverage") == "100 %"
    assert parameters(screen)["set"] == "compact"
    assert screen.evaluate(ring) == "none"
    slider = screen.get_by_role("slider", name="Minimum confidence")
    for _ in range(12):
        slider.press("ArrowLeft")
    expect(rules_choice(screen)).to_have_value("At the thresholds")
    settle(screen)
    screen.wait_for_url(lambda url: "set=" not in url)
    assert screen.evaluate(ring) != "none"
    assert metric(screen, "Rules") not in (filtered, str(len(rules)))
    # A click on a map does the same.
    screen.get_by_role("button", name="Compact", exact=True).click()
    expect(rules_choice(screen)).to_have_value("Compact rules")
    settle(screen)
    screen.locator(".st-key-map_rule_count .nsewdrag").click(position={"x": 60, "y": 40})
    expect(rules_choice(screen)).to_have_value("At the thresholds")
    settle(screen)
    assert screen.evaluate(ring) != "none"
    # They go along to the rules.
    screen.get_by_role("button", name="Compact", exact=True).click()
    expect(rules_choice(screen)).to_have_value("Compact rules")
    settle(screen)
    screen.get_by_role("link", name="All rules, with the evidence behind each").click()
    expect(screen.get_by_text(f"{len(rules)} compact rules")).to_be_visible()
    no_trace(screen)
