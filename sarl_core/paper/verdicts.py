"""How a claim is decided over several recordings of several experts.

Either something holds in a recording or not, and it is counted in how many. Or there is a number in
each, and the interval of its mean is held against bounds: what has to be shown must be so at every
value in the interval, so few or scattered recordings never make a claim agree. A claim that
something is the same has a margin, and one with nothing to judge is not judged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.mining.language import counted
from sarl_core.paper.words import percent
from sarl_core.rollouts.statistics import MeanInterval, mean_interval, rate_of

Verdict = Literal["agrees", "partly", "does not agree", "cannot be judged"]
VERDICTS: tuple[Verdict, ...] = ("agrees", "partly", "does not agree", "cannot be judged")

LEAST_RECORDINGS, LEAST_EXPERTS = 5, 3
"""Fewer decide nothing."""

_MOST = 5 / 6  # of the recordings
_LEAST_JUDGED = 3  # recordings in which there is something to judge

Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]


@dataclass(frozen=True)
class Finding:
    """What R recordings say together.

    Attributes:
        verdict: The verdict.
        held: In which of the recordings it holds by itself, R.
        experts: Whose recordings they are, R.
        rule: By which rule, in words.
        interval: Of the mean over the recordings, where that decides.
        too_few: Whether recordings or experts are too few to decide anything.
    """

    verdict: Verdict
    held: tuple[bool, ...]
    experts: tuple[str, ...]
    rule: str
    interval: MeanInterval | None = None
    too_few: bool = False

    @property
    def told(self) -> str:
        """In how many recordings it holds, and with how many experts; "" if none were judged."""
        if not self.held:
            return ""
        experts = {one for one, held in zip(self.experts, self.held, strict=True) if held}
        every = len(set(self.experts))
        text = (
            f"It holds in {sum(self.held)} of {counted(len(self.held), 'recording')}, with "
            f"{len(experts)} of {counted(every, 'expert')}"
        )
        if self.too_few:
            return (
                f"{text}; that is too little to judge by, {LEAST_RECORDINGS} recordings of "
                f"{LEAST_EXPERTS} experts are needed for each environment."
            )
        return f"{text}."

    @property
    def numbers(self) -> Mapping[str, float]:
        """The same as numbers."""
        found = {
            "held_in": float(sum(self.held)),
            "recordings": float(len(self.held)),
            "experts": float(len(set(self.experts))),
        }
        if self.interval is not None:
            found |= {
                "mean": self.interval.mean,
                "low": self.interval.low,
                "high": self.interval.high,
            }
        return found


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper beside our number.

    Attributes:
        paper: What the paper says, in one sentence.
        where: Where it says so.
        ours: What we found, and in how many recordings, in a sentence or two.
        verdict: Whether the two agree, decided by `decided_by` and nothing else.
        decided_by: By which rule.
        numbers: What went into `ours` and the verdict.
        by_chance: How often it would agree if it made no difference what is called what, 0 to 1;
            None as long as that is not worked out.
        constructed: Why it holds whatever was demonstrated; empty if it may fail.
    """

    paper: str
    where: str
    ours: str
    verdict: Verdict
    decided_by: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    by_chance: float | None = None
    constructed: str = ""


def claim(
    found: Finding,
    *,
    paper: str,
    where: str,
    ours: str,
    measured: str,
    numbers: Mapping[str, float] | None = None,
    constructed: str = "",
) -> Claim:
    """A claim that was decided.

    Args:
        found: How.
        paper: As in `Claim`.
        where: Likewise.
        ours: What we found, but for the number of recordings.
        measured: What is held against the bounds of the rule.
        numbers: Besides those of `found`.
        constructed: As in `Claim`.

    Returns:
        The claim.
    """
    return Claim(
        paper=paper,
        where=where,
        ours=f"{ours} {found.told}".strip(),
        verdict=found.verdict,
        decided_by=f"{measured} {found.rule}",
        numbers={**(numbers or {}), **found.numbers},
        constructed=constructed,
    )


def enough(experts: Sequence[str]) -> bool:
    """Whether recordings are enough to decide anything.

    Args:
        experts: The expert of each.

    Returns:
        True if there are 5 of 3 experts at least.
    """
    return len(experts) >= LEAST_RECORDINGS and len(set(experts)) >= LEAST_EXPERTS


# --- intervals -----------------------------------------------------------------------------------


def over_recordings(values: ArrayLike, experts: Sequence[str]) -> MeanInterval:
    """The mean over recordings, with a 95 % interval that takes experts for groups.

    Two recordings of one expert are alike. So the interval is Student's over all recordings or
    that over the experts' means, whichever is wider: it covers 95 % or more however much of the
    spread is between experts.

    Args:
        values: One number a recording, (R,).
        experts: The expert of each.

    Returns:
        The mean of the experts' means and its interval; of one expert alone nobody can tell how
        experts differ, and the ends are NaN.
    """
    array = np.asarray(values, dtype=np.float64)
    names = np.asarray(experts)
    groups = mean_interval([array[names == name].mean() for name in dict.fromkeys(experts)])
    every = mean_interval(array)
    half = max(every.high - every.mean, groups.high - groups.mean)
    if len(set(experts)) == 1:
        half = math.nan
    return MeanInterval(groups.mean, groups.mean - half, groups.mean + half)


def share_over_recordings(found: Truths, experts: Sequence[str]) -> MeanInterval:
    """The share of episodes in which something is so, likewise.

    Where it is so in all or in none, recordings do not differ, and yet there were only so many
    episodes: the interval is never narrower than that of Clopper and Pearson over all of them.

    Args:
        found: For each recording its episodes, (R, E).
        experts: The expert of each recording.

    Returns:
        The mean share and its interval, within 0 and 1; the ends are NaN as there.
    """
    spread, whole = over_recordings(found.mean(axis=1), experts), rate_of(found)
    if math.isnan(spread.low):
        return spread
    return MeanInterval(
        spread.mean,
        max(min(spread.low, whole.low), 0.0),
        min(max(spread.high, whole.high), 1.0),
    )


# --- verdicts ------------------------------------------------------------------------------------


def above(
    values: Floats,
    experts: Sequence[str],
    *,
    agrees: float,
    partly: float,
    show: Callable[[float], str] = percent,
    interval: MeanInterval | None = None,
) -> Finding:
    """Hold a number against two bounds.

    Args:
        values: One a recording, (R,).
        experts: The expert of each.
        agrees: It agrees above this.
        partly: It agrees in part above this.
        show: Writes a bound.
        interval: Of the mean; that of `over_recordings` where not given.

    Returns:
        What was found.
    """
    found = interval or over_recordings(values, experts)
    verdict: Verdict = "does not agree"
    if found.low > agrees:
        verdict = "agrees"
    elif found.low > partly:
        verdict = "partly"
    elif not found.high <= agrees:
        verdict = "cannot be judged"
    return _finding(
        verdict,
        (values > agrees).tolist(),
        experts,
        _rule("above", show(agrees), show(partly)),
        interval=found,
    )


def below(
    values: Floats,
    experts: Sequence[str],
    *,
    agrees: float,
    partly: float,
    show: Callable[[float], str] = percent,
    interval: MeanInterval | None = None,
) -> Finding:
    """The other way round: it agrees below the first bound, and does not above the second.

    Args:
        values: As in `above`.
        experts: Likewise.
        agrees: It agrees below this.
        partly: It agrees in part below this.
        show: As in `above`.
        interval: Likewise.

    Returns:
        What was found.
    """
    found = interval or over_recordings(values, experts)
    turned = MeanInterval(-found.mean, -found.high, -found.low)
    other = above(-values, experts, agrees=-agrees, partly=-partly, interval=turned)
    return replace(
        other,
        rule=_rule("below", show(agrees), show(partly)),
        interval=found,
    )


def within(
    values: Floats,
    experts: Sequence[str],
    *,
    agrees: float,
    partly: float,
    show: Callable[[float], str] = percent,
) -> Finding:
    """Hold a difference against margins: it has to be shown that two things are the same.

    Args:
        values: One a recording, (R,); 0 is the same.
        experts: The expert of each.
        agrees: It agrees up to this, either way.
        partly: It agrees in part up to this.
        show: Writes a margin.

    Returns:
        What was found.
    """
    found = over_recordings(values, experts)
    farthest, nearest = max(-found.low, found.high), max(found.low, -found.high)
    verdict: Verdict = "does not agree"
    if farthest <= agrees:
        verdict = "agrees"
    elif farthest <= partly:
        verdict = "partly"
    elif not nearest > agrees:
        verdict = "cannot be judged"
    return _finding(
        verdict,
        (np.abs(values) <= agrees).tolist(),
        experts,
        _rule("within", f"{show(agrees)} either way", show(partly)),
        interval=found,
    )


def _rule(where: str, agrees: str, partly: str) -> str:
    part = "" if agrees == partly else f", partly if all of it lies {where} {partly}"
    return (
        f"Agrees if the whole 95 % interval over recordings and experts lies {where} {agrees}"
        f"{part}; else it does not agree if none of it does, and cannot be judged if some does."
    )


def in_most(
    holds: ArrayLike,
    experts: Sequence[str],
    *,
    in_part: ArrayLike | None = None,
    judged: ArrayLike | None = None,
    existence: bool = False,
) -> Finding:
    """Count the recordings in which something holds.

    Args:
        holds: Whether it does, one a recording.
        experts: The expert of each.
        in_part: Whether it holds at least in part; as `holds` where not given.
        judged: In which recordings there is anything to judge; in all where not given.
        existence: Whether the claim is that there is something, which one recording that shows it
            is enough not to refute.

    Returns:
        What was found.
    """
    rows = [
        (bool(hold), bool(part), expert)
        for hold, part, expert, wanted in zip(
            np.asarray(holds),
            np.asarray(holds if in_part is None else in_part),
            experts,
            np.ones(len(experts), dtype=np.bool_) if judged is None else np.asarray(judged),
            strict=True,
        )
        if wanted
    ]
    held = [hold for hold, _, _ in rows]
    needed = math.ceil(_MOST * len(rows) - 1e-9)
    with_all = {expert for hold, _, expert in rows if hold} == {expert for *_, expert in rows}
    verdict: Verdict = "partly"
    if len(rows) < _LEAST_JUDGED:
        verdict = "cannot be judged"
    elif sum(held) >= needed and with_all:
        verdict = "agrees"
    elif sum(hold or part for hold, part, _ in rows) <= (0 if existence else len(rows) - needed):
        verdict = "does not agree"
    rule = (
        "Agrees if it holds in 5 of 6 recordings, and with every expert at least once; does not "
        + (
            "agree if in none; "
            if existence
            else "agree if in no more than 1 of 6, not even in part; "
        )
        + "else partly."
    )
    if judged is not None:
        rule += (
            f" Only recordings in which there is something to judge count; fewer than "
            f"{_LEAST_JUDGED} cannot be judged."
        )
    found = _finding(verdict, held, [expert for *_, expert in rows], rule)
    # That few of enough recordings have something to judge is no want of recordings.
    return (
        found
        if judged is None or not enough(experts)
        else replace(found, verdict=verdict, too_few=False)
    )


def _finding(
    verdict: Verdict,
    held: Sequence[bool],
    experts: Sequence[str],
    rule: str,
    interval: MeanInterval | None = None,
) -> Finding:
    """A finding, which is no verdict where recordings or experts are too few."""
    few = not enough(experts)
    return Finding(
        "cannot be judged" if few else verdict, tuple(held), tuple(experts), rule, interval, few
    )


def together(found: Sequence[Finding], rule: str) -> Finding:
    """Several findings that a claim asks for at once, as one an environment or rule set.

    Args:
        found: At least one. Those of the same recordings hold in a recording if all do; those of
            different ones are counted one after the other.
        rule: By which rule each was found, and what they are, in words.

    Returns:
        It agrees if all do; partly if some do, if only in part.
    """
    verdicts = {one.verdict for one in found}
    verdict: Verdict = "does not agree"
    if verdicts == {"agrees"}:
        verdict = "agrees"
    elif verdicts & {"agrees", "partly"}:
        verdict = "partly"
    elif "cannot be judged" in verdicts:
        verdict = "cannot be judged"
    if len({one.experts for one in found}) == 1:
        held = tuple(all(parts) for parts in zip(*(one.held for one in found), strict=True))
        experts = found[0].experts
    else:
        held = tuple(held for one in found for held in one.held)
        experts = tuple(expert for one in found for expert in one.experts)
    return Finding(verdict, held, experts, rule, too_few=any(one.too_few for one in found))
