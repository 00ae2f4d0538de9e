"""The first page of a report, for who decides and does not check."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from sarl_core.decimals import telling_text
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.report.certificates import CertificatesPart
from sarl_core.explaining.report.comparison import HARMS, Result, is_known, typical_scale
from sarl_core.explaining.report.gaps import UncoveredSummary
from sarl_core.explaining.report.svg import MUTED, NEUTRAL, dot_and_interval, evidence_bar
from sarl_core.explaining.report.tally import Tally
from sarl_core.explaining.words.comparison import POLICY_TEXT
from sarl_core.explaining.words.sign_off import SignOff
from sarl_core.mining.language import at_least_text, counted, number_text, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.rollouts.seeds import FRESH
from sarl_core.shielding.leeway import Leeway

MOST_PAIRS = 2  # as many fit on the first page; all stand in the comparison itself


@dataclass(frozen=True)
class Pair:
    """One agent with the rules and without, on the same seeds.

    Attributes:
        alone: Without; None where that was not run.
        shielded: With them.
    """

    alone: Result | None
    shielded: Result

    @property
    def agent(self) -> str:
        """Who acts, as a sentence begins with it."""
        return f"the {self.shielded.agent}" if self.shielded.agent else "the agent"


@dataclass(frozen=True)
class OutcomeRow:
    """A result as the first page draws it.

    Attributes:
        name: Of agent and shield.
        failures: SVG of the share of episodes that failed; None where it is not known.
        failures_text: In words.
        typical: SVG of the typical return.
        typical_text: In words.
    """

    name: str
    failures: Markup | None
    failures_text: str
    typical: Markup
    typical_text: str


@dataclass(frozen=True)
class SummaryPart:
    """The first page.

    Attributes:
        demonstrated: What the rules come from, in sentences.
        effects: What the rules do, likewise.
        outcomes: The same as a picture; () where nothing was measured.
        certainty: How sure that is.
        uncovered: What the rules do not reach.
        decisions: What is to be decided.
    """

    demonstrated: tuple[str, ...]
    effects: tuple[str, ...]
    outcomes: tuple[OutcomeRow, ...]
    certainty: tuple[str, ...]
    uncovered: tuple[str, ...]
    decisions: tuple[str, ...]


def summary_part(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    counts: Tally,
    *,
    results: Sequence[Result],
    certified: CertificatesPart,
    gaps: UncoveredSummary,
    elsewhere: Sequence[str],
    achieved: str,
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
        elsewhere: What they are worth where they were not mined, in sentences.
        achieved: What an agent that follows them achieved where they were made, as a sentence; ""
            where it is not known.
        sign_off: Who approved them; None where it is not known.

    Returns:
        The part of the report.
    """
    pairs = pairs_of(results)
    env_id = demonstrations.env_id or rule_set.source.env_id
    return SummaryPart(
        demonstrated=_demonstrated(rule_set, demonstrations, counts),
        effects=_effects(rule_set, pairs, results, env_id, achieved),
        outcomes=_outcomes(pairs),
        certainty=(*_certainty(pairs), *certified.verdicts, *(text for text in elsewhere if text)),
        uncovered=_uncovered(counts, gaps),
        decisions=tuple(_decisions(pairs, certified, gaps, counts, sign_off)),
    )


def pairs_of(results: Sequence[Result]) -> tuple[Pair, ...]:
    """Each shielded result beside that of the same agent without a shield.

    Args:
        results: Any number.

    Returns:
        Those with a shield, in their order; only what is known to be of the same agent, or is the
        only one of its kind in files that name no agent, and on the same seeds, stands beside it.
    """
    alone = [one for one in results if one.changed is None]
    shielded = [one for one in results if one.changed is not None]
    nameless = len(alone) == len(shielded) == 1

    def beside(one: Result) -> Result | None:
        for other in alone:
            same = other.agent == one.agent and (one.agent or nameless)
            if same and (other.env_id, other.seed, other.episodes) == (
                one.env_id,
                one.seed,
                one.episodes,
            ):
                return other
        return None

    return tuple(Pair(beside(one), one) for one in shielded)


# --- what was shown, and what the rules do -----------------------------------------------------


def _demonstrated(
    rule_set: RuleSet, demonstrations: Demonstrations, counts: Tally
) -> tuple[str, ...]:
    whole = demonstrations.whole
    who = f"The agent “{demonstrations.agent}”" if demonstrations.agent else "An expert"
    where = f" in {demonstrations.env_id}" if demonstrations.env_id else ""
    rules = counted(sum(rule.enabled for rule in rule_set.rules), "rule")
    acted = (
        f"{who} acted{where} for {counted(whole.steps, 'step')} in "
        f"{counted(whole.episodes, 'episode')}."
    )
    if counts.leeway is not None:
        return tuple(_demonstrated_forbidding(rule_set, acted, counts, counts.leeway))
    followed = counts.followed
    share = (
        f", and it did what the rule says in {share_text(followed.value)} of these"
        if followed.whole
        else ""
    )
    return (
        f"{acted} From what it did came {rules} in plain language. "
        f"A rule applies in {share_text(counts.coverage)} of the states{share}.",
    )


def _demonstrated_forbidding(
    rule_set: RuleSet, acted: str, counts: Tally, leeway: Leeway
) -> Iterator[str]:
    """What was shown where rules forbid, and what they leave."""
    rules = [rule for rule in rule_set.rules if rule.enabled]
    forbidding = sum(bool(rule.forbids) for rule in rules)
    probed = any(rule.origin == "probed" for rule in rules)
    which = (
        f"{counted(len(rules), 'rule')} in plain language"
        if forbidding == len(rules)
        else f"{counted(len(rules), 'rule')} in plain language, of which {forbidding:,} forbid"
    )
    origin = (
        f"{which} come from probes: in states that an agent came to each action was tried, and the "
        "expert went on from there"
        if probed
        else f"From what it did came {which}"
    )
    yield f"{acted} {origin[0].upper()}{origin[1:]}."
    what = (
        "The rules forbid: each says what not to do in some states, and leaves the rest to the "
        "agent."
        if forbidding == len(rules)
        else "A rule that forbids says what not to do in some states, and leaves the rest to the "
        "agent."
    )
    followed = counts.followed
    share = (
        f", and in {share_text(followed.value)} of these the expert did as they say"
        if followed.whole
        else ""
    )
    yield (
        f"{what} A rule applies in {share_text(counts.coverage)} of the states{share}. "
        f"{share_text(leeway.freedom)} of the choice is left in the demonstrated states (freedom: "
        "100 % is all actions everywhere, 0 % a single one)."
    )


def _effects(
    rule_set: RuleSet,
    pairs: Sequence[Pair],
    results: Sequence[Result],
    env_id: str,
    achieved: str,
) -> tuple[str, ...]:
    if not pairs:
        lacking = (
            "Nothing was measured for this report"
            if not results
            else "No agent was measured under the rules"
        )
        unknown = (
            f"{lacking}: whether these rules help an agent or harm it is not known from it. "
            f"{_how_to_measure(env_id)}"
        )
        return (achieved, unknown) if achieved else (unknown,)
    sentences = [_effect(pair) for pair in pairs[:MOST_PAIRS]]
    if len(pairs) > MOST_PAIRS:
        sentences.append(f"Section 5 has all {counted(len(pairs), 'comparison')}.")
    ours = sum(rule.enabled for rule in rule_set.rules)
    others = sorted({pair.shielded.rules for pair in pairs if pair.shielded.rules} - {ours})
    if others:
        numbers = " and ".join(f"{number:,}" for number in others)
        sentences.append(
            f"Some of this was measured with {numbers} rules, and these are {ours:,}: see whether "
            "it was these."
        )
    if any(pair.shielded.freedom == 0.0 for pair in pairs):
        sentences.append(f"{POLICY_TEXT}.")
    return tuple(sentences)


def _how_to_measure(env_id: str) -> str:
    if not env_id:
        return (
            "The demonstrations name no environment to run one in. Hold the rules against a log of "
            "what somebody did (“sarl audit”), or run an agent in a simulation of yours with the "
            "rules and without (“sarl evaluate --env”), and add the results with “--comparison”."
        )
    return (
        "To know it, run an agent with the rules and without on the same seeds, on the page "
        f"Measure or with “sarl evaluate --env {env_id} --agent novice --seed {FRESH} --json”, "
        "once with “--rules” and once without, and add both results with “--comparison”."
    )


def _effect(pair: Pair) -> str:
    """What the rules did to one agent, as a sentence."""
    one, alone = pair.shielded, pair.alone
    name = f"With the rules (“{one.name}”)"
    if alone is None:
        failed = f", and {_failures(one)} of its episodes failed" if is_known(one) else ""
        return (
            f"{name} the mean return of {pair.agent} was {telling_text(one.mean)}{failed}. "
            "Without them it was not run on the same seeds, so what they change is not known."
        )
    means = f"was {telling_text(one.mean)} instead of {telling_text(alone.mean)} without them"
    failed = ""
    if is_known(one) and is_known(alone):
        before, after = _failures(alone), _failures(one)
        failed = (
            f", and {after} of its episodes failed, as without"
            if before == after
            else f", and {after} instead of {before} of its episodes failed"
        )
    meanings: dict[str, str] = {
        "helps": ": the rules help it",
        HARMS: ": these rules harm it",
        "no difference seen": ": no difference that is more than chance",
    }
    return f"{name} the mean return of {pair.agent} {means}{failed}{meanings.get(one.effect, '')}."


def _failures(one: Result) -> str:
    return at_least_text(one.crashes or 0.0, one.undecided)


def _outcomes(pairs: Sequence[Pair]) -> tuple[OutcomeRow, ...]:
    rows: list[Result] = []
    for pair in pairs[:MOST_PAIRS]:
        rows += [one for one in (pair.alone, pair.shielded) if one is not None and one not in rows]
    return tuple(_outcome(one, rows) for one in rows)


def _outcome(one: Result, rows: Sequence[Result]) -> OutcomeRow:
    colour = MUTED if one.changed is None else NEUTRAL
    typical = dot_and_interval(
        typical_scale(rows), one.iqm, one.low, one.high, colour=colour, zero=True
    )
    failures = None
    if is_known(one):
        # In the colour of what is bad: failures are.
        failures = evidence_bar(one.crashes or 0.0, one.crash_ends, below=True, threshold=None)
    return OutcomeRow(
        name=one.name,
        failures=failures,
        failures_text=_failures(one) if failures is not None else "not known",
        typical=typical,
        typical_text=number_text(one.iqm),
    )


# --- how sure, how far, and what to decide -----------------------------------------------------


def _certainty(pairs: Sequence[Pair]) -> Iterator[str]:
    if not pairs:
        yield "There is no measurement to be sure of."
        return
    numbers = sorted({pair.shielded.episodes for pair in pairs})
    episodes = " or ".join(f"{number:,}" for number in numbers)
    noun = "episode" if numbers == [1] else "episodes"
    rests = f"Each number rests on {episodes} {noun} of an agent."
    intervals = [text for pair in pairs[:MOST_PAIRS] if (text := _intervals(pair))]
    if not intervals:
        yield f"{rests} Of what the rules change there is no interval."
        return
    yield f"{rests} Its 95 % intervals:"
    yield from intervals


def _intervals(pair: Pair) -> str:
    """Between which ends lies what the rules did to one agent; "" where no end is known."""
    one, facts = pair.shielded, []
    if one.gained is not None:
        ends = [telling_text(end) for end in (one.gained.low, one.gained.high)]
        facts.append(f"the difference in mean return is {ends[0]} to {ends[1]}")
    if is_known(one) and one.crash_ends is not None:
        low, high = map(share_text, one.crash_ends)
        facts.append(f"failures with the rules are {low} to {high}")
    return f"{one.name}: {', '.join(facts)}." if facts else ""


def _uncovered(counts: Tally, gaps: UncoveredSummary) -> tuple[str, ...]:
    sentences = []
    if counts.coverage < 1.0:
        sentences.append(
            f"In {share_text(1.0 - counts.coverage)} of the demonstrated states no rule applies: "
            "there every action passes."
        )
    else:
        sentences.append("Some rule applies in every demonstrated state.")
    sentences.append(
        "States that nobody demonstrated, another task or other sensors are not covered; nothing "
        "here proves that following the rules avoids harm."
    )
    if counts.leeway is not None:
        sentences.append(
            "What the expert was not shown to do is not unsafe for that, and what no rule forbids "
            "is not safe for that."
        )
    if gaps.doubts:
        sentences.append(gaps.doubts[0].text)
    if len(gaps.doubts) > 1:
        sentences.append("Section 4 names these and other rules that deserve a second look.")
    return tuple(sentences)


def _decisions(
    pairs: Sequence[Pair],
    certified: CertificatesPart,
    gaps: UncoveredSummary,
    counts: Tally,
    sign_off: SignOff | None,
) -> Iterator[str]:
    if not pairs:
        yield "To measure the rules before they are put in force: what they are worth is not known."
    for pair in pairs[:MOST_PAIRS]:
        name, episodes = pair.shielded.name, counted(pair.shielded.episodes, "episode")
        match pair.shielded.effect:
            case "helps":
                yield f"Whether {pair.agent} is to act under the rules: they helped it ({name})."
            case "harms":
                yield (
                    f"Whether to leave {pair.agent} without these rules, or to change them first: "
                    f"as they are they harm it ({name})."
                )
            case "no difference seen":
                yield (
                    f"Whether the rules are worth putting in force for {pair.agent}: in {episodes} "
                    f"no difference was seen ({name})."
                )
            case _:
                yield f"Whether {pair.agent} is to act under the rules ({name})."
    worst = [
        pair.shielded.crash_ends[1]
        for pair in pairs
        if is_known(pair.shielded) and pair.shielded.crash_ends is not None
    ]
    if worst and not certified.verdicts:
        yield (
            f"Whether failures in up to {share_text(max(worst))} of the episodes, the upper end of "
            "what was measured, can be borne. None lower is certified; “sarl certify” tests one."
        )
    if gaps.doubts:
        yield "Who looks at the rules that deserve a second look (section 4)."
    if counts.coverage < 1.0:
        yield "What is to guard the states in which no rule applies."
    if sign_off is not None and not sign_off.approvals:
        yield "Whether to approve the rules: nobody has."
