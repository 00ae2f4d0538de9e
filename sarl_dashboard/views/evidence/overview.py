"""All rules on the page Evidence, and how many of them reach the confidence they have to."""

from __future__ import annotations

import math

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
    remedy_text,
    verdict_counts,
)
from sarl_core.mining.evidence import FEWEST_EPISODES
from sarl_core.mining.language import share_text
from sarl_core.mining.validation.holding_out import Verdict, shortfall
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
    return overview_plot(findings.rules[:MOST_DRAWN], evidence.rule_set, findings.threshold)


def show_overview(evidence: RuleSetEvidence) -> None:
    """All rules with what is known of them, and how many reach what they have to."""
    findings = evidence.findings
    judged = findings.judged
    forbids = evidence.thresholds.never is not None
    least = least_text(evidence.thresholds)
    did = "did nothing that is forbidden there" if forbids else "did what it says"
    numbers = [Number("Rules", f"{len(findings.rules):,}")]
    sentences = []
    if judged is not None:
        counts = verdict_counts(findings.rules, findings.threshold)
        share = judged.fidelity.share
        numbers.append(
            Number(
                "Held-out fidelity",
                share_text(math.nan if share is None else share, decimals=1),
                f"Share of the states with a rule in which the expert {did}, on average over the "
                "held-out episodes",
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
        short = shortfall(findings.rules, findings.threshold, evidence.held_out)
        remedy = remedy_text(short, evidence.episodes)
        if remedy:
            sentences.insert(0, f"No rule reaches {least}: {remedy}.")
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
                least=least,
                threshold=share_text(findings.threshold),
                sentences=sentences,
            )
        )


def _capitalised(text: str) -> str:
    return text[:1].upper() + text[1:]
