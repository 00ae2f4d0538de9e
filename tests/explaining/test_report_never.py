"""Reports of rules that forbid."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, RuleSet, load_demonstrations, load_rules
from sarl_core.demonstrations.recoding import recoded
from sarl_core.explaining.report.report import Report, make_report
from sarl_core.explaining.report.tally import tally
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.language import share_text
from sarl_core.mining.never.never_rules import mine_never_rules, with_never_rules
from sarl_core.shielding.leeway import leeway_of

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(scope="module")
def landings() -> Demonstrations:
    whole = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")
    return whole.select(whole.episodes[whole.episode_starts][:12])


@pytest.fixture(scope="module")
def mined(landings: Demonstrations) -> RuleSet:
    return mine_never_rules(grow_policy_trees(landings), epsilon=0.1, supp_min=0.02)


@pytest.fixture(scope="module")
def probed() -> RuleSet:
    return load_rules(DATA / "rules" / "lunar_lander_never.json")


def words(report: Report) -> str:
    text = re.sub(r"<style.*?</style>|<svg.*?</svg>", "", report.html, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", "", text))


def test_a_rule_that_forbids_counts_where_the_expert_did_otherwise(
    mined: RuleSet, landings: Demonstrations
) -> None:
    counts = tally(mined, landings)
    for rule, share in zip(mined.rules, counts.shares, strict=True):
        holds = rule.applies(landings.observations)
        did = np.isin(landings.action_columns[holds, 0], rule.forbids)
        assert share == (int((~did).sum()), int(holds.sum()))
        assert share == (rule.correct, rule.samples)
    leeway = leeway_of(mined, landings)
    assert counts.followed.value == pytest.approx(leeway.fidelity)
    assert counts.coverage == pytest.approx(leeway.coverage)


def test_the_report_of_mined_never_rules_says_what_they_forbid_and_leave(
    mined: RuleSet, landings: Demonstrations
) -> None:
    text = words(make_report(mined, landings, frames=0))
    leeway = leeway_of(mined, landings)
    assert "The rules forbid: each says what not to do" in text
    assert f"{share_text(leeway.freedom)} of the choice is left" in text
    assert f"in {share_text(leeway.fidelity)} of these the expert did as they say" in text
    first = max(mined.rules, key=lambda rule: rule.support)
    assert f"The expert did not in {first.correct:,} of {first.samples:,} states" in text
    assert "is not unsafe for that" in text
    assert "is not drawn here" in text
    assert "judged by rules mined without it" in text
    assert "did so in" not in text
    assert "--never" not in text


def test_the_report_of_probed_rules_counts_failures_and_what_the_expert_did(
    probed: RuleSet, landings: Demonstrations
) -> None:
    report = make_report(probed, landings, frames=0, in_full=3)
    text = words(report)
    assert "19 rules in plain language come from probes" in text
    again = recoded(landings, probed.source.features, called="the demonstrations")
    counts = tally(probed, again)
    first = max(probed.rules, key=lambda rule: rule.support)
    share = counts.shares[probed.rules.index(first)]
    assert f"After it the expert failed in {first.correct:,} of {first.samples:,} states" in text
    assert f"of all together: {share.part:,} of {share.whole:,} states" in text
    assert "failed after it in" in text  # in the table
    assert "did so in" not in text
    assert "19 rules in plain language come from probes" in re.sub(r"\s+", " ", report.slides)


def test_rules_that_demand_and_forbid_stand_in_one_report(landings: Demonstrations) -> None:
    trees = grow_policy_trees(landings)
    both = with_never_rules(mine_rules(trees, supp_min=0.02, conf_min=0.95), trees, 0.1)
    kinds = {rule.kind for rule in both.rules}
    assert kinds == {"do", "never"}
    forbidding = sum(rule.kind == "never" for rule in both.rules)
    text = words(make_report(both, landings, frames=0))
    assert f"{len(both):,} rules in plain language, of which {forbidding:,} forbid" in text
    assert "The expert did so in" in text
    assert "The expert did not in" in text
    assert "an action that a rule forbids, or that is not the one that a rule demands, is" in text
    demanding = replace(
        both, rules=tuple(replace(rule, enabled=not rule.forbids) for rule in both.rules)
    )
    text = words(make_report(demanding, landings, frames=0))
    assert "an action that breaks a rule is replaced by what the rule says" in text
    assert "of which 0 forbid" not in text
    counts = tally(both, landings)
    assert counts.followed.value == pytest.approx(leeway_of(both, landings).fidelity)
