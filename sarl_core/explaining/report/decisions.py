"""What is to be decided about rules: questions on the first page of a report, with reasons."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sarl_core.decimals import telling_text
from sarl_core.explaining.report.certificates import CertificatesPart
from sarl_core.explaining.report.comparison import HARMS, Result, is_known
from sarl_core.explaining.report.gaps import Doubt, UncoveredSummary
from sarl_core.explaining.report.outcomes import (
    MOST_PAIRS,
    FailureLimit,
    Pair,
    failures_at_most,
    failures_share,
)
from sarl_core.explaining.report.rule_set_card import ReportedEpisodes
from sarl_core.explaining.report.tally import Tally
from sarl_core.explaining.words.sign_off import SignOff
from sarl_core.mining.language import counted, listed, share_text

_MOST_DOUBTS = 3
_MOST_NAMES = 4


@dataclass(frozen=True)
class OpenQuestion:
    """One thing that somebody has to decide.

    Attributes:
        question: To be answered with yes or no.
        reason: What speaks for it or against it.
    """

    question: str
    reason: str


def decisions(
    pairs: Sequence[Pair],
    reported: ReportedEpisodes,
    *,
    certified: CertificatesPart,
    gaps: UncoveredSummary,
    counts: Tally,
    sign_off: SignOff | None,
) -> Iterator[OpenQuestion]:
    """What is to be decided about rules.

    Args:
        pairs: What was measured.
        reported: What the card of the rules says.
        certified: What is certified.
        gaps: What the rules do not reach.
        counts: The rules on the demonstrations.
        sign_off: Who approved them; None where it is not known.

    Yields:
        The weightiest first.
    """
    if not pairs:
        yield OpenQuestion(
            "Are the rules to be used without a measurement?",
            "What they do to whoever is held to them is not known.",
        )
    yield from (_of_pair(pair) for pair in pairs[:MOST_PAIRS])
    for limit in failures_at_most(pairs, reported):
        if not certified.holds_for(limit.agent):
            yield _borne(limit)
    if not counts.in_force:
        yield OpenQuestion(
            "Is it right that no rule is in force?", "Every action passes, in every state."
        )
    elif counts.coverage < 1.0:
        yield OpenQuestion(
            "Is it enough that the rules leave the other states alone?",
            f"In {share_text(1.0 - counts.coverage)} of the demonstrated states no rule applies: "
            f"there every action passes{_done_there(gaps)}.",
        )
    if gaps.unused:
        yield OpenQuestion(
            f"Is it right that no rule looks at {gaps.unused}?",
            "Recorded, and the rules decide without.",
        )
    if gaps.doubts:
        yield OpenQuestion(
            "Can the rules that deserve a second look stay as they are?",
            " ".join(_named(doubt) for doubt in gaps.doubts[:_MOST_DOUBTS])
            + (" And others (section 4)." if len(gaps.doubts) > _MOST_DOUBTS else ""),
        )
    if sign_off is not None and not sign_off.approvals:
        yield OpenQuestion("Do you approve the rules as they stand?", "Nobody has yet.")


def _of_pair(pair: Pair) -> OpenQuestion:
    one, alone = pair.shielded, pair.alone
    effects: dict[str, str] = {
        "helps": f"They do better than {pair.agent} alone",
        HARMS: f"They do worse than {pair.agent} alone",
        "no difference seen": f"No difference to {pair.agent} alone was seen",
    }
    question = f"Are the rules to act in place of {pair.agent}?"
    if not pair.is_policy:
        question = f"Is {pair.agent} to act under the rules (“{one.name}”)?"
        effects |= {"helps": "They help it", HARMS: "They harm it"}
    effect = effects.get(one.effect, "What they change is not known")
    against = "" if alone is None else f", against {_numbers(alone)} without them"
    return OpenQuestion(question, f"{effect}: {_numbers(one)}{against}.")


def _borne(limit: FailureLimit) -> OpenQuestion:
    worst = f", the worst of {limit.tests} tests" if limit.tests > 1 else ""
    return OpenQuestion(
        f"Can it be borne that up to {share_text(limit.share)} of the episodes fail when "
        f"{limit.acting}?",
        f"It is the upper end of the 95 % interval of {counted(limit.episodes, 'episode')} "
        f"({limit.test}){worst}. No limit is certified of it.",
    )


def _named(doubt: Doubt) -> str:
    """A doubt and whose it is."""
    first = doubt.names[:_MOST_NAMES]
    others = len(doubt.names) - len(first) + doubt.more
    names = [*first, *([counted(others, "other")] if others else [])]
    return f"{doubt.text.removesuffix('.')} ({listed(names, most=len(names))})."


def _done_there(gaps: UncoveredSummary) -> str:
    """What the expert did most in the states without a rule, where that is a single action."""
    shares = [one.uncovered for one in gaps.coverage if one.uncovered is not None]
    if len(shares) != 1 or not shares[0].rows:
        return ""
    rows = sorted(shares[0].rows, key=lambda row: row.part, reverse=True)[:2]
    most = " and ".join(f"{row.name} ({row.share})" for row in rows if row.part)
    return f". There the expert mostly did {most}"


def _numbers(one: Result) -> str:
    failed = f", {failures_share(one)} failing" if is_known(one) else ""
    return f"mean return {telling_text(one.mean)}{failed}"
