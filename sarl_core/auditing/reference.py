"""What the steps of a log are measured by, and what the whole log is compared with."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.auditing import near
from sarl_core.auditing.clock import usual_step
from sarl_core.auditing.counts import LogCounts
from sarl_core.auditing.drift import Drift
from sarl_core.auditing.feature_counts import Edges
from sarl_core.auditing.log_drift import drift_from_demonstrations, drift_from_rules, edges_of
from sarl_core.auditing.matching import matched_states
from sarl_core.auditing.steps import Yardsticks
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.distributed.survey import Keys
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.shield import Shield


class Reference(NamedTuple):
    """Demonstrations that logs are compared with, in little.

    Attributes:
        spreads: Of the features, (d,).
        edges: What was counted of them.
    """

    spreads: NDArray[np.float64]
    edges: Edges


class LogSample(NamedTuple):
    """What is to be known of a whole log before its steps are held against rules.

    Attributes:
        steps: Number N of steps.
        observations: Of M of them in the rules' order, those of `near.in_sample` among them,
            (M, d).
        keys: Of these, (M,).
        medians: How long the steps of its episodes last, as of `clock.steps_in_episodes`.
        timed: How many such steps each has.
    """

    steps: int
    observations: NDArray[np.float32]
    keys: Keys
    medians: NDArray[np.float64]
    timed: NDArray[np.int64]

    def yardsticks(self, rule_set: RuleSet, reference: Reference | None) -> Yardsticks:
        """What every step is measured by.

        Args:
            rule_set: The rules.
            reference: Of the demonstrations; None where they are not there.

        Returns:
            The same, whatever the order of the sample.
        """
        return Yardsticks(
            near.spreads_of(self.observations, self.keys)
            if reference is None
            else reference.spreads,
            near.looked_at(rule_set, self.steps),
            usual_step(self.medians, self.timed),
            None if reference is None else reference.edges.quarters,
        )


def reference_of(shield: Shield, demonstrations: Demonstrations) -> Reference:
    """What logs are compared with, of demonstrations.

    Args:
        shield: With the rules in force.
        demonstrations: What they were mined from.

    Returns:
        Little of them.

    Raises:
        InputError: If they are of other features than the rules.
    """
    rule_set = shield.rule_set
    observations, _ = matched_states(rule_set, demonstrations, called="the demonstrations")
    return Reference(
        near.spreads_of(observations, near.sample_keys(demonstrations)),
        edges_of(rule_set, demonstrations, observations, shield.rules_in_force(observations)),
    )


def drift_of(rule_set: RuleSet, counts: LogCounts, reference: Reference | None) -> Drift:
    """Whether a log still looks like the demonstrations.

    Args:
        rule_set: The rules.
        counts: Of the log.
        reference: Of the demonstrations; None to go by what the rules say of them.

    Returns:
        What moved.
    """
    if reference is None:
        return drift_from_rules(rule_set, counts)
    return drift_from_demonstrations(rule_set, counts, reference.edges)
