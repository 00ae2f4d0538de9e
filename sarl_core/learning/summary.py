"""What a study of learning says: each arm over its seeds, against learning without a shield."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from sarl_core.learning.arms import ARMS, LearningArm
from sarl_core.learning.curves import Trial
from sarl_core.learning.study_files import LearningRun, LearningStudy
from sarl_core.rollouts.choices import Choice
from sarl_core.rollouts.statistics import (
    MeanInterval,
    Rate,
    ReturnStatistics,
    cost_interval,
    rate_over_groups,
    summarise_groups,
    worst_tenth,
)

SAFE_SHARE = 0.5
"""An arm is called safe while learning if it crashes at most this share as often as the learner
without a shield."""

_LATE = 0.1  # the share of the steps, at the end, that shows what learning had come to


@dataclass(frozen=True)
class TrialSummary:
    """The trials of an arm's R runs.

    Attributes:
        means: Mean return of each run, R entries.
        halves: Mean return of the first and of the second half of each run's episodes: what is
            chosen by the one can be told by the other.
        returns: Of all their episodes: mean, and interquartile mean with its 95 % interval over
            learners and episodes.
        crash_halves: The same two halves' shares of failures; those of all episodes where it was
            not kept which ones failed.
        failures: Episodes that ended by failure, with the 95 % interval of their share, over
            learners where there are several.
        worst_tenth: Mean return of the worst tenth of all episodes.
        cost: What an episode costs on average, with its 95 % interval; None where it is not known.
        intervention_rate: Mean share of the steps that the rules changed.
        coverage: Mean share of the steps to which a rule applied.
        freedom: Mean of what the rules left the policy to choose from, 0 to 1; None without a
            shield, or where it was not kept.
        episodes: How many there are, of all runs.
        cut: How many of them were cut off before their end; none of them is among the crashes.
    """

    means: tuple[float, ...]
    halves: tuple[float, float]
    returns: ReturnStatistics
    crash_halves: tuple[float, float]
    failures: Rate
    worst_tenth: float
    cost: MeanInterval | None
    intervention_rate: float
    coverage: float
    freedom: float | None
    episodes: int
    cut: int

    @property
    def crash_rate(self) -> float:
        """Share of all episodes that ended by failure."""
        return self.failures.rate

    @property
    def mean(self) -> float:
        """Mean over the runs."""
        return float(np.mean(self.means))


@dataclass(frozen=True)
class ArmSummary:
    """An arm over R finished runs.

    Attributes:
        arm: The way it learned.
        seeds: R seeds.
        crashes: Crashes of each run while learning, R entries.
        episodes: Episodes of each run while learning, R entries.
        learning_return: Mean return of all episodes while learning.
        late_return: Mean return of the episodes that ended in the last tenth of the steps.
        intervention_rate: Share of the steps, while learning, that the rules changed.
        late_intervention_rate: Likewise in the last tenth.
        alone: After learning, without a shield.
        shielded: After learning, with the shield on; None without rules.
        safe: Whether it crashed while learning at most `SAFE_SHARE` times as often as the same
            learner without a shield; None where that did not run, or where it is not known which
            ends of an episode are failures.
        good: Whether, without a shield after learning, its mean return is at least that of the
            same learner that never had one; likewise.
        failures_known: Whether it is known which ends of an episode are failures; else nothing is
            to be said of crashes.
    """

    arm: LearningArm
    seeds: tuple[int, ...]
    crashes: tuple[int, ...]
    episodes: tuple[int, ...]
    learning_return: float
    late_return: float
    intervention_rate: float
    late_intervention_rate: float
    alone: TrialSummary
    shielded: TrialSummary | None
    safe: bool | None = None
    good: bool | None = None
    failures_known: bool = True

    @property
    def mean_crashes(self) -> float:
        """Crashes of a run while learning, on average."""
        return float(np.mean(self.crashes))

    def to_dict(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {
            "arm": self.arm.name,
            "title": self.arm.title,
            "seeds": list(self.seeds),
            "crashes": list(self.crashes) if self.failures_known else None,
            "episodes": list(self.episodes),
            "mean_crashes": self.mean_crashes if self.failures_known else None,
            "learning_return": _number(self.learning_return),
            "late_return": _number(self.late_return),
            "intervention_rate": _number(self.intervention_rate),
            "late_intervention_rate": _number(self.late_intervention_rate),
            "alone": _trial_dict(self.alone, self.failures_known),
            "shielded": None
            if self.shielded is None
            else _trial_dict(self.shielded, self.failures_known),
            "safe": self.safe,
            "good": self.good,
        }


@dataclass(frozen=True)
class ComparedSummary:
    """An agent that has learned nothing here, on the episodes by which learners are judged.

    Attributes:
        agent: Its name.
        alone: Without a shield.
        shielded: With the shield on; None without rules.
        failures_known: As of an `ArmSummary`.
    """

    agent: str
    alone: TrialSummary
    shielded: TrialSummary | None
    failures_known: bool

    def to_dict(self) -> dict[str, Any]:
        """Ready for JSON."""
        known, shielded = self.failures_known, self.shielded
        return {
            "agent": self.agent,
            "alone": _trial_dict(self.alone, known),
            "shielded": None if shielded is None else _trial_dict(shielded, known),
        }


def summarise_study(study: LearningStudy) -> tuple[ArmSummary, ...]:
    """Sum up the finished runs.

    Args:
        study: With the runs there are.

    Returns:
        One entry an arm that has a finished run, in the study's order.
    """
    by_arm = {arm.name: _summary(study, arm) for arm in study.arms if study.of(arm)}
    if not study.failures_known:
        return tuple(replace(summary, failures_known=False) for summary in by_arm.values())
    return tuple(_judged(summary, by_arm.get(summary.arm.alone)) for summary in by_arm.values())


def summarise_compared(study: LearningStudy) -> ComparedSummary | None:
    """Sum up the agent that the learners are compared with.

    Args:
        study: Any.

    Returns:
        None where none was named.
    """
    compared = study.compared
    if compared is None:
        return None
    return ComparedSummary(
        compared.agent,
        _trials([compared.alone]),
        None if compared.shielded is None else _trials([compared.shielded]),
        study.failures_known,
    )


def best(summaries: Sequence[ArmSummary], choose: Choice = "return") -> ArmSummary | None:
    """The arm that is safe while learning and good afterwards.

    Args:
        summaries: Of `summarise_study`.
        choose: What comes first.

    Returns:
        Of those that are both, the one with the highest mean return afterwards, without a
        shield, in the first half of the episodes, or with the fewest failures there, and of equals
        the highest return; None if there is none.
    """
    both = [summary for summary in summaries if summary.safe and summary.good]

    def score(summary: ArmSummary) -> tuple[float, ...]:
        trials = summary.alone
        fewest = [-trials.crash_halves[0]] if choose == "failures" else []
        return (*fewest, trials.halves[0])

    return max(both, key=score, default=None)


def _summary(study: LearningStudy, arm: LearningArm) -> ArmSummary:
    runs = study.of(arm)
    late = round(study.steps * (1 - _LATE))

    def over(column: str, after: int = 0) -> float:
        """Sum of a column over the episodes of all runs that ended after some steps."""
        return sum(float(getattr(run.curve, column)[run.curve.ends > after].sum()) for run in runs)

    def count(after: int = 0) -> int:
        return sum(int((run.curve.ends > after).sum()) for run in runs)

    return ArmSummary(
        arm=arm,
        seeds=tuple(run.seed for run in runs),
        crashes=tuple(run.curve.crashes for run in runs),
        episodes=tuple(len(run.curve) for run in runs),
        learning_return=_ratio(over("returns"), count()),
        late_return=_ratio(over("returns", late), count(late)),
        intervention_rate=_ratio(over("interventions"), over("lengths")),
        late_intervention_rate=_ratio(over("interventions", late), over("lengths", late)),
        alone=_trials([run.alone for run in runs if run.alone is not None]),
        shielded=_shielded(runs),
    )


def _shielded(runs: Sequence[LearningRun]) -> TrialSummary | None:
    trials = [run.shielded for run in runs if run.shielded is not None]
    return _trials(trials) if trials else None


def _trials(trials: Sequence[Trial]) -> TrialSummary:
    episodes = sum(len(trial.returns) for trial in trials)
    failures = rate_over_groups(
        [trial.crashes for trial in trials],
        [len(trial.returns) for trial in trials],
        sum(trial.cut for trial in trials),
    )
    return TrialSummary(
        means=tuple(trial.mean for trial in trials),
        halves=_halves([trial.returns for trial in trials]),
        returns=_returns(tuple(trial.returns for trial in trials)),
        crash_halves=_halves([trial.failed for trial in trials])
        if all(trial.failed for trial in trials)
        else (failures.rate, failures.rate),
        failures=failures,
        worst_tenth=worst_tenth(
            np.concatenate([trial.returns for trial in trials]), worst="lowest"
        ),
        cost=_cost(trials),
        intervention_rate=float(np.mean([trial.intervention_rate for trial in trials])),
        coverage=float(np.mean([trial.coverage for trial in trials])),
        freedom=_freedom(trials),
        episodes=episodes,
        cut=sum(trial.cut for trial in trials),
    )


def _halves(groups: Sequence[Sequence[float]]) -> tuple[float, float]:
    """The means of the first and of the second half of each learner's episodes."""
    return (
        float(np.mean([group[: (len(group) + 1) // 2] for group in groups])),
        float(np.mean([group[len(group) // 2 :] for group in groups])),
    )


def _cost(trials: Sequence[Trial]) -> MeanInterval | None:
    """Over learners where there are several: what one of them does costs alike each time."""
    if not all(trial.costs for trial in trials):
        return None
    if len(trials) == 1:
        return cost_interval(trials[0].costs)
    return cost_interval([float(np.mean(trial.costs)) for trial in trials])


def _freedom(trials: Sequence[Trial]) -> float | None:
    known = [trial.freedom for trial in trials if trial.freedom is not None]
    return float(np.mean(known)) if len(known) == len(trials) else None


@lru_cache(maxsize=256)
def _returns(groups: tuple[tuple[float, ...], ...]) -> ReturnStatistics:
    """Kept, because who watches a study asks every second, and what is finished stays."""
    return summarise_groups(groups)


def _judged(summary: ArmSummary, alone: ArmSummary | None) -> ArmSummary:
    if alone is None or not summary.arm.shielded:
        return summary
    return replace(
        summary,
        safe=summary.mean_crashes <= SAFE_SHARE * alone.mean_crashes,
        good=summary.alone.mean >= alone.alone.mean,
    )


def reference(summaries: Sequence[ArmSummary], arm: LearningArm) -> ArmSummary | None:
    """The same learner without a shield.

    Args:
        summaries: Of `summarise_study`.
        arm: Any.

    Returns:
        Its summary; None if it did not run.
    """
    wanted = ARMS[arm.alone]
    return next((summary for summary in summaries if summary.arm == wanted), None)


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else float("nan")


def _number(value: float) -> float | None:
    """For JSON, which has no NaN."""
    return value if np.isfinite(value) else None


def _trial_dict(trials: TrialSummary, failures_known: bool) -> dict[str, Any]:
    returns = trials.returns
    fields = {
        "means": list(trials.means),
        "halves": list(trials.halves),
        "mean": trials.mean,
        "std": returns.std,
        "iqm": returns.iqm,
        "iqm_low": returns.low,
        "iqm_high": returns.high,
        "crash_rate": trials.crash_rate,
        "crash_low": trials.failures.low,
        "crash_high": trials.failures.high,
        "worst_tenth": trials.worst_tenth,
        **(
            {}
            if trials.cost is None
            else {
                "cost": trials.cost.mean,
                "cost_low": _number(trials.cost.low),
                "cost_high": _number(trials.cost.high),
            }
        ),
        "intervention_rate": trials.intervention_rate,
        "coverage": trials.coverage,
        **({} if trials.freedom is None else {"freedom": trials.freedom}),
        **({"cut": trials.cut} if trials.cut else {}),
    }
    unknown = dict.fromkeys(("crash_rate", "crash_low", "crash_high"))
    return fields if failures_known else fields | unknown
