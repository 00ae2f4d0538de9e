"""What can be measured of a rule, as an axis of a figure and in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sarl_core.demonstrations.dataset import Feature
from sarl_core.mining.language import merged_length, share_text
from sarl_core.mining.rules import Rule


@dataclass(frozen=True)
class RuleMeasure:
    """A number that a rule has.

    Attributes:
        title: What it is called in the table of rules.
        read: The number, given the features that rules ask about; NaN where the rule has none.
        share: Whether it is a share of something, from 0 to 1.
        whole: Whether it counts something.
        powers: Whether a rule can have many times as much of it as another.
    """

    title: str
    read: Callable[[Rule, Sequence[Feature]], float]
    share: bool = False
    whole: bool = False
    powers: bool = False

    def text(self, value: float) -> str:
        """The number for people.

        Args:
            value: What `read` gave.

        Returns:
            As "2.5 %", "412" or "1.92"; "–" for NaN.
        """
        if math.isnan(value):
            return "–"
        return (
            share_text(value) if self.share else f"{value:,.0f}" if self.whole else f"{value:.2f}"
        )


def _reached(rule: Rule, value: float) -> float:
    """What follows from the states of a rule."""
    return value if rule.samples else math.nan


def _held_out(rule: Rule) -> float:
    share = None if rule.held_out is None else rule.held_out.share
    return math.nan if share is None else share


def _lower_bound(rule: Rule) -> float:
    low = None if rule.held_out is None else rule.held_out.low
    return math.nan if low is None else low


MEASURES = (
    RuleMeasure("Support", lambda rule, _: rule.support, share=True, powers=True),
    RuleMeasure("Confidence", lambda rule, _: _reached(rule, rule.confidence), share=True),
    RuleMeasure("Lift", lambda rule, _: _reached(rule, rule.lift)),
    RuleMeasure("Joint support", lambda rule, _: rule.joint_support, share=True, powers=True),
    RuleMeasure("States", lambda rule, _: float(rule.samples), whole=True, powers=True),
    RuleMeasure("Length", lambda rule, _: float(rule.length), whole=True),
    RuleMeasure(
        "Merged length",
        lambda rule, features: float(merged_length(rule, features)),
        whole=True,
    ),
    RuleMeasure("Held out", lambda rule, _: _held_out(rule), share=True),
    RuleMeasure("Lower bound", lambda rule, _: _lower_bound(rule), share=True),
)


def measures_of(rules: Sequence[Rule], features: Sequence[Feature]) -> tuple[RuleMeasure, ...]:
    """The measures that rules have.

    Args:
        rules: Any.
        features: What they ask about.

    Returns:
        Those that are known of at least one, as what is held out is not always.
    """
    return tuple(
        measure
        for measure in MEASURES
        if not all(math.isnan(measure.read(rule, features)) for rule in rules)
    )
