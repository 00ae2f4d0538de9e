"""How a claim is decided over several recordings of several experts.

Either something holds in a recording or not, and it is counted in how many. Or there is a number in
each, and the interval of its mean is held against bounds: what has to be shown must be so at every
value in the interval, so few or scattered recordings never make a claim agree. A claim that
something is the same has a margin, and one with nothing to judge is not judged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np

from sarl_core.mining.language import counted
from sarl_core.paper.verdicts import (
    LEAST_EXPERTS,
    LEAST_RECORDINGS,
    Floats,
    Truths,
    Verdict,
    enough,
    over_recordings,
    share_over_recordings,
)
from sarl_core.paper.words import percent
from sarl_core.rollouts.statistics import MeanInterval

_MOST = 5 / 6  # of the recordings
_LEAST_JUDGED = 3  # recordings in which there is something to judge


@dataclass(frozen=True, eq=False)
class Sample:
    """What was measured in R recordings.

    Attributes:
        values: A number or a truth each, (R,), or a truth for each of their episodes, (R, E), whose
            share counts.
        experts: Whose recordings they are, R.
        in_part: In which something holds at least in part; as `values` where not given.
        judged: In which there is anything to judge; in all where not given.
    """

    values: Floats | Truths
    experts: tuple[str, ...]
    in_part: Truths | None = None
    judged: Truths | None = None

    @property
    def interval(self) -> MeanInterval:
        """Of the mean, or of the share of the episodes."""
        if self.values.ndim == 2:
            return share_over_recordings(self.values.astype(np.bool_), self.experts)
        return over_recordings(self.values, self.experts)


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a claim is decided on.

    Attributes:
        samples: One, or for `Together` one for each that a claim asks for.
        ours: What we found, but for the number of recordings.
        numbers: Besides those of the finding.
        no_better_than: The best verdict that what else was measured leaves.
    """

    samples: tuple[Sample, ...]
    ours: str
    numbers: Mapping[str, float] = field(default_factory=dict)
    no_better_than: Verdict = "agrees"


@dataclass(frozen=True)
class Finding:
    """What R recordings say together.

    Attributes:
        verdict: The verdict.
        held: In which of the recordings it holds by itself, R.
        experts: Whose recordings they are, R.
        interval: Of the mean over the recordings, where that decides.
        too_few: Whether recordings or experts are too few to decide anything.
    """

    verdict: Verdict
    held: tuple[bool, ...]
    experts: tuple[str, ...]
    interval: MeanInterval | None = None
    too_few: bool = False

    @property
    def sentence(self) -> str:
        """In how many recordings it holds, and with how many experts; "" if none were judged."""
        if not self.held:
            return ""
        with_it = {one for one, held in zip(self.experts, self.held, strict=True) if held}
        text = (
            f"It holds in {sum(self.held)} of {counted(len(self.held), 'recording')}, with "
            f"{len(with_it)} of {counted(len(set(self.experts)), 'expert')}"
        )
        if self.too_few:
            return (
                f"{text}; that is too little to judge by, {LEAST_RECORDINGS} recordings of "
                f"{LEAST_EXPERTS} experts are needed for each environment."
            )
        return f"{text}."

    @property
    def numbers(self) -> dict[str, float]:
        """The same as numbers."""
        return {
            "held_in": float(sum(self.held)),
            "recordings": float(len(self.held)),
            "experts": float(len(set(self.experts))),
            **(asdict(self.interval) if self.interval is not None else {}),
        }


@dataclass(frozen=True)
class MeanBounds:
    """The interval of the mean over recordings lies on the right side of bounds.

    Attributes:
        where: Above them, below them, or within them either way of 0, which shows that two things
            are the same.
        agrees: It agrees if all of the interval lies there.
        partly: It agrees in part if all of it lies there.
        show: Writes a bound.
    """

    where: Literal["above", "below", "within"]
    agrees: float
    partly: float
    show: Callable[[float], str] = percent

    @property
    def rule(self) -> str:
        """In words."""
        agrees, partly = self.show(self.agrees), self.show(self.partly)
        part = "" if agrees == partly else f", partly if all of it lies {self.where} {partly}"
        either = " either way" if self.where == "within" else ""
        return (
            f"Agrees if the whole 95 % interval over recordings and experts lies {self.where} "
            f"{agrees}{either}{part}; else it does not agree if none of it does, and cannot be "
            "judged if some does."
        )

    def finding(self, sample: Sample) -> Finding:
        """What one sample says."""
        values = sample.values.mean(axis=1) if sample.values.ndim == 2 else sample.values
        interval = sample.interval
        low, high = interval.low, interval.high
        # Ends are NaN where nothing can be told: then neither all of it lies there nor none.
        whole: Callable[[float], bool]
        if self.where == "above":
            held, whole, none = values > self.agrees, low.__gt__, high <= self.agrees
        elif self.where == "below":
            held, whole, none = values < self.agrees, high.__lt__, low >= self.agrees
        else:
            held, none = np.abs(values) <= self.agrees, max(low, -high) > self.agrees
            whole = max(-low, high).__le__
        verdict: Verdict = "does not agree" if none else "cannot be judged"
        if whole(self.agrees):
            verdict = "agrees"
        elif whole(self.partly):
            verdict = "partly"
        few = not enough(sample.experts)
        return Finding(
            "cannot be judged" if few else verdict,
            tuple(held.tolist()),
            sample.experts,
            interval,
            few,
        )


@dataclass(frozen=True)
class InMost:
    """It holds in most recordings.

    Attributes:
        existence: Whether the claim is that there is something, which one recording that shows it
            is enough not to refute.
        only_judged: Whether only recordings in which there is something to judge count.
    """

    existence: bool = False
    only_judged: bool = False

    @property
    def rule(self) -> str:
        """In words."""
        never = "in none" if self.existence else "in no more than 1 of 6, not even in part"
        rule = (
            "Agrees if it holds in 5 of 6 recordings, and with every expert at least once; does "
            f"not agree if {never}; else partly."
        )
        if self.only_judged:
            rule += (
                " Only recordings in which there is something to judge count; fewer than "
                f"{_LEAST_JUDGED} cannot be judged."
            )
        return rule

    def finding(self, sample: Sample) -> Finding:
        """What one sample says."""
        judged = np.ones(len(sample.values), np.bool_) if sample.judged is None else sample.judged
        held = sample.values.astype(np.bool_)[judged]
        part = held if sample.in_part is None else held | sample.in_part[judged]
        experts = np.asarray(sample.experts)[judged]
        needed = math.ceil(_MOST * len(held) - 1e-9)
        verdict: Verdict = "partly"
        # That few of enough recordings have something to judge is no want of recordings.
        few = not enough(sample.experts)
        if few or len(held) < _LEAST_JUDGED:
            verdict = "cannot be judged"
        elif held.sum() >= needed and set(experts[held]) == set(experts):
            verdict = "agrees"
        elif part.sum() <= (0 if self.existence else len(held) - needed):
            verdict = "does not agree"
        return Finding(verdict, tuple(held.tolist()), tuple(experts.tolist()), too_few=few)


@dataclass(frozen=True)
class Together:
    """Several things that a claim asks for at once, as one an environment or rule set.

    It agrees if all do; partly if some do, if only in part.

    Attributes:
        each: How each is decided.
        words: By which rule, and what they are; `{each}` stands for the rule of each.
        in_part_of: How many have to agree before it agrees in part.
    """

    each: MeanBounds | InMost
    words: str
    in_part_of: int = 0

    @property
    def rule(self) -> str:
        """In words."""
        return self.words.format(each=self.each.rule)

    def finding(self, *samples: Sample) -> Finding:
        """What samples say together.

        Args:
            *samples: At least one. Those of the same recordings hold in a recording if all do;
                those of different ones are counted one after the other.
        """
        findings = [self.each.finding(sample) for sample in samples]
        verdicts = [one.verdict for one in findings]
        agreeing = verdicts.count("agrees")
        verdict: Verdict = "does not agree"
        if agreeing == len(verdicts):
            verdict = "agrees"
        elif (agreeing or "partly" in verdicts) and agreeing >= self.in_part_of:
            verdict = "partly"
        elif "cannot be judged" in verdicts and not (agreeing and "does not agree" in verdicts):
            verdict = "cannot be judged"
        if len({one.experts for one in findings}) == 1:
            held = tuple(all(parts) for parts in zip(*(one.held for one in findings), strict=True))
            experts = findings[0].experts
        else:
            held = tuple(held for one in findings for held in one.held)
            experts = tuple(expert for one in findings for expert in one.experts)
        return Finding(verdict, held, experts, too_few=any(one.too_few for one in findings))


Criterion = MeanBounds | InMost | Together
