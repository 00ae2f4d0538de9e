"""Conditions on the numbers of an audit, as `breaks>0.02`, that guard a job."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable
from typing import NamedTuple

from sarl_core.auditing.numbers import AuditNumbers
from sarl_core.errors import InputError, quoted

_COMPARED = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}
_FORM = re.compile(r"\s*(\w+)\s*(>=|<=|>|<)\s*([+-]?[0-9]*\.?[0-9]+(?:[eE][+-]?[0-9]+)?)\s*(%?)\s*")

MEASURES: dict[str, Callable[[AuditNumbers], float]] = {
    "breaks": lambda audit: audit.broken / audit.steps,
    "coverage": lambda audit: audit.coverage,
    "agreement": lambda audit: audit.agreement,
    "outside": lambda audit: audit.outside_count / audit.steps,
    "near": lambda audit: audit.near_share,
    "freedom": lambda audit: audit.freedom,
    "longest_run": lambda audit: float(audit.longest_run),
    "breaks_per_thousand": lambda audit: audit.breaks_per_thousand,
    "breaks_per_minute": lambda audit: audit.breaks_per_minute,
    "worst_minute": lambda audit: audit.most_in_a_minute,
    "drift": lambda audit: float(len(audit.drift.drifted)),
    "missing_steps": lambda audit: audit.missing_steps / (audit.steps + audit.missing_steps),
    "gaps": lambda audit: float(audit.gaps),
    "time_gaps": lambda audit: audit.time_gaps,
    "steps": lambda audit: float(audit.steps),
}
"""What a condition may ask about; shares are of the steps, `agreement` of the covered ones."""


class GuardCondition(NamedTuple):
    """A measure compared with a number.

    Attributes:
        text: As it was written.
        measure: One of `MEASURES`.
        sign: How it is compared.
        number: With what.
    """

    text: str
    measure: str
    sign: str
    number: float

    def value(self, audit: AuditNumbers) -> float:
        """What the measure is in an audit; NaN where it has none, as agreement without coverage."""
        return MEASURES[self.measure](audit)

    def holds(self, audit: AuditNumbers) -> bool:
        """Whether it holds; a guard that cannot know counts as if it did."""
        value = self.value(audit)
        return math.isnan(value) or bool(_COMPARED[self.sign](value, self.number))


def guard(text: str) -> GuardCondition:
    """Read a condition.

    Args:
        text: A measure, one of `> >= < <=`, and a number, perhaps in per cent.

    Returns:
        The condition.

    Raises:
        InputError: If it is of another form, or the measure is unknown.
    """
    match = _FORM.fullmatch(text)
    if match is None:
        raise InputError(
            f"the condition {quoted(text)} is none; write a measure, one of > >= < <= and a "
            "number, as breaks>0.02"
        )
    measure, sign, number, per_cent = match.groups()
    if measure not in MEASURES:
        raise InputError(
            f"the condition {quoted(text)} asks about {quoted(measure)}, which is no measure; "
            f"choose one of {', '.join(sorted(MEASURES))}"
        )
    return GuardCondition(text.strip(), measure, sign, float(number) / (100.0 if per_cent else 1.0))
