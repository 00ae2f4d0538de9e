"""What each rule of a shield is worth: the same episodes again with that rule taken out.

Every episode without a rule is compared with the same seed under all rules. Only what can differ is
run: where a rule does not matter in an episode, as `rule_use` finds out, its removal changes
nothing there, exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.rollouts.episodes import Episodes, cut_text
from sarl_core.rollouts.rule_use import RuleUse
from sarl_core.rollouts.statistics import MeanInterval, mean_interval
from sarl_core.shielding.shield import Shield
from sarl_core.studies.paired_tests import holm, sign_flip_test

if TYPE_CHECKING:
    import pandas as pd

Verdict = Literal["load-bearing", "no difference seen", "harmful"]
VERDICTS: tuple[Verdict, ...] = ("load-bearing", "no difference seen", "harmful")

MOST_RULES = 200
ERROR_RATE = 0.05  # of all verdicts of one ablation together


@dataclass(frozen=True)
class RuleEffect:
    """What became of the episodes without one rule.

    Attributes:
        rule: Its index in the rule set.
        matched: Steps at which it was in force, under all rules.
        changed: Steps at which it changed the action.
        episodes: In which it mattered; the others are the same without it.
        difference: Return without the rule less the return with it, mean over all episodes, and
            Student's 95 % interval of that mean.
        failures: Episodes that end in failure without it.
        return_p: Of the difference in return, adjusted for all rules that were tested.
        failure_p: Of the difference in failures, likewise.
        verdict: Load-bearing if more episodes fail or the return is lower without it, harmful the
            other way round. Where the two point in different directions, failures decide.
    """

    rule: int
    matched: int
    changed: int
    episodes: int
    difference: MeanInterval
    failures: int
    return_p: float
    failure_p: float
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class Ablation:
    """K rules taken out one by one, E episodes each; arrays are read-only.

    Attributes:
        shield: With all its rules.
        base: The E episodes under it, without their steps.
        use: What each of its R rules did in them.
        rules: Indices of the rules that were taken out, the most used first, K.
        returns: Of the episodes without each of them, (K, E).
        failed: Whether they end in failure, (K, E) bool.
        left_out: Indices of rules that matter and were not taken out, because others were used
            more, or the work is not finished.
        played: Episodes that were run without some rule.
        cut: Whether they were cut off before their end, (K, E) bool; none where not given.
        undecided: Whether it is not known that they fail, or not, (K, E) bool; those that were cut
            off and have not failed where not given.
    """

    shield: Shield
    base: Episodes
    use: RuleUse
    rules: tuple[int, ...]
    returns: NDArray[np.float64]
    failed: NDArray[np.bool_]
    left_out: tuple[int, ...]
    played: int
    cut: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.bool_))
    undecided: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.bool_))

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        if not len(self.cut):
            object.__setattr__(self, "cut", np.zeros_like(self.failed))
        if not len(self.undecided):
            object.__setattr__(self, "undecided", self.cut & ~self.failed)
        make_read_only(self)

    @property
    def base_failures(self) -> int:
        """Episodes that end in failure under all rules."""
        return int(self.base.failed.sum())

    @property
    def failures_known(self) -> bool:
        """Whether it is known which of the environment's episodes are failures."""
        return self.base.failures_known

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know of how the episodes came about, as clauses."""
        cut = int((self.cut & self.use.matters[list(self.rules)]).sum())
        if not cut:
            return self.base.remarks
        remark = cut_text(
            cut, self.played, may_fail=self.failures_known, episodes="episodes without a rule"
        )
        return (*self.base.remarks, remark)

    @property
    def unused(self) -> tuple[int, ...]:
        """Enabled rules without which every episode is the same, step for step."""
        used = set(np.flatnonzero(self.use.matters.any(axis=1)).tolist())
        rules = enumerate(self.shield.rule_set.rules)
        return tuple(index for index, rule in rules if rule.enabled and index not in used)

    @property
    def tests(self) -> int:
        """How many differences were tested; those that are zero throughout need no test."""
        return int(self._p_values[2])

    @property
    def least_episodes(self) -> int:
        """So many episodes it takes for a verdict to be possible at all, were all to agree."""
        return 2 + math.floor(math.log2(max(self.tests, 1) / ERROR_RATE))

    @cached_property
    def _p_values(self) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
        """Adjusted p-values of the returns and of the failures, and how many were adjusted for."""
        both = np.concatenate([self._return_differences, self._failure_differences])
        tested = both.any(axis=1)
        adjusted = np.ones(len(both))
        adjusted[tested] = holm(sign_flip_test(both[tested]))
        count = len(self.rules)
        return adjusted[:count], adjusted[count:], int(tested.sum())

    @property
    def _return_differences(self) -> NDArray[np.float64]:
        return np.asarray(self.returns - self.base.returns)

    @property
    def _failure_differences(self) -> NDArray[np.float64]:
        fell = self.failed.astype(np.float64) - self.base.failed
        return np.where(self.undecided | self.base.undecided, 0.0, fell)

    @cached_property
    def effects(self) -> tuple[RuleEffect, ...]:
        """What became of the episodes without each rule, in the order of `rules`.

        Differences are tested by drawing their signs anew (`sign_flip_test`), returns and failures
        of all rules together, so that all verdicts hold with a chance of 95 % (Holm's method).
        """
        returns, failures, _ = self._p_values
        return tuple(
            RuleEffect(
                rule=rule,
                matched=int(self.use.matched[rule].sum()),
                changed=int(self.use.changed[rule].sum()),
                episodes=int(self.use.matters[rule].sum()),
                difference=mean_interval(gained),
                failures=int(self.failed[row].sum()),
                return_p=float(returns[row]),
                failure_p=float(failures[row]),
                verdict=_verdict(gained, fell, float(returns[row]), float(failures[row])),
            )
            for row, (rule, gained, fell) in enumerate(
                zip(self.rules, self._return_differences, self._failure_differences, strict=True)
            )
        )

    def to_frame(self) -> pd.DataFrame:
        """One row a rule that was taken out.

        Returns:
            Columns `rule` (its id), `action` (its label, or the first that it forbids), `verdict`,
            `steps_in_force`, `steps_changed`, `episodes`, `episodes_that_differ`,
            `return_difference`, `low`, `high`, `failures_with`, `failures_without`, `cut_with`,
            `cut_without` (episodes that were cut off), `return_p`, `failure_p`; where failures are
            not known, theirs are empty.
        """
        import pandas as pd

        rules, known = self.shield.rule_set.rules, self.failures_known
        return pd.DataFrame(
            [
                {
                    "rule": rules[effect.rule].id,
                    "action": rules[effect.rule].label,
                    "verdict": effect.verdict,
                    "steps_in_force": effect.matched,
                    "steps_changed": effect.changed,
                    "episodes": len(self.base),
                    "episodes_that_differ": effect.episodes,
                    "return_difference": effect.difference.mean,
                    "low": effect.difference.low,
                    "high": effect.difference.high,
                    "failures_with": self.base_failures if known else None,
                    "failures_without": effect.failures if known else None,
                    "cut_with": int(self.base.cut.sum()),
                    "cut_without": int(cut.sum()),
                    "return_p": effect.return_p,
                    "failure_p": effect.failure_p if known else None,
                }
                for effect, cut in zip(self.effects, self.cut, strict=True)
            ]
        )


def _verdict(
    gained: NDArray[np.float64], fell: NDArray[np.float64], return_p: float, failure_p: float
) -> Verdict:
    worse = 0.0
    if failure_p < ERROR_RATE:
        worse = float(fell.sum())
    elif return_p < ERROR_RATE:
        worse = -float(gained.sum())
    return "load-bearing" if worse > 0 else "harmful" if worse < 0 else "no difference seen"


def rules_to_take_out(use: RuleUse, most: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The rules whose removal changes an episode, the most used first.

    Args:
        use: What R rules did.
        most: How many to take out.

    Returns:
        Indices of those, and of those that are too many. Used most is what changed the action at
        the most steps, then what was in force at the most.
    """
    changed, matched = use.changed.sum(axis=1), use.matched.sum(axis=1)
    order = np.lexsort((np.arange(len(changed)), -matched, -changed))
    mattering = [int(index) for index in order if use.matters[index].any()]
    return tuple(mattering[:most]), tuple(mattering[most:])
