"""What a report says is certified of its rules."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from sarl_core import InputError, RuleSet, load_demonstrations, load_rules, make_report
from sarl_core.explaining.report.certificates import certificates_part
from sarl_core.explaining.report.rule_set_card import read_card
from sarl_core.explaining.words.certificate import LIMITS, certificate_facts
from sarl_core.studies.certificate import Certificate
from sarl_core.studies.certificate_files import certificate_from

DATA = Path(__file__).parents[2] / "data"
RULES = DATA / "rules"


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    return load_rules(RULES / "cartpole_compact.json")


def of_card(name: str) -> Certificate:
    card = json.loads((RULES / f"{name}.card.json").read_text(encoding="utf-8"))
    return certificate_from(card["certificate"], name=name)


@pytest.mark.parametrize(
    ("name", "at_most"),
    [("cartpole_combined", 0.001), ("cartpole_compact", 0.001), ("lunar_lander_combined", 0.02)],
)
def test_shipped_rules_are_certified_on_their_card(name: str, at_most: float) -> None:
    certificate = of_card(name)
    assert certificate.verdict.certified is True
    assert certificate.test.at_most == at_most
    assert f"--rules data/rules/{name}.json" in certificate.command
    card = read_card(RULES / f"{name}.json")
    (table,) = certificates_part(load_rules(RULES / f"{name}.json"), (), card).tables
    assert table[0] == ("Verdict", dict(certificate_facts(certificate))["verdict"])


def test_a_certificate_stands_in_the_report_once_in_short_and_once_in_full(rules: RuleSet) -> None:
    certificate = of_card("cartpole_compact")
    report = make_report(
        rules,
        load_demonstrations(DATA / "demonstrations" / "cartpole.parquet"),
        frames=0,
        card=read_card(RULES / "cartpole_compact.json"),
        certificates=[certificate],
    )
    short, full = report.html.replace("\N{NO-BREAK SPACE}", " ").split('id="worth"')
    assert [part.count("at most 0.1 % of the episodes fail.") for part in (short, full)] == [1, 1]
    assert LIMITS in report.html
    assert "19500000 to 19502994" in report.html


def test_a_certificate_of_other_rules_is_refused_and_left_out_of_a_card(rules: RuleSet) -> None:
    other = of_card("cartpole_combined")
    with pytest.raises(InputError, match="the certificate is of other rules"):
        certificates_part(rules, [other], None)
    card = read_card(RULES / "cartpole_combined.json")
    assert certificates_part(rules, [], card).tables == ()
    for damaged in (None, {}, {"certificate": 3}, {"certificate": {"format": "sarl-certificate"}}):
        assert certificates_part(rules, [], damaged).tables == ()


def test_only_a_certificate_that_holds_says_that_a_limit_is_certified(rules: RuleSet) -> None:
    held = of_card("cartpole_compact")
    part = certificates_part(rules, [held], None)
    assert part.holds_for(None)
    assert part.holds_for(held.subject.agent)
    assert not part.holds_for("somebody else")
    for outcome in (False, None):
        verdict = replace(held.verdict, certified=outcome)
        refused = certificates_part(rules, [replace(held, verdict=verdict)], None)
        assert refused.verdicts
        assert not refused.holds_for(None)
