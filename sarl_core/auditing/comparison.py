"""Two logs side by side, as before and after a change."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from sarl_core.auditing.drift import Moved, Shares, differences, moved
from sarl_core.auditing.numbers import AuditNumbers
from sarl_core.mining.evidence import FEWEST_EPISODES


@dataclass(frozen=True, eq=False)
class LogComparison:
    """The same rules held against two logs.

    Attributes:
        before: The first log.
        after: The second.
    """

    before: AuditNumbers
    after: AuditNumbers

    @property
    def is_known(self) -> bool:
        """Whether both have enough episodes for intervals."""
        return min(one.n_episodes for one in (self.before, self.after)) >= FEWEST_EPISODES

    @cached_property
    def differences(self) -> tuple[Moved, ...]:
        """Shares of the steps, each episode counted once, with intervals that hold together.

        Coverage, breaks, breaks outside the data, near misses; then for each rule the steps in
        which it applies, and those in which it is broken.
        """
        rules = self.before.rule_set
        names = [
            ("coverage", "steps with a rule"),
            ("breaks", "steps that break a rule"),
            ("outside", "steps that break a rule whose data do not reach them"),
            ("near misses", "steps that nearly break a rule"),
            *((rules.name_of(rule), "steps in which it applies") for rule in rules),
            *((rules.name_of(rule), "steps in which it is broken") for rule in rules),
        ]
        return moved(names, differences(_shares(self.after), _shares(self.before)))

    def to_dict(self) -> dict[str, Any]:
        """For JSON: what differs, and the numbers of the second log."""
        return {
            "is_known": self.is_known,
            "differences": [{**one._asdict(), "differs": one.drifted} for one in self.differences],
            "after": self.after.to_dict(),
        }


def _shares(audit: AuditNumbers) -> Shares:
    counts, size = audit.counts, len(audit.rule_set)
    columns = (counts.covered, counts.broken, counts.outside, counts.near)
    rules = (counts.rules.applied, counts.rules.broken)
    return Shares(
        np.hstack(
            [np.stack(columns, axis=1), *(counts.by_rule(values, size) for values in rules)]
        ).astype(np.float64),
        counts.steps.astype(np.float64),
    )
