"""How sure a rule is, in words: counts, intervals, and what is still missing."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.colours import INTERVENTION_COLOUR, MUTED_COLOUR
from sarl_core.mining.digits import limit_text
from sarl_core.mining.evidence import HeldOut, Interval
from sarl_core.mining.language import counted, number_text, share_text
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.validation.episode_counts import Influence
from sarl_core.mining.validation.holding_out import (
    Shortfall,
    Verdict,
    best_lower_bound,
    episodes_needed,
    least_confidence,
    verdict,
)
from sarl_core.mining.validation.stability import Band

VERDICTS: dict[Verdict, str] = {
    "below": "too low",
    "open": "open",
    "reached": "reached",
    "unknown": "too few episodes",
}
"""What each verdict is called on screen."""
VERDICT_COLOURS: dict[Verdict, str] = {
    "below": INTERVENTION_COLOUR,
    "open": "#4A6FA5",
    "reached": "#2E8B6F",
    "unknown": MUTED_COLOUR,
}
MOVES = 0.02
"""How far one episode has to move a share for it to be worth a word."""


def range_text(interval: Interval) -> str:
    """An interval of a share.

    Args:
        interval: Its ends.

    Returns:
        As "78 to 99 %".
    """
    return " to ".join(_ends(interval))


def what_tells(interval: Interval) -> str:
    """The same for whoever has never heard of an interval.

    Args:
        interval: Its ends.

    Returns:
        As "between 78 and 99 % is what that can tell".
    """
    return f"between {' and '.join(_ends(interval))} is what that can tell"


def _ends(interval: Interval) -> tuple[str, str]:
    """Both, with as many digits as part them."""
    low, high = map(share_text, interval)
    if low == high and interval.low < interval.high:
        low, high = (share_text(end, decimals=2) for end in interval)
    return low.removesuffix(" %"), high


def mined_text(rule: Rule) -> str:
    """A rule's confidence on what it was mined from, as "97 % of 412 states"."""
    states = counted(rule.samples, "state")
    return f"{share_text(rule.confidence)} of {states}" if rule.samples else "no states"


def held_out_text(held_out: HeldOut | None) -> str:
    """What other episodes say, as "91 % in 14 episodes"; "" where nothing was held out."""
    if held_out is None:
        return ""
    if not held_out.samples:
        return "no states"
    if held_out.share is None:  # an older file counted states alone
        share = share_text(held_out.correct / held_out.samples)
        return f"{share} of {counted(held_out.samples, 'state')}"
    return f"{share_text(held_out.share)} in {counted(held_out.episodes, 'episode')}"


def evidence_text(rule: Rule) -> str:
    """A rule's confidence with its counts.

    Args:
        rule: With what was held out, if anything was.

    Returns:
        As "97 % of 412 states; held out: 91 % in 14 episodes (96 states)".
    """
    held = held_out_text(rule.held_out)
    if not held:
        return mined_text(rule)
    states = ""
    if rule.held_out is not None and rule.held_out.episodes:
        states = f" ({counted(rule.held_out.samples, 'state')})"
    return f"{mined_text(rule)}; held out: {held}{states}"


def held_out_interval_text(held_out: HeldOut | None) -> str:
    """The 95 % interval of a mean over episodes.

    Args:
        held_out: What was counted, None where nothing was.

    Returns:
        As "78 to 99 %"; "too few episodes" where there is none, "" where nothing was held out.
    """
    if held_out is None:
        return ""
    interval = held_out.interval
    return "too few episodes" if interval is None else range_text(interval)


def episodes_text(held_out: HeldOut, *, what: str) -> str:
    """What other episodes say, for whoever has never heard of an interval.

    Args:
        held_out: What was counted.
        what: Was observed of each episode, as "it was right".

    Returns:
        As "In 14 episodes that it was not mined from, it was right in 91 % of its states on
        average, and between 78 and 99 % is what that can tell."
    """
    if held_out.share is None:
        if held_out.samples:
            share = share_text(held_out.correct / held_out.samples)
            return (
                f"Of {counted(held_out.samples, 'state')} that it was not mined from, {what} in "
                f"{share}; the file does not say in how many episodes."
            )
        return "There was no state for it in the episodes that it was not mined from."
    text = (
        f"In {counted(held_out.episodes, 'episode')} that it was not mined from, {what} in "
        f"{share_text(held_out.share)} of its states on average"
    )
    if held_out.interval is None:
        return f"{text}; {'that is' if held_out.episodes > 1 else 'one is'} too few to say more."
    return f"{text}, and {what_tells(held_out.interval)}."


def influence_text(influence: Influence | None) -> str:
    """The episode that alone moves a share.

    Args:
        influence: The one that moves it most; None where there are fewer than two.

    Returns:
        As "without episode 41 (1,000 steps) it would be 71 % instead of 97 %"; "" where none moves
        it by `MOVES`.
    """
    if influence is None or influence.moves < MOVES:
        return ""
    return (
        f"without episode {influence.episode} ({counted(influence.steps, 'step')}) it would be "
        f"{share_text(influence.without)} instead of {share_text(influence.share)}"
    )


def moved_text(influence: Influence | None) -> str:
    """The same for a table, as "episode 41: 71 % without it"."""
    if influence is None or influence.moves < MOVES:
        return ""
    return f"episode {influence.episode}: {share_text(influence.without)} without it"


def more_text(more: float) -> str:
    """How many episodes are still missing.

    Args:
        more: What `more_episodes` gives.

    Returns:
        As "12 more episodes".
    """
    if math.isnan(more):
        return "too few episodes to say"
    if more == 0:
        return "enough"
    if math.isinf(more):
        return "never at this rate"
    return f"{int(more):,} more {'episode' if more == 1 else 'episodes'}"


def shortfall_text(short: Shortfall) -> str:
    """How many rules reach a lower bound, and why the others do not.

    Args:
        short: Of some rules.

    Returns:
        As "2 of 9 rules reach 80 %; 4 were met in too few held-out episodes to show that even if
        never wrong, and 3 were not right often enough".
    """
    reach = "reaches" if short.reached == 1 else "reach"
    text = f"{short.reached:,} of {counted(short.rules, 'rule')} {reach} {share_text(short.least)}"
    if short.reached == short.rules:
        return text
    were = "was" if short.too_few == 1 else "were"
    few = f"{short.too_few:,} {were} met in too few held-out episodes to show that even if never"
    were = "was" if short.wrong == 1 else "were"
    return f"{text}; {few} wrong, and {short.wrong:,} {were} not right often enough"


def remedy_text(short: Shortfall, there: int, *, in_command: bool = False) -> str:
    """Why no rule reaches a lower bound, and what to do.

    Args:
        short: Of some rules.
        there: Episodes in all, the held-out ones among them.
        in_command: Whether what to do is written as options of `mine`.

    Returns:
        As "12 held-out episodes can show at most 87.8 %, even of a rule that is never wrong; hold
        out at least 16 of the 62 (26 %), or ask for less: the best of these rules shows 78.1 %";
        "" where some rule reaches it, or there is no rule.
    """
    if short.reached or not short.rules:
        return ""
    least = f" (--lower-bound {math.floor(100 * short.best) / 100:g})" if in_command else ""
    shows = f"the best of these rules shows {share_text(short.best, decimals=1)}"
    most = best_lower_bound(short.episodes)
    if most >= short.least:
        more = "hold out" if 2 * short.episodes < there else "demonstrate"
        more = f"{more} more episodes, so that each rule is met in more of those held out"
        return f"{shows}; ask for less{least}, or {more}" if short.best else more
    best = f"ask for less: {shows}{least}" if short.best else ""
    wanted = share_text(short.least)
    text = (
        f"{counted(short.episodes, 'held-out episode')} can show at most "
        f"{share_text(most, decimals=1)}, even of a rule that is never wrong"
        if most
        else f"{counted(short.episodes, 'held-out episode')} can show nothing of a rule"
    )
    or_best = f", or {best}" if best else ""
    (needed,) = episodes_needed(np.ones(1), np.zeros(1), short.least).tolist()
    if math.isinf(needed):
        return f"{text}, and no number of them can show {wanted}" + (best and f"; {best}")
    if 2 * needed > there:  # the other half has to be mined from
        return (
            f"{text}, and {wanted} takes at least {needed:,.0f}: too many of the {there:,} there "
            f"are; demonstrate more{or_best}"
        )
    percent = math.ceil(100 * needed / there)
    share = f"--hold-out {percent / 100:g}" if in_command else f"{percent} %"
    return f"{text}; hold out at least {needed:,.0f} of the {there:,} ({share}){or_best}"


def never_text(missing: Sequence[float]) -> str:
    """Why no further episodes would make any rule certain.

    Args:
        missing: What `more_episodes` gives of each rule.

    Returns:
        As "No rule would reach it: 3 never do at this rate, and 5 were met in too few held-out
        episodes to say."; "" where one would.
    """
    if any(map(math.isfinite, missing)):
        return ""
    unknown = sum(map(math.isnan, missing))
    never = len(missing) - unknown
    parts = []
    if never:
        parts.append(f"{never:,} never {'does' if never == 1 else 'do'} at this rate")
    if unknown:
        were = "was" if unknown == 1 else "were"
        parts.append(f"{unknown:,} {were} met in too few held-out episodes to say")
    return f"No rule would reach it: {', and '.join(parts)}."


def least_text(thresholds: Thresholds) -> str:
    """What the confidence of a rule has to reach: of one that forbids, all but epsilon."""
    if thresholds.never is None:
        return "the minimum confidence"
    if not thresholds.demands:
        return "1 − epsilon"
    return "the minimum confidence (1 − epsilon where a rule forbids)"


def limits_text(thresholds: Thresholds) -> str:
    """The same with how much that is, as "the minimum confidence, 95 %"."""
    parts = []
    if thresholds.demands:
        parts.append(f"the minimum confidence, {share_text(thresholds.confidence)}")
    if thresholds.never is not None:
        parts.append(f"1 − epsilon, {share_text(1.0 - thresholds.never)}")
    return parts[0] if len(parts) == 1 else f"{parts[0]}, and for rules that forbid {parts[1]}"


def verdict_counts(rules: Sequence[Rule], thresholds: Thresholds) -> dict[Verdict, int]:
    """How many rules have each verdict.

    Args:
        rules: With what was held out, if anything was.
        thresholds: At which they were mined.

    Returns:
        One count a verdict.
    """
    counts: dict[Verdict, int] = dict.fromkeys(VERDICTS, 0)
    for rule in rules:
        counts[verdict(rule, least_confidence(rule, thresholds))] += 1
    return counts


def verdicts_text(rules: Sequence[Rule], thresholds: Thresholds) -> str:
    """The same, as "0 too low, 3 open, 5 reached, 2 too few episodes"."""
    counts = verdict_counts(rules, thresholds)
    return ", ".join(f"{count:,} {VERDICTS[name]}" for name, count in counts.items())


def band_text(band: Band, feature: Feature) -> str:
    """How far one threshold of a rule moves.

    Args:
        band: What was found.
        feature: Its name, its unit and what is known of the threshold.

    Returns:
        As "pole angle > 0.0213 rad (0.018 to 0.025)".
    """
    sign = "≤" if band.op == "<=" else ">"
    limit = limit_text(band.threshold, feature)
    own = f"{feature.name} {sign} {limit}{f' {feature.unit}' if feature.unit else ''}"
    if feature.indicator is not None:
        own = feature.statement(band.op == ">")
        return own if band.rounds else f"{own} (not asked again)"
    if not band.rounds:
        return f"{own} (not asked again)"
    low = number_text(band.low, apart_from=band.high)
    high = number_text(band.high, apart_from=band.low)
    return f"{own} ({low})" if band.low == band.high else f"{own} ({low} to {high})"
