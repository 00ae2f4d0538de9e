"""The steps of a log, or of some of its episodes, held against rules."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.auditing import near
from sarl_core.auditing.clock import Clock, clock_of
from sarl_core.auditing.matching import MatchedLog
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.rule_set import RuleSet, obeying_labels
from sarl_core.shielding.shield import Shield

_DIGITS = 12  # of freedom: the mean of whole numbers, multiplied again, is whole once more


class Yardsticks(NamedTuple):
    """What every step of a log is measured by, wherever it is counted.

    Attributes:
        spreads: Of the features, for near misses, (d,).
        every: Every which step of the log is looked at for near misses; 1 if all are.
        step_seconds: The log's usual step; None where no time is known.
        quarters: Of the features of the demonstrations, (3, d); None where the log is compared
            with what the rules say of them.
    """

    spreads: NDArray[np.float64]
    every: int
    step_seconds: float | None
    quarters: NDArray[np.float64] | None


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class HeldSteps:
    """What rules say of each of N steps in E episodes; arrays are read-only.

    Attributes:
        rule_set: R rules over d features and m action dimensions.
        log: The steps.
        observations: Of the log in the rules' order, (N, d) float32.
        labels: What was done, as the rules' labels, (N, m).
        done: The same, as the rules' own actions, (N,) or (N, m).
        rules: Index of the rule in force or -1, (N, m): that which demands an action, else the
            never-rule that was broken, else the first that applies.
        breaks: Where what was done does not obey the rule in force, (N, m).
        executed: What a shield would have executed, (N,) or (N, m).
        outside: Whether a broken rule's data do not reach the state, (N,).
        near: Index of a rule that was not in force and would have been broken, had one feature been
            at most `near.NEAR` of its spread different; -1 where there is none, and at steps that
            break a rule anyway, (N,).
        free: Freedom that a shield leaves an agent, added up over the action dimensions, (N,): of
            rules that demand, how many dimensions have every label left.
        clock: When the steps were; None where no time is known.
    """

    rule_set: RuleSet
    log: Demonstrations
    observations: NDArray[np.float32]
    labels: NDArray[np.int64]
    done: NDArray[Any]
    rules: NDArray[np.int64]
    breaks: NDArray[np.bool_]
    executed: NDArray[Any]
    outside: NDArray[np.bool_]
    near: NDArray[np.int64]
    free: NDArray[np.float64]
    clock: Clock | None

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        make_read_only(self)

    @cached_property
    def is_covered(self) -> NDArray[np.bool_]:
        """Where some rule applies, (N,)."""
        return np.asarray((self.rules >= 0).any(axis=1))

    @cached_property
    def is_broken(self) -> NDArray[np.bool_]:
        """Where some rule in force was broken, (N,)."""
        return np.asarray(self.breaks.any(axis=1))

    @cached_property
    def jumps(self) -> NDArray[np.int64]:
        """How many steps the numbers leave out after each step of an episode, (N,)."""
        assert self.log.steps is not None
        jumps = np.append(np.diff(self.log.steps) - 1, 0)
        jumps[self.log.episode_starts[1:] - 1] = 0
        return np.asarray(jumps)

    @cached_property
    def runs(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First row and length of every stretch of breaks, within its episode."""
        broken = self.is_broken
        begins = np.zeros(len(broken), dtype=np.bool_)
        begins[self.log.episode_starts] = True
        begins[1:] |= self.jumps[:-1] != 0  # what was done in between, nobody knows
        if self.clock is not None:
            begins[self.clock.gaps + 1] = True
        first = broken & (begins | ~np.append(False, broken[:-1]))
        rows = np.flatnonzero(broken)
        starts = np.flatnonzero(first[rows])
        return rows[starts], np.diff(np.append(starts, len(rows)))


def held_steps(
    shield: Shield,
    log: Demonstrations,
    matched: MatchedLog,
    yardsticks: Yardsticks,
    *,
    before: int = 0,
) -> HeldSteps:
    """Hold rules against steps.

    Args:
        shield: With the rules in force.
        log: N steps: a log, or some of its episodes.
        matched: The same as the rules take them.
        yardsticks: Of the whole log.
        before: Steps of the log that stand before these.

    Returns:
        What the rules say of each; the same, whatever else is in the log.
    """
    rule_set = shield.rule_set
    decision = shield.decide_batch(matched.observations, matched.actions)
    obeying = obeying_labels(rule_set)
    # The last row is that of -1: where no rule is in force, none is broken.
    obeying = np.vstack([obeying, np.ones(obeying.shape[1], dtype=np.bool_)])
    breaks = ~obeying[decision.rules, matched.labels]
    looked_at = slice(-before % yardsticks.every, None, yardsticks.every)
    nearly = np.full(len(log), -1, dtype=np.int64)
    nearly[looked_at] = near.near_misses(
        rule_set, matched.observations[looked_at], matched.labels[looked_at], yardsticks.spreads
    )
    nearly[breaks.any(axis=1)] = -1
    free = shield.freedom(matched.observations, decision.rules) * len(rule_set.actions)
    return HeldSteps(
        rule_set=rule_set,
        log=log,
        observations=matched.observations,
        labels=matched.labels,
        done=matched.actions,
        rules=decision.rules,
        breaks=breaks,
        executed=decision.executed,
        outside=decision.outside,
        near=nearly,
        free=np.round(free, _DIGITS),
        clock=clock_of(log, yardsticks.step_seconds),
    )
