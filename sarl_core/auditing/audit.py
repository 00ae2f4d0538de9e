"""Rules held against a log of what somebody did, with no environment."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.auditing import near
from sarl_core.auditing.clock import steps_in_episodes
from sarl_core.auditing.counts import counts_of
from sarl_core.auditing.matching import matched_log
from sarl_core.auditing.numbers import AuditNumbers
from sarl_core.auditing.reference import LogSample, drift_of, reference_of
from sarl_core.auditing.steps import HeldSteps, held_steps
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import require
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Audit(AuditNumbers, HeldSteps):
    """What rules say of a log of N steps in E episodes: the numbers, and every step."""

    def to_frame(self) -> pd.DataFrame:
        """One row a step.

        Returns:
            `episode`, `step`; for each action dimension what was `done`, the `rule` in force (as
            "R1", or "") and whether it was `broken`; `outside`, `near` (as "R1", or ""), and the
            `executed` action of a shield. Columns of several dimensions end in `_<i>`.
        """
        import pandas as pd

        names = np.array([*(self.rule_set.name_of(rule) for rule in self.rule_set), ""])
        columns: dict[str, Any] = {"episode": self.log.episodes, "step": self.log.steps}
        done, executed = (one.reshape(self.steps, -1) for one in (self.done, self.executed))
        m = len(self.rule_set.actions)
        for index, dimension in enumerate(self.rule_set.actions):
            end = "" if m == 1 else f"_{index}"
            labels = np.array(dimension.label_names)
            interval = dimension.is_interval
            columns[f"done{end}"] = (
                done[:, index] if interval else _words(labels, self.labels[:, index])
            )
            columns[f"rule{end}"] = _words(names, self.rules[:, index])
            columns[f"broken{end}"] = self.breaks[:, index]
            columns[f"executed{end}"] = (
                executed[:, index]
                if interval
                else _words(labels, dimension.labels_of(executed[:, index]))
            )
        columns |= {"outside": self.outside, "near": _words(names, self.near)}
        return pd.DataFrame(columns)


def audit(
    rule_set: RuleSet,
    log: Demonstrations,
    *,
    projection: Projection = "centre",
    demonstrations: Demonstrations | None = None,
) -> Audit:
    """Hold rules against a log: what somebody did, step by step.

    Args:
        rule_set: The rules; those that are switched off are left out.
        log: N steps, of the features, units and labels that the rules were mined from, in any
            order; they are matched by their names.
        projection: What a shield would have made of a continuous action that breaks a rule.
        demonstrations: What the rules were mined from, to compare distributions with; where not
            given, the log is compared with what the rules say of them: supports and data boxes.

    Returns:
        The audit. A million steps of eight features and fifty rules take a few seconds.

    Raises:
        InputError: If the log is of other features, units, actions or labels than the rules.
    """
    require(rule_set, RuleSet, "the rules must be a RuleSet", "load one: load_rules(path)")
    must = "the log must be Demonstrations"
    require(log, Demonstrations, must, "load it: load_demonstrations(path)")
    shield = Shield(rule_set, projection=projection)
    matched = matched_log(rule_set, log)
    reference = None if demonstrations is None else reference_of(shield, demonstrations)
    keys = near.sample_keys(log)
    sample = LogSample(len(log), matched.observations, keys, *steps_in_episodes(log))
    yardsticks = sample.yardsticks(rule_set, reference)
    held = held_steps(shield, log, matched, yardsticks)
    counts = counts_of(held, yardsticks.quarters)
    steps: dict[str, Any] = {one.name: getattr(held, one.name) for one in fields(HeldSteps)}
    return Audit(
        **steps,
        counts=counts,
        looked_at=yardsticks.every,
        step_seconds=yardsticks.step_seconds,
        drift=drift_of(rule_set, counts, reference),
        notes=tuple(dict.fromkeys((*log.notes, *matched.notes))),
    )


def _words(names: NDArray[np.str_], places: NDArray[np.int64]) -> Any:
    """A column of few words; -1 is the last."""
    import pandas as pd

    known, first = np.unique(names, return_inverse=True)
    return pd.Categorical.from_codes(first[places], known.tolist())
