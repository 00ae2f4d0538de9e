"""What rules did to those who were measured under them, as the first page of a report says it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from markupsafe import Markup

from sarl_core.decimals import telling_text
from sarl_core.environments.failures import failure_meaning
from sarl_core.explaining.report.comparison import HARMS, Result, is_known
from sarl_core.explaining.report.rule_set_card import ReportedEpisodes
from sarl_core.explaining.report.svg import (
    MUTED,
    NEUTRAL,
    SvgScale,
    dot_and_interval,
    evidence_bar,
)
from sarl_core.explaining.words.comparison import POLICY_TEXT
from sarl_core.mining.language import at_least_text, counted, listed, number_text, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.rollouts.failures import rate_text
from sarl_core.rollouts.statistics import MeanInterval, mean_interval_of

MOST_PAIRS = 2  # as many fit on the first page; all stand in the comparison itself
_MOST_ROWS = 4
_RULES = "the rules, whoever acts"
_FOLLOWING = "an agent follows the rules"
_WHO = {"novice": "which acts at random", "untrained": "a network that has learned nothing"}


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
        """Who acts, as a sentence goes on with it."""
        return agent_text(self.shielded)

    @property
    def is_policy(self) -> bool:
        """Whether the rules left the agent nothing to choose, so that they acted themselves."""
        return self.shielded.freedom == 0.0


@dataclass(frozen=True)
class OutcomeRow:
    """A result as the first page draws it.

    Attributes:
        name: Of agent and shield.
        failures: SVG of the share of episodes that failed; None where it is not known.
        failures_text: In words.
        mean: SVG of the mean return.
        mean_text: In words.
    """

    name: str
    failures: Markup | None
    failures_text: str
    mean: Markup
    mean_text: str


@dataclass(frozen=True)
class FailureLimit:
    """How many of the episodes may fail of one who is to act.

    Attributes:
        agent: Its name; "" where it is not known, None where the rules decide in its place.
        acting: As "the novice acts under the rules".
        share: The upper end of the 95 % interval of the worst of its tests.
        episodes: Of that test.
        test: Which one that is.
        tests: How many there are.
    """

    agent: str | None
    acting: str
    share: float
    episodes: int
    test: str
    tests: int


def agent_text(result: Result) -> str:
    """Who acted, as "the expert"."""
    return f"the {result.agent}" if result.agent else "the agent"


def pairs_of(results: Sequence[Result]) -> tuple[Pair, ...]:
    """Each shielded result beside that of the same agent without a shield.

    Args:
        results: Any number.

    Returns:
        Those with a shield, in their order; only what is known to be of the same agent, or is the
        only one of its kind in files that name no agent, and on the same seeds, stands beside it.
    """
    alone = _alone(results)
    shielded = [one for one in results if one.changed is not None]
    nameless = len(alone) == len(shielded) == 1

    def beside(one: Result) -> Result | None:
        starts = (one.env_id, one.seed, one.episodes)
        for other in alone if one.seed is not None else ():
            same = other.agent == one.agent and (one.agent or nameless)
            if same and (other.env_id, other.seed, other.episodes) == starts:
                return other
        return None

    return tuple(Pair(beside(one), one) for one in shielded)


def _alone(results: Sequence[Result]) -> list[Result]:
    return [one for one in results if one.changed is None]


# --- in sentences ------------------------------------------------------------------------------


def effects(
    rule_set: RuleSet,
    pairs: Sequence[Pair],
    results: Sequence[Result],
    reported: ReportedEpisodes,
    *,
    decides: bool,
) -> Iterator[str]:
    """What rules did to those who were measured, in sentences.

    Args:
        rule_set: The rules.
        pairs: `pairs_of` the results.
        results: Of a comparison; () without one.
        reported: What the card of the rules says.
        decides: Whether it is said already that these rules decide every step.

    Yields:
        The first says the most.
    """
    if not pairs:
        if reported.mean is not None:
            yield f"{(achieved := _achieved(reported))[0].upper()}{achieved[1:]}"
        lacking = "Nothing" if not results else "No agent under the rules"
        yield (
            f"{lacking} was measured for this report: what the rules do to whoever is held to them "
            "is not known from it. Section 5 says how to measure it."
        )
        return
    first = pairs[:MOST_PAIRS]
    ruled = [pair for pair in first if pair.is_policy]
    if ruled and not decides:
        yield f"{POLICY_TEXT}."
    if ruled:
        yield from _ruled(ruled)
    yield from (_effect(pair) for pair in first if not pair.is_policy)
    if len(pairs) > MOST_PAIRS:
        yield f"Section 5 has all {counted(len(pairs), 'comparison')}."
    ours = sum(rule.enabled for rule in rule_set.rules)
    others = sorted({pair.shielded.rules for pair in pairs if pair.shielded.rules} - {ours})
    if others:
        numbers = " and ".join(f"{number:,}" for number in others)
        yield (
            f"Some of this was measured with {numbers} rules, and these are {ours:,}: see whether "
            "it was these."
        )


def _achieved(reported: ReportedEpisodes) -> str:
    """What an agent that follows the rules achieved where they were made."""
    assert reported.mean is not None
    over = f" over {counted(reported.episodes, 'episode')}" if reported.episodes else ""
    failed = "" if reported.rate is None else f"; failures: {rate_text(reported.rate)}"
    return (
        "when the rules were made, an agent that follows them had a mean return of "
        f"{number_text(reported.mean)}{over}{failed}."
    )


def _ruled(pairs: Sequence[Pair]) -> Iterator[str]:
    """What rules that decide every step did, beside those in whose place they acted."""
    for one in _different(pairs):
        name = "" if len(_different(pairs)) == 1 else f" (“{one.name}”)"
        yield (
            f"Whoever is held to them{name} has a mean return of {telling_text(one.mean)}"
            f"{_and_failed(one)}, over {counted(one.episodes, 'episode')}."
        )
    beside = [
        f"{agent_text(alone)}{f', {_WHO[alone.agent]},' if alone.agent in _WHO else ''} has "
        f"{telling_text(alone.mean)}{_and_failed(alone)}"
        for pair in pairs
        if (alone := pair.alone) is not None
    ]
    if beside:
        yield f"Without them, from the same starts, {'; '.join(beside)}."
    words: dict[str, str] = {
        "helps": "better than",
        HARMS: "worse than",
        "no difference seen": "no different from",
    }
    verdicts = [f"{words[one.shielded.effect]} {one.agent}" for one in pairs if one.shielded.effect]
    if verdicts:
        yield f"The rules do {' and '.join(verdicts)}{_chance(pairs)}."


def _chance(pairs: Sequence[Pair]) -> str:
    unseen = any(pair.shielded.effect == "no difference seen" for pair in pairs)
    return ", as far as can be told from so many" if unseen else ""


def _different(pairs: Sequence[Pair]) -> list[Result]:
    """The shielded results without those that only repeat another, whoever acted."""
    by_outcome = {(one.shielded.mean, one.shielded.crashes): one.shielded for one in pairs}
    return list(by_outcome.values())


def _and_failed(one: Result) -> str:
    return f", and {failures_share(one)} of the episodes fail" if is_known(one) else ""


def _effect(pair: Pair) -> str:
    """What the rules did to one agent, as a sentence."""
    one, alone = pair.shielded, pair.alone
    name = f"With the rules (“{one.name}”)"
    if alone is None:
        unknown = (
            "Without them it was not run on the same seeds"
            if one.seed is not None
            else "From which seeds is not known"
        )
        return (
            f"{name} the mean return of {pair.agent} was {telling_text(one.mean)}"
            f"{_and_failed(one).replace('fail', 'failed')}. {unknown}, so what they change is "
            "not known."
        )
    who = f", {_WHO[one.agent]}," if one.agent in _WHO else ""
    means = f"was {telling_text(one.mean)} instead of {telling_text(alone.mean)} without them"
    failed = ""
    if is_known(one) and is_known(alone):
        before, after = failures_share(alone), failures_share(one)
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
    changed = "" if one.changed is None else f" They changed {share_text(one.changed)} of its steps"
    left = "" if one.freedom is None else f", and left {share_text(one.freedom)} of the choice"
    return (
        f"{name} the mean return of {pair.agent}{who} {means}{failed}"
        f"{meanings.get(one.effect, '')}.{f'{changed}{left}.' if changed else ''}"
    )


def failures_share(one: Result) -> str:
    """The share of its episodes that failed, in words."""
    return at_least_text(one.crashes or 0.0, one.undecided)


# --- as a picture ------------------------------------------------------------------------------


def outcome_rows(pairs: Sequence[Pair], results: Sequence[Result]) -> tuple[OutcomeRow, ...]:
    """The results that the first page draws.

    Args:
        pairs: `pairs_of` the results.
        results: Of a comparison.

    Returns:
        Rules that decide every step once, and not with each agent that they left nothing to
        choose; all others with the rules and without, and who was only measured without.
    """
    every = _drawn(pairs, results)
    if not every:
        return ()
    scale = SvgScale.over(
        [end for _, one in every for end in (_mean(one).low, _mean(one).high)], margin=0.04
    )
    return tuple(_outcome(name, one, scale) for name, one in every)


def _drawn(pairs: Sequence[Pair], results: Sequence[Result]) -> list[tuple[str, Result]]:
    """The results that the first page draws, and what they are called there."""
    if not pairs:
        return []
    first = pairs[:MOST_PAIRS]
    ruled = _different([pair for pair in first if pair.is_policy])
    rows = [(_RULES if len(ruled) == 1 else one.name, one) for one in ruled]
    for pair in first:
        beside = [pair.alone, None if pair.is_policy else pair.shielded]
        rows += [(_name(one), one) for one in beside if one is not None]
    rows += [(_name(one), one) for one in _alone(results)]
    return [row for place, row in enumerate(rows) if row not in rows[:place]][:_MOST_ROWS]


def _name(one: Result) -> str:
    return f"{agent_text(one)} alone" if one.changed is None and one.agent else one.name


def _mean(one: Result) -> MeanInterval:
    return mean_interval_of(one.mean, one.std, one.episodes)


def _outcome(name: str, one: Result, scale: SvgScale) -> OutcomeRow:
    colour = MUTED if one.changed is None else NEUTRAL
    between = _mean(one)
    failures = None
    if is_known(one):
        # In the colour of what is bad: failures are.
        failures = evidence_bar(one.crashes or 0.0, one.crash_ends, below=True, threshold=None)
    return OutcomeRow(
        name=name,
        failures=failures,
        failures_text=failures_share(one) if failures is not None else "not known",
        mean=dot_and_interval(scale, one.mean, between.low, between.high, colour=colour, zero=True),
        mean_text=telling_text(one.mean),
    )


def outcomes_note(results: Sequence[Result]) -> str:
    """How the picture is read, and what a failure is.

    Args:
        results: Of a comparison.

    Returns:
        Sentences.
    """
    names: dict[str, list[str]] = {}
    for one in results:
        if is_known(one):
            names.setdefault(failure_meaning(one.env_id, one.failure), []).append(f"“{one.name}”")
    failing = " ".join(
        f"It fails if {meaning}."
        if len(names) == 1
        else f"In {' and '.join(of)} it fails if {meaning}."
        for meaning, of in names.items()
        if meaning
    )
    return (
        f"An episode is one attempt from start to end. {failing}{' ' if failing else ''}The return "
        "is the sum of its points: more is better. The lines are 95 % intervals: where the true "
        "value probably lies."
    )


# --- how sure ----------------------------------------------------------------------------------


def certainty(
    pairs: Sequence[Pair], results: Sequence[Result], reported: ReportedEpisodes
) -> Iterator[str]:
    """How sure the results are, in sentences.

    Args:
        pairs: `pairs_of` the results.
        results: Of a comparison.
        reported: What the card of the rules says.

    Yields:
        Nothing where nothing was measured.
    """
    first = pairs[:MOST_PAIRS]
    if not first:
        return
    names: dict[int, list[str]] = {}
    for name, one in _drawn(pairs, results):
        names.setdefault(one.episodes, []).append(name)
    rests = f"Each number above rests on {counted(next(iter(names)), 'episode')}."
    if len(names) > 1:
        whose = [f"{counted(of, 'episode')} ({'; '.join(own)})" for of, own in names.items()]
        rests = f"The numbers above rest on {listed(whose, most=_MOST_ROWS)}."
    intervals = dict.fromkeys(fact for pair in first for fact in _intervals(pair))
    if not intervals:
        yield f"{rests} Of what the rules change there is no interval."
    else:
        yield f"{rests} 95 % intervals: {'; '.join(intervals)}."
    if reported.mean is not None:
        yield f"A second test: {_achieved(reported)}"


def _intervals(pair: Pair) -> Iterator[str]:
    """Between which ends lies what the rules did to one agent, as far as it is known."""
    one = pair.shielded
    who = "with the rules" if pair.is_policy else f"of {one.name}"
    if is_known(one) and one.crash_ends is not None:
        low, high = map(share_text, one.crash_ends)
        yield f"failures {who} {low} to {high}"
    if one.gained is not None:
        ends = [telling_text(end) for end in (one.gained.low, one.gained.high)]
        yield f"mean return with the rules less that of {pair.agent} alone {ends[0]} to {ends[1]}"


def failures_at_most(pairs: Sequence[Pair], reported: ReportedEpisodes) -> tuple[FailureLimit, ...]:
    """How many episodes may fail of whoever is to act, by the worst of its tests.

    Args:
        pairs: Of the results.
        reported: What the card of the rules says of an agent that follows them, and so of nobody
            who is left a choice.

    Returns:
        One entry for each who is to act, of the agents on the first page and in their order, where
        an upper end is known. Rules that leave no choice are one, whoever they act for.
    """
    actors = dict.fromkeys(_actor(pair) for pair in pairs[:MOST_PAIRS]) or {(None, _FOLLOWING): 0}
    limits = []
    for agent, acting in actors:
        own = [pair for pair in pairs if _actor(pair) == (agent, acting)]
        tests = [
            (one.crash_ends[1], one.episodes, f"“{one.name}”")
            for one in (_different(own) if agent is None else [pair.shielded for pair in own])
            if is_known(one) and one.crash_ends is not None
        ]
        if agent is None and reported.rate is not None:
            tests.append((reported.rate.high, reported.rate.of, "on the card of the rules"))
        if tests:
            high, episodes, test = max(tests, key=lambda one: one[0])
            limits.append(FailureLimit(agent, acting, high, episodes, test, len(tests)))
    return tuple(limits)


def _actor(pair: Pair) -> tuple[str | None, str]:
    """Who is to act, None where the rules do; and in words."""
    if pair.is_policy:
        return None, "the rules act"
    return pair.shielded.agent, f"{pair.agent} acts under the rules"
