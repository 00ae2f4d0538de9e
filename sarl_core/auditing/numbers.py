"""What an audit says of a whole log, by numbers: the steps themselves may be elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.auditing.counts import LogCounts, Minute, Stretch
from sarl_core.auditing.drift import Drift
from sarl_core.documents import plain
from sarl_core.mining.evidence import EpisodeCounts, HeldOut, held_out_of
from sarl_core.mining.rule_set import RuleSet

if TYPE_CHECKING:
    import pandas as pd

_PER = 1_000  # steps that breaks are counted in, where no time is known


class LogTime(NamedTuple):
    """What is known of the times of a log.

    Attributes:
        step: Seconds from one step to the next, as `clock.usual_step` has it.
        minutes: All steps together, without the gaps.
        gaps: Where the time jumps ahead by more than `clock.GAP` steps, or goes back.
        longest_gap: Seconds of the longest jump ahead, 0 without any.
    """

    step: float
    minutes: float
    gaps: int
    longest_gap: float


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class AuditNumbers:
    """What rules say of a log of N steps in E episodes.

    Attributes:
        rule_set: R rules over d features and m action dimensions.
        counts: What was counted of the log, by its episodes.
        looked_at: Every which step was looked at for near misses; 1 if all were.
        step_seconds: The usual step; None where no time is known.
        drift: Whether the log still looks like the demonstrations.
        notes: What is to be said of how log and rules were matched, as clauses.
    """

    rule_set: RuleSet
    counts: LogCounts
    looked_at: int
    step_seconds: float | None
    drift: Drift
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """As `Audit(steps=15000, episodes=45, coverage=0.71, broken=204)`."""
        return (
            f"{type(self).__name__}(steps={self.steps}, episodes={self.n_episodes}, "
            f"coverage={self.coverage:.3g}, broken={self.broken})"
        )

    @cached_property
    def steps(self) -> int:
        """Number N of steps."""
        return int(self.counts.steps.sum())

    @property
    def n_episodes(self) -> int:
        """Number E of episodes."""
        return len(self.counts.steps)

    @cached_property
    def covered(self) -> int:
        """Number of steps in which some rule applies."""
        return int(self.counts.covered.sum())

    @cached_property
    def broken(self) -> int:
        """Number of steps in which some rule was broken.

        A shield would have changed them, save where never-rules forbid every label.
        """
        return int(self.counts.broken.sum())

    @cached_property
    def outside_count(self) -> int:
        """Number of steps that break a rule whose data do not reach them."""
        return int(self.counts.outside.sum())

    @property
    def freedom(self) -> float:
        """What a shield leaves an agent to choose from, mean over the steps, 0 to 1."""
        return float(self.counts.free.sum()) / (self.steps * len(self.rule_set.actions))

    @property
    def coverage(self) -> float:
        """Share of the steps in which some rule applies."""
        return self.covered / self.steps

    @property
    def agreement(self) -> float:
        """Share of the covered steps that break no rule; NaN where none is covered."""
        return 1.0 - self.broken / self.covered if self.covered else float("nan")

    @cached_property
    def agreement_by_episode(self) -> HeldOut:
        """The same counted by episodes, with its interval."""
        covered, broken = self.counts.covered, self.counts.broken
        return held_out_of(covered, covered - broken, whole_set=True)

    @cached_property
    def near_count(self) -> int:
        """Number of near misses, of the steps that were looked at."""
        return int(self.counts.near.sum())

    @property
    def near_share(self) -> float:
        """Share of near misses among the steps that were looked at."""
        return self.near_count / -(-self.steps // self.looked_at)

    @cached_property
    def obeyed_by_rule(self) -> list[HeldOut]:
        """Of each rule, the steps in which it was in force and those in which it was kept.

        As of `RuleEntries`: a never-rule is in force beside others.
        """
        counts, entries = self.counts, self.counts.rules
        order = np.argsort(entries.rule, kind="stable")
        return EpisodeCounts(
            len(self.rule_set),
            entries.rule[order],
            entries.episode[order],
            entries.applied[order],
            (entries.applied - entries.broken)[order],
            numbers=counts.episodes,
            lengths=counts.steps,
        ).held_out()

    @cached_property
    def outside_by_rule(self) -> NDArray[np.int64]:
        """Breaks of each rule in states that its data do not reach, (R,)."""
        entries = self.counts.rules
        counts = np.bincount(entries.rule, entries.outside, minlength=len(self.rule_set))
        return counts.astype(np.int64)

    @property
    def worst(self) -> tuple[Stretch, ...]:
        """The longest stretches of breaks, at most ten."""
        return self.counts.stretches

    @property
    def longest_run(self) -> int:
        """Steps of the longest stretch of breaks, 0 without any."""
        return self.worst[0].length if self.worst else 0

    @property
    def breaks_per_thousand(self) -> float:
        """Broken steps in a thousand steps."""
        return _PER * self.broken / self.steps

    @cached_property
    def time(self) -> LogTime | None:
        """When the steps were; None where the log does not say."""
        if self.step_seconds is None:
            return None
        counts = self.counts
        return LogTime(
            self.step_seconds,
            float(counts.seconds.sum()) / 60.0,
            int(counts.time_gaps.sum()),
            float(counts.longest_gap.max()),
        )

    @property
    def breaks_per_minute(self) -> float:
        """Broken steps in a minute, gaps left out; NaN where no time is known."""
        return float("nan") if self.time is None else self.broken / self.time.minutes

    @property
    def worst_minute(self) -> Minute | None:
        """The first minute with the most breaks; None without any, or where no time is known."""
        return next(iter(self.counts.minutes), None)

    @property
    def most_in_a_minute(self) -> float:
        """Breaks of the worst minute; NaN where no time is known."""
        if self.time is None:
            return float("nan")
        return 0.0 if self.worst_minute is None else float(self.worst_minute.breaks)

    @property
    def time_gaps(self) -> float:
        """Where the time between two steps of an episode jumps; NaN where no time is known."""
        return float("nan") if self.time is None else float(self.time.gaps)

    @property
    def gaps(self) -> int:
        """Where the numbers of the steps of an episode do not count up."""
        return int(self.counts.jumps.sum())

    @property
    def missing_steps(self) -> int:
        """Steps that the numbers leave out, as those in which a value was missing."""
        return int(self.counts.missing.sum())

    @cached_property
    def episodes(self) -> pd.DataFrame:
        """One row an episode.

        Returns:
            `episode`, `steps`, `covered`, `broken`, `longest_run`, `outside`, `near`, `agreement`
            (NaN where nothing is covered), `breaks_per_thousand`, `minutes`, `breaks_per_minute`
            and `worst_minute` (its breaks; all three NaN where no time is known), `first_row` in
            the log.
        """
        import pandas as pd

        counts = self.counts
        with np.errstate(invalid="ignore", divide="ignore"):
            agreement = 1.0 - counts.broken / counts.covered
        minutes = counts.seconds / 60.0
        worst = counts.worst_minute.astype(np.float64)
        if self.time is None:
            worst[:] = np.nan
        return pd.DataFrame(
            {
                "episode": counts.episodes,
                "steps": counts.steps,
                "covered": counts.covered,
                "broken": counts.broken,
                "longest_run": counts.longest_run,
                "outside": counts.outside,
                "near": counts.near,
                "agreement": agreement,
                "breaks_per_thousand": _PER * counts.broken / counts.steps,
                "minutes": minutes,
                "breaks_per_minute": counts.broken / minutes,
                "worst_minute": worst,
                "first_row": np.cumsum(counts.steps) - counts.steps,
            }
        )

    def rule_table(self) -> pd.DataFrame:
        """One row a rule, in their order.

        Returns:
            `name` (as "R1"), `id`, `applies` and `broken` (steps; of a never-rule those that no
            rule demands an action of its dimension in), `episodes` in which it applies,
            `obeyed` (the mean over these of the share in which it was kept) with `obeyed_low` and
            `obeyed_high` (95 %; NaN with too few episodes), `outside` (breaks that its data do not
            reach), `share` of the steps and `support` in the demonstrations.
        """
        import pandas as pd

        obeyed = self.obeyed_by_rule
        return pd.DataFrame(
            {
                "name": [self.rule_set.name_of(rule) for rule in self.rule_set],
                "id": [rule.id for rule in self.rule_set],
                "applies": np.array([one.samples for one in obeyed], dtype=np.int64),
                "broken": np.array([one.samples - one.correct for one in obeyed], dtype=np.int64),
                "episodes": np.array([one.episodes for one in obeyed], dtype=np.int64),
                "obeyed": np.array([one.share for one in obeyed], dtype=np.float64),
                "obeyed_low": np.array([one.low for one in obeyed], dtype=np.float64),
                "obeyed_high": np.array([one.high for one in obeyed], dtype=np.float64),
                "outside": self.outside_by_rule,
                "share": np.array([one.samples for one in obeyed]) / self.steps,
                "support": np.array([rule.support for rule in self.rule_set], dtype=np.float64),
            }
        )

    def to_dict(self) -> dict[str, Any]:
        """The document that ``audit --json`` prints, ready for JSON."""
        by_rule = self.rule_table().drop(columns=["share"]).to_dict("records")
        held = self.agreement_by_episode
        document: dict[str, Any] = {
            "steps": self.steps,
            "covered": self.covered,
            "broken": self.broken,
            "coverage": self.coverage,
            "agreement": self.agreement,
            "breaks": self.broken / self.steps,
            "agreement_by_episode": held._asdict(),
            "outside": self.outside_count,
            "near": {"count": self.near_count, "share": self.near_share, "every": self.looked_at},
            "freedom": self.freedom,
            "longest_run": self.longest_run,
            "breaks_per_thousand": self.breaks_per_thousand,
            "missing_steps": self.missing_steps,
            "gaps": self.gaps,
            "time": self._time_document,
            "worst": [
                {
                    **stretch._asdict(),
                    "rules": [self.rule_set.name_of(self.rule_set[at]) for at in stretch.rules],
                }
                for stretch in self.worst
            ],
            "rules": by_rule,
            "episodes": self.episodes.to_dict("records"),
            "drift": {
                "against": self.drift.against,
                "is_known": self.drift.is_known,
                "compared": len(self.drift.all),
                "drifted": len(self.drift.drifted),
                "features": [
                    {**one._asdict(), "drifted": one.drifted} for one in self.drift.features
                ],
                "rules": [{**one._asdict(), "drifted": one.drifted} for one in self.drift.rules],
            },
            "notes": list(self.notes),
        }
        return dict(plain(document))

    @property
    def _time_document(self) -> dict[str, Any] | None:
        """What is known of the log's times, None if nothing is."""
        time, minute = self.time, self.worst_minute
        if time is None:
            return None
        return {
            "step_seconds": time.step,
            "minutes": time.minutes,
            "breaks_per_minute": self.breaks_per_minute,
            "worst_minute": None if minute is None else minute._asdict(),
            "gaps": time.gaps,
            "longest_gap_seconds": time.longest_gap,
        }
