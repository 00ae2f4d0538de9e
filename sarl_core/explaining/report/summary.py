"""The first page of a report, for who decides and does not check."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.figures.distributions import feature_rows
from sarl_core.explaining.report.certificates import CertificatesPart
from sarl_core.explaining.report.comparison import Result
from sarl_core.explaining.report.decisions import OpenQuestion, decisions
from sarl_core.explaining.report.demonstrations import within
from sarl_core.explaining.report.gaps import UncoveredSummary
from sarl_core.explaining.report.origin import demonstrated
from sarl_core.explaining.report.outcomes import (
    OutcomeRow,
    certainty,
    effects,
    outcome_rows,
    outcomes_note,
    pairs_of,
)
from sarl_core.explaining.report.rule_set_card import RuleSetCard
from sarl_core.explaining.report.tally import Share, Tally
from sarl_core.explaining.words.sign_off import SignOff
from sarl_core.mining.language import counted, listed, share_text
from sarl_core.mining.rule_set import RuleSet

_AS_SHIELD = (
    "An agent is a program that chooses actions. Used as a shield, rules stand between it and "
    "its task: an action that breaks a rule is replaced by what the rule says, before it is "
    "carried out."
)
_AS_FORBIDDING = (
    "An agent is a program that chooses actions. Used as a shield, rules stand between it and its "
    "task: an action that they forbid is replaced before it is carried out."
)
_AS_EITHER = (
    "An agent is a program that chooses actions. Used as a shield, rules stand between it and its "
    "task: an action that a rule forbids, or that is not the one that a rule demands, is replaced "
    "before it is carried out."
)
_AS_NOTHING = (
    "An agent is a program that chooses actions. Used as a shield, rules stand between it and its "
    "task. None of these is in force, so every action passes."
)
_MOST_RANGES = 4
_AS_POLICY = (
    "These rules name an action in every state that was demonstrated. Whoever is held to them has "
    "nothing left to choose: there the rules decide, in place of a person or a program."
)


@dataclass(frozen=True)
class SummaryPart:
    """The first page.

    Attributes:
        lead: What such rules are, in sentences.
        demonstrated: What the rules come from, likewise.
        effects: What the rules do, likewise.
        outcomes: The same as a picture; () where nothing was measured.
        outcomes_note: How the picture is read.
        certainty: How sure that is.
        uncovered: What the rules do not reach.
        decisions: What is to be decided.
    """

    lead: str
    demonstrated: tuple[str, ...]
    effects: tuple[str, ...]
    outcomes: tuple[OutcomeRow, ...]
    outcomes_note: str
    certainty: tuple[str, ...]
    uncovered: tuple[str, ...]
    decisions: tuple[OpenQuestion, ...]


def summary_part(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    counts: Tally,
    *,
    results: Sequence[Result],
    certified: CertificatesPart,
    gaps: UncoveredSummary,
    elsewhere: Sequence[str],
    card: RuleSetCard,
    sign_off: SignOff | None,
) -> SummaryPart:
    """The first page of a report.

    Args:
        rule_set: The rules.
        demonstrations: They are about.
        counts: The rules on them.
        results: Of a comparison; () without one.
        certified: What is certified.
        gaps: What the rules do not reach.
        elsewhere: How far they match the expert where they were not mined, in sentences.
        card: Of the rules.
        sign_off: Who approved them; None where it is not known.

    Returns:
        The part of the report.
    """
    pairs = pairs_of(results)
    decides = counts.decides
    reported = card.reported_episodes
    return SummaryPart(
        lead=_lead(rule_set, counts),
        demonstrated=demonstrated(rule_set, demonstrations, counts, card),
        effects=tuple(effects(rule_set, pairs, results, reported, decides=decides)),
        outcomes=outcome_rows(pairs, results),
        outcomes_note=outcomes_note(results),
        certainty=(
            *certainty(pairs, results, reported),
            *certified.verdicts,
            *_match(rule_set, demonstrations, counts, elsewhere),
        ),
        uncovered=tuple(_uncovered(counts, gaps, rule_set, demonstrations)),
        decisions=tuple(
            decisions(
                pairs, reported, certified=certified, gaps=gaps, counts=counts, sign_off=sign_off
            )
        ),
    )


def _lead(rule_set: RuleSet, counts: Tally) -> str:
    if counts.decides:
        return _AS_POLICY
    kinds = {rule.kind for rule in rule_set.rules if rule.enabled}
    if len(kinds) > 1:
        return _AS_EITHER
    return {"do": _AS_SHIELD, "never": _AS_FORBIDDING}[kinds.pop()] if kinds else _AS_NOTHING


def _match(
    rule_set: RuleSet, demonstrations: Demonstrations, counts: Tally, elsewhere: Sequence[str]
) -> Iterator[str]:
    """How far the rules match the expert, which is not what they achieve."""
    known = [text for text in elsewhere if text]
    if known:
        yield f"How far the rules match the expert, not what they achieve: {known[0]}"
        yield from known[1:]
    held_out = [rule.held_out for rule in rule_set.rules if rule.enabled and rule.held_out]
    tried = Share(sum(one.correct for one in held_out), sum(one.samples for one in held_out))
    if counts.split and tried.whole:
        aside = counted(demonstrations.n_episodes - rule_set.source.episodes, "episode")
        yield (
            "How far the rules match the expert, not what they achieve: in the "
            f"{aside} kept aside it did what they say in {tried.part:,} of "
            f"{counted(tried.whole, 'state')} with a rule ({share_text(tried.value)}; there long "
            "episodes count more than short ones)."
        )


def _uncovered(
    counts: Tally, gaps: UncoveredSummary, rule_set: RuleSet, demonstrations: Demonstrations
) -> Iterator[str]:
    if counts.coverage < 1.0:
        yield (
            f"In {share_text(1.0 - counts.coverage)} of the demonstrated states no rule applies: "
            "there every action passes."
        )
    if ranges := _ranges(rule_set, demonstrations):
        yield f"Demonstrated: {ranges}. Beyond that most rules speak all the same."
    outside = [one for one in gaps.beyond if one.outside_share > 0]
    if outside:
        steps = " and ".join(f"{one.outside} of the steps of {one.player}" for one in outside)
        yield (
            "Beyond what was demonstrated: in the few episodes played for the pictures, in "
            f"{steps} some number of the state lay outside all demonstrated ones. The rules act "
            "there all the same."
        )
    yield (
        "States that nobody demonstrated, another task or other sensors are not covered; nothing "
        "here proves that following the rules avoids harm."
    )
    unsaid = [
        what
        for what, known in (
            ("in which environment or on which machine they were recorded", demonstrations.env_id),
            ("who the expert was", demonstrations.agent),
        )
        if not known
    ]
    if unsaid:
        yield f"The demonstrations do not say {' and '.join(unsaid)}."
    if gaps.unused:
        yield f"No rule looks at {gaps.unused}."
    if counts.leeway is not None:
        yield (
            "What the expert was not shown to do is not unsafe for that, and what no rule forbids "
            "is not safe for that."
        )


def _ranges(rule_set: RuleSet, demonstrations: Demonstrations) -> str:
    """From where to where the numbers went that most rules ask about, where they are observed."""
    features = demonstrations.features
    uses = Counter(
        bounds.feature
        for rule in rule_set.rules
        for bounds in (rule.bounds if rule.enabled else ())
        if features[bounds.feature].derived is None and features[bounds.feature].indicator is None
    )
    most = [index for index, _ in uses.most_common(_MOST_RANGES)]
    rows = feature_rows(demonstrations) if most else ()
    texts = [
        f"{rows[index].name} {within(rows[index].low, rows[index])} to "
        f"{within(rows[index].high, rows[index])}"
        f"{f' {features[index].unit}' if features[index].unit else ''}"
        for index in sorted(most)
    ]
    return listed(texts, most=_MOST_RANGES)
