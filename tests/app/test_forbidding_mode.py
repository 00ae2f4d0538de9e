"""Rules that forbid at thresholds: the mode on Thresholds, and what follows from it elsewhere."""

from __future__ import annotations

import re
import time
from dataclasses import replace
from functools import partial
from html import unescape
from pathlib import Path

import pytest

from sarl_core import RuleSet, grow_policy_trees, load_demonstrations, mine_rules
from sarl_core.explaining.report.provenance import mined_again, mining_command
from sarl_core.explaining.words.cross_fit import judged_sentence
from sarl_core.explaining.words.evidence import (
    VERDICTS,
    held_out_text,
    more_text,
    verdict_counts,
    verdicts_text,
)
from sarl_core.mining.editing.edits import Add, Switch, apply
from sarl_core.mining.editing.manual_rules import Ask, manual_rule
from sarl_core.mining.language import share_text
from sarl_core.mining.never.never_rules import (
    mine_at,
    mine_never_rules,
    never_thresholds,
    with_never_rules,
)
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.validation.cross_fitting import cross_fit, judge_pairs
from sarl_core.mining.validation.holding_out import hold_out, more_episodes, with_held_out
from sarl_core.shielding.leeway import leeway_of
from sarl_core.shipped import DATA
from tests.app.screens import errors, html, metrics, open_page, page_file, texts

LANDER = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")
FORBID = {"data": "lunar_lander", "mode": "forbid", "epsilon": "0.1", "support": "0.01"}


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    return mine_never_rules(LANDER, epsilon=0.1, supp_min=0.01)


def test_the_numbers_are_those_of_mining(rules: RuleSet) -> None:
    app = open_page("thresholds", **FORBID)
    leeway, shown = leeway_of(rules, LANDER), metrics(app)
    assert shown["Rules"] == f"{len(rules)}"
    for name in ("coverage", "fidelity", "freedom"):
        assert shown[name.title()] == share_text(getattr(leeway, name), decimals=1)
    assert list(app.dataframe[0].value["Rule"]) == [
        rules.name_of(rule) for rule in sorted(rules, key=lambda rule: -rule.samples)
    ]
    assert "Best trade-offs" not in [tab.label for tab in app.tabs]


def test_the_mode_is_chosen_and_both_thresholds_stay() -> None:
    app = open_page("thresholds", data="lunar_lander", confidence="0.9")
    before = metrics(app)
    app.button_group(key="_mode_choice").set_value("forbid").run()
    assert app.query_params["mode"] == "forbid"
    app.select_slider(key="epsilon").set_value(0.1).run()
    assert "Freedom" in metrics(app)
    app.switch_page(page_file("rules")).run()
    assert not app.exception
    # A part of the address of every page, as is the confidence that is set aside.
    for name, value in (("mode", "forbid"), ("epsilon", "0.1"), ("confidence", "0.9")):
        assert app.query_params[name] == value
    app.switch_page(page_file("thresholds")).run()
    app.button_group(key="_mode_choice").set_value("demand").run()
    assert "mode" not in app.query_params
    assert metrics(app) == before


@pytest.mark.parametrize("view", ["Maps", "3-D"])
@pytest.mark.parametrize("left", ["Rules and freedom", "Coverage and fidelity"])
def test_every_way_to_look_at_them_is_drawn(view: str, left: str) -> None:
    app = open_page("thresholds", view=view, left=left, **FORBID)
    assert len(app.get("plotly_chart")) == 2


def test_no_rule_is_said_to_be_none() -> None:
    app = open_page("thresholds", **(FORBID | {"epsilon": "0.001", "support": "0.9"}))
    assert metrics(app)["Rules"] == "0"
    assert metrics(app)["Freedom"] == "100 %"
    assert "raise epsilon" in texts(app)
    rules = open_page("rules", **(FORBID | {"epsilon": "0.001", "support": "0.9"}))
    assert "nothing is forbidden" in texts(rules)


@pytest.mark.parametrize("epsilon", ["0", "1", "-1", "x", "nan"])
def test_an_epsilon_that_is_none_is_left_out_of_the_link(epsilon: str) -> None:
    app = open_page("thresholds", **(FORBID | {"epsilon": epsilon}))
    assert "epsilon" not in app.query_params
    assert app.select_slider(key="epsilon").value == 0.05


def test_the_rules_flow_to_the_other_pages(rules: RuleSet) -> None:
    app = open_page("rules", **FORBID)
    assert len(app.dataframe[0].value) == len(rules)
    assert "From the root to the rule" in html(app)
    assert "epsilon **0.1**" in texts(app)
    command = mining_command(rules, "rules.json", "lander.parquet", LANDER)
    assert command is not None
    assert command.endswith(" mine lander.parquet --support 0.01 --never 0.1 --out rules.json")
    trees = grow_policy_trees(LANDER)
    assert mined_again(rules, trees)
    assert not mined_again(replace(rules, rules=rules[1:]), trees)
    for page in ("what_if", "episodes", "overview", "names", "export"):
        assert not errors(open_page(page, **FORBID))


def test_continuous_actions_are_forbidden_by_intervals() -> None:
    app = open_page("thresholds", data="bipedal_walker", mode="forbid", divider="4")
    assert int(metrics(app)["Rules"].replace(",", "")) > 0
    chosen = open_page("what_if", data="bipedal_walker", mode="forbid", divider="4")
    found = re.findall(r"Forbidden here: .*? Freedom (\d+) %", html(chosen))
    assert all(0 <= int(one) <= 100 for one in found)


def test_evidence_says_of_held_out_episodes_what_the_command_says() -> None:
    """The numbers of the guide: 16 rules, of which the whole interval of one lies above 90 %."""
    app = open_page("evidence", **FORBID, holdout="0.3")
    split = hold_out(LANDER, 0.3)
    rules = with_held_out(mine_never_rules(split.mined, epsilon=0.1, supp_min=0.01), split.held_out)
    counts = verdict_counts(rules.rules, rules.thresholds)
    assert (len(rules), counts["reached"], counts["below"]) == (16, 1, 0)
    judged = judge_pairs(rules, split.held_out)
    assert judged.fidelity.share is not None
    shown = metrics(app)
    assert shown["Held-out fidelity"] == share_text(judged.fidelity.share, decimals=1)
    for name in ("reached", "open", "below", "unknown"):
        assert shown[VERDICTS[name].capitalize()] == str(counts[name])
    assert judged_sentence(judged) in html(app)
    table = app.dataframe[0].value
    assert table["Held out"].tolist() == [
        held_out_text(rule.held_out) for rule in sorted(rules, key=lambda rule: -rule.samples)
    ]
    assert "would reach 1 − epsilon" in html(app)
    assert "in at least 90 % of the states" in texts(app)
    assert "minimum confidence" not in html(app) + texts(app)


@pytest.mark.usefixtures("elsewhere")
def test_all_rules_that_forbid_are_judged_in_episodes_that_they_were_not_mined_from() -> None:
    app = open_page("evidence", data="cartpole", mode="forbid", epsilon="0.1", support="0.01")
    shown = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")
    mine = partial(mine_never_rules, epsilon=0.1, supp_min=0.01)
    sentence = judged_sentence(cross_fit(shown).of(mine))
    for _ in range(300):
        app.run()
        if sentence in html(app):
            break
        time.sleep(0.2)
    assert sentence in html(app)
    app.switch_page(page_file("thresholds")).run()
    assert sentence in html(app)
    fidelity = leeway_of(mine(shown), shown).fidelity
    assert metrics(app)["Fidelity"] == share_text(fidelity, decimals=1)
    deltas = {metric.label: metric.delta for metric in app.metric if metric.delta}
    assert deltas["Fidelity"].startswith("elsewhere ")


def test_compare_counts_them_as_thresholds_does(rules: RuleSet) -> None:
    """92.4 % here and there, by states."""
    app = open_page("difference", sets="in force|unfiltered", **FORBID)
    leeway = leeway_of(rules, LANDER)
    (line,) = re.findall(r"<tr><td[^>]*>in force</td>(.*?)</tr>", html(app))
    cells = [unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", line)]
    assert cells[2:] == [
        share_text(one) for one in (leeway.coverage, leeway.fidelity, leeway.freedom)
    ]
    assert metrics(open_page("thresholds", **FORBID))["Fidelity"] == share_text(
        leeway.fidelity, decimals=1
    )


def test_rules_that_forbid_are_edited_and_in_force_on_every_page(rules: RuleSet) -> None:
    app = open_page("edit", **FORBID)
    leeway = leeway_of(rules, LANDER)
    for name in ("coverage", "fidelity", "freedom"):
        assert metrics(app)[name.title()] == share_text(getattr(leeway, name), decimals=1)
    (largest,) = sorted(rules, key=lambda rule: -rule.samples)[:1]
    # Another bound: a copy of the rule is changed, and the rule itself is switched off.
    app.button(key="copy_rule").click().run()
    (bound,) = [one for one in app.number_input if one.key.endswith("_at_0")]
    assert bound.value == largest.conditions[0].threshold
    bound.set_value(-0.3).run()
    (save,) = [one for one in app.button if one.key.endswith("_save")]
    assert "It would have a say in" in texts(app)
    save.click().run()
    app.query_params["rule"] = largest.id
    app.run()
    app.button(key="edit_switch").click().run()
    asks = [Ask("vertical velocity", "<=", -0.3)]
    by_hand = manual_rule(
        rules,
        asks,
        rule_id="manual.1",
        action=None,
        forbids=largest.forbids,
        demonstrations=LANDER,
    )
    expected = leeway_of(apply(rules, [Add(by_hand), Switch(largest.id, on=False)]), LANDER)
    for name in ("coverage", "fidelity", "freedom"):
        assert metrics(app)[name.title()] == share_text(getattr(expected, name), decimals=1)
    assert "2 edits" in texts(app)
    for page in ("rules", "what_if", "difference", "export", "report", "shield"):
        app.switch_page(page_file(page)).run()
        assert not app.exception
        assert not errors(app), page
        assert "edits" in app.query_params


def test_evidence_holds_each_of_both_kinds_against_its_own_share() -> None:
    app = open_page("evidence", **BOTH, holdout="0.3")
    split = hold_out(LANDER, 0.3)
    rules = with_held_out(mine_at(grow_policy_trees(split.mined), AT_BOTH), split.held_out)
    demanding = [rule for rule in rules if not rule.forbids]
    forbidding = [rule for rule in rules if rule.forbids]
    judged, shown = judge_pairs(rules, split.held_out), metrics(app)
    assert judged.fidelity.share is not None
    assert shown["Rules"] == str(len(rules))
    assert shown["Held-out fidelity"] == share_text(judged.fidelity.share, decimals=1)
    apart = [
        verdict_counts(demanding, Thresholds(0.005, 0.95)),
        verdict_counts(forbidding, never_thresholds(0.1)),
    ]
    for name in ("reached", "open", "below", "unknown"):
        assert shown[VERDICTS[name].capitalize()] == str(sum(one[name] for one in apart))
    read = unescape(html(app))
    assert judged_sentence(judged) in read
    for kind, some in (("demand", demanding), ("forbid", forbidding)):
        verdicts = verdicts_text(some, AT_BOTH)
        assert f"Rules that {kind} ({len(some)}): {verdicts}." in read
    ordered = [
        rule for some in (demanding, forbidding) for rule in sorted(some, key=lambda r: -r.samples)
    ]
    table = app.dataframe[0].value
    assert list(table["Rule"]) == [rules.name_of(rule) for rule in ordered]
    episodes = LANDER.n_episodes
    assert list(table["Still missing"]) == [
        more_text(one)
        for some, at in (
            (ordered[: len(demanding)], Thresholds(0.005, 0.95)),
            (ordered[len(demanding) :], never_thresholds(0.1)),
        )
        for one in more_episodes(some, episodes, at)
    ]
    assert "in at least 90 % of the states" in texts(app)
    assert "those that forbid have no say" in texts(app)


BOTH = FORBID | {"mode": "both", "confidence": "0.95", "support": "0.005"}
AT_BOTH = Thresholds(0.005, 0.95, never=0.1)


def test_rules_that_demand_with_others_behind_them(tmp_path: Path) -> None:
    """At these thresholds the command `mine --never 0.1` gives the same."""
    trees = grow_policy_trees(LANDER)
    demanding = mine_rules(trees, supp_min=0.005, conf_min=0.95)
    both = with_never_rules(demanding, trees, 0.1)
    leeway = leeway_of(both, LANDER)
    app = open_page("thresholds", **BOTH)
    shown = metrics(app)
    assert shown["Rules"] == str(len(both))
    for name in ("coverage", "fidelity", "freedom"):
        assert shown[name.title()] == share_text(getattr(leeway, name), decimals=1)
    assert "of the rules that demand alone" in texts(app)
    app.switch_page(page_file("rules")).run()
    assert len(app.dataframe[0].value) == len(both)
    assert app.query_params["mode"] == "both"
    assert "Rules that **forbid** behind, epsilon **0.1**" in texts(app)
    for page in (
        "what_if",
        "replay",
        "shield",
        "export",
        "report",
        "difference",
        "edit",
        "overview",
    ):
        app.switch_page(page_file(page)).run()
        assert not app.exception
        assert not errors(app), page
    # What a file says is what its thresholds mean: both kinds, or one.
    for rules in (both, demanding, mine_never_rules(trees, epsilon=0.1, supp_min=0.005)):
        rules.save(tmp_path / "rules.json")
        loaded = RuleSet.load(tmp_path / "rules.json")
        assert loaded.thresholds == rules.thresholds
        assert mined_again(loaded, trees)
        assert mine_at(trees, loaded.thresholds).digest == rules.digest
