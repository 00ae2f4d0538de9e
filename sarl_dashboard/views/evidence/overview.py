"""All rules on the page Evidence, and how many of them reach the confidence they have to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import streamlit as st
from markupsafe import Markup

from sarl_core.explaining.html.evidence import overview_plot
from sarl_core.explaining.html.number_cards import Number, number_cards
from sarl_core.explaining.templates import render
from sarl_core.explaining.words.cross_fit import influence_sentences, judged_sentence
from sarl_core.explaining.words.evidence import (
    VERDICT_COLOURS,
    VERDICTS,
    least_text,
    limits_text,
    remedy_text,
    verdict_counts,
    verdicts_text,
)
from sarl_core.mining.evidence import FEWEST_EPISODES
from sarl_core.mining.language import share_text
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.validation.holding_out import Verdict, least_confidence, shortfall
from sarl_dashboard.cache import cached
from sarl_dashboard.views.evidence.evidence import RuleSetEvidence

MOST_DRAWN = 600
MEANINGS: tuple[tuple[Verdict, str], ...] = (
    ("reached", "The whole 95 % interval lies at or above {least}"),
    ("open", "{least} lies within the 95 % interval: not enough is known"),
    ("below", "The whole 95 % interval lies below {least}"),
    ("unknown", f"The rule applied in fewer than {FEWEST_EPISODES} of the held-out episodes"),
)


@cached()
def _overview(evidence: RuleSetEvidence) -> Markup:
    findings = evidence.findings
    return overview_plot(findings.rules[:MOST_DRAWN], evidence.rule_set)


def show_overview(evidence: RuleSetEvidence) -> None:
    """All rules with what is known of them, and how many reach what they have to."""
    findings = evidence.findings
    judged = findings.judged
    at = evidence.thresholds
    least = least_text(at)
    numbers = [Number("Rules", f"{len(findings.rules):,}")]
    sentences = []
    if judged is not None:
        counts = verdict_counts(findings.rules, at)
        share = judged.fidelity.share
        numbers.append(
            Number(
                "Held-out fidelity",
                share_text(math.nan if share is None else share, decimals=1),
                f"Share of the states with a rule in which the expert {_did(at)}, on average over "
                "the held-out episodes",
            )
        )
        numbers += [
            Number(
                VERDICTS[name].capitalize(),
                f"{counts[name]:,}",
                _capitalised(meaning.format(least=least)),
            )
            for name, meaning in MEANINGS
        ]
        sentences = [judged_sentence(judged), *influence_sentences(judged)]
        sentences[:0] = _by_kind(findings.rules, at, evidence.held_out, evidence.episodes)
    verdicts_drawn: tuple[Verdict, ...] = ("reached", "open", "below") if judged is not None else ()
    if len(findings.rules) > MOST_DRAWN:
        sentences.append(
            f"Drawn: the {MOST_DRAWN} rules with the most support, of {len(findings.rules):,}."
        )
    with st.container(key="overview"):  # one piece: each element of its own takes its time
        st.html(
            render(
                "rules/evidence_overview",
                numbers=number_cards(numbers),
                plot=_overview(evidence),
                verdicts=[(VERDICT_COLOURS[name], VERDICTS[name]) for name in verdicts_drawn],
                limits=limits_text(at),
                sentences=sentences,
            )
        )


def _by_kind(rules: Sequence[Rule], at: Thresholds, held_out: int, episodes: int) -> list[str]:
    """How each kind came off, where there are both, and what to do where none reaches its share."""
    sentences = []
    for kind, own in (
        ("demand", replace(at, never=None)),
        ("forbid", replace(at, demands=False)),
    ):
        some = [rule for rule in rules if bool(rule.forbids) == (kind == "forbid")]
        if not some:
            continue
        which = f" that {kind}s" if len(some) < len(rules) else ""
        if which:
            verdicts = verdicts_text(some, at)
            sentences.append(f"Rules that {kind} ({len(some):,}): {verdicts}.")
        short = shortfall(some, least_confidence(some[0], at), held_out)
        remedy = remedy_text(short, episodes)
        if remedy:
            sentences.append(f"No rule{which} reaches {least_text(own)}: {remedy}.")
    return sentences


def _did(at: Thresholds) -> str:
    """What the expert did where the rules are right."""
    if at.never is None:
        return "did what it says"
    if not at.demands:
        return "did nothing that is forbidden there"
    return "did what it demands or, where none demands anything, nothing that is forbidden there"


def _capitalised(text: str) -> str:
    return text[:1].upper() + text[1:]
