"""Rules held against a log of what somebody did, with no environment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.arrays import make_read_only
from sarl_core.auditing import near
from sarl_core.auditing.clock import Clock, clock_of
from sarl_core.auditing.drift import Drift, by_episode, rule_counts
from sarl_core.auditing.log_drift import drift_from_demonstrations, drift_from_rules
from sarl_core.auditing.matching import matched_log
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.documents import plain
from sarl_core.errors import require
from sarl_core.mining.evidence import EpisodeCounts, HeldOut, held_out_of
from sarl_core.mining.rule_set import RuleSet, require_demands
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield

if TYPE_CHECKING:
    import pandas as pd

_WORST = 10  # stretches that are told
_PER = 1_000  # steps that breaks are counted in, where no time is known


class Stretch(NamedTuple):
    """Breaks one after the other, in one episode.

    Attributes:
        episode: What the episode is called.
        step: Of the first of them.
        row: Its row in the log, from 0.
        length: How many steps.
        seconds: How long they last; None where no time is known.
        rules: Places in the rule set of the rules that were broken, ascending.
    """

    episode: int
    step: int
    row: int
    length: int
    seconds: float | None
    rules: tuple[int, ...]


class Minute(NamedTuple):
    """The minute with the most breaks, in one episode.

    Attributes:
        episode: What the episode is called.
        step: Of the first of them.
        row: Its row in the log, from 0.
        breaks: How many.
    """

    episode: int
    step: int
    row: int
    breaks: int


@dataclass(frozen=True, eq=False, repr=False)
class Audit:
    """What rules say of a log of N steps in E episodes; arrays are read-only.

    Attributes:
        rule_set: R rules over d features and m action dimensions.
        log: The steps.
        observations: Of the log in the rules' order, (N, d) float32.
        labels: What was done, as the rules' labels, (N, m).
        rules: Index of the rule in force or -1, (N, m).
        breaks: Where what was done is not what the rule in force says, (N, m).
        executed: What a shield would have executed, (N,) or (N, m).
        outside: Whether a broken rule's data do not reach the state, (N,).
        near: Index of a rule that was not in force and would have been broken, had one feature been
            at most `near.NEAR` of its spread different; -1 where there is none, and at steps that
            break a rule anyway, (N,).
        looked_at: Every which step was looked at for near misses; 1 if all were.
        freedom: What a shield leaves an agent to choose from, mean over the steps, 0 to 1.
        drift: Whether the log still looks like the demonstrations.
        notes: What is to be said of how log and rules were matched, as clauses.
    """

    rule_set: RuleSet
    log: Demonstrations
    observations: NDArray[np.float32]
    labels: NDArray[np.int64]
    rules: NDArray[np.int64]
    breaks: NDArray[np.bool_]
    executed: NDArray[Any]
    outside: NDArray[np.bool_]
    near: NDArray[np.int64]
    looked_at: int
    freedom: float
    drift: Drift
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        make_read_only(self)

    def __repr__(self) -> str:
        """As `Audit(steps=15000, episodes=45, coverage=0.71, broken=204)`."""
        return (
            f"Audit(steps={self.steps}, episodes={self.log.n_episodes}, "
            f"coverage={self.coverage:.3g}, broken={self.broken})"
        )

    @property
    def steps(self) -> int:
        """Number N of steps."""
        return len(self.log)

    @cached_property
    def is_covered(self) -> NDArray[np.bool_]:
        """Where some rule applies, (N,)."""
        return np.asarray((self.rules >= 0).any(axis=1))

    @cached_property
    def is_broken(self) -> NDArray[np.bool_]:
        """Where some rule in force was broken, (N,)."""
        return np.asarray(self.breaks.any(axis=1))

    @cached_property
    def covered(self) -> int:
        """Number of steps in which some rule applies."""
        return int(self.is_covered.sum())

    @cached_property
    def broken(self) -> int:
        """Number of steps in which some rule was broken; a shield would have changed them."""
        return int(self.is_broken.sum())

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
        starts = self.log.episode_starts
        covered, broken = by_episode(self.is_covered, starts), by_episode(self.is_broken, starts)
        return held_out_of(covered, covered - broken, whole_set=True)

    @cached_property
    def near_count(self) -> int:
        """Number of near misses, of the steps that were looked at."""
        return int((self.near >= 0).sum())

    @property
    def near_share(self) -> float:
        """Share of near misses among the steps that were looked at."""
        return self.near_count / -(-self.steps // self.looked_at)

    @cached_property
    def obeyed_by_rule(self) -> list[HeldOut]:
        """Of each rule, the steps in which it was in force and those in which it was kept."""
        return self._by_rule.held_out()

    @cached_property
    def _by_rule(self) -> EpisodeCounts:
        size, starts = len(self.rule_set), self.log.episode_starts
        obeyed = np.where(self.breaks, -1, self.rules)
        applied, correct = (
            rule_counts(self.rule_set, which, starts)[:, :size] for which in (self.rules, obeyed)
        )
        episode, thing = np.nonzero(applied)
        order = np.lexsort((episode, thing))
        episode, thing = episode[order], thing[order]
        return EpisodeCounts(
            size,
            thing,
            episode,
            applied[episode, thing].astype(np.int64),
            correct[episode, thing].astype(np.int64),
            numbers=self.log.episodes[starts],
            lengths=self.log.episode_lengths,
        )

    @cached_property
    def outside_by_rule(self) -> NDArray[np.int64]:
        """Breaks of each rule in states that its data do not reach, (R,)."""
        where = self.breaks & self.outside[:, None]
        return np.bincount(self.rules[where], minlength=len(self.rule_set)).astype(np.int64)

    @cached_property
    def runs(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First row and length of every stretch of breaks, within its episode."""
        broken = self.is_broken
        begins = np.zeros(self.steps, dtype=np.bool_)
        begins[self.log.episode_starts] = True
        begins[1:] |= self._jumps != 0  # what was done in between, nobody knows
        if self.clock is not None:
            begins[self.clock.gaps + 1] = True
        first = broken & (begins | ~np.append(False, broken[:-1]))
        rows = np.flatnonzero(broken)
        starts = np.flatnonzero(first[rows])
        return rows[starts], np.diff(np.append(starts, len(rows)))

    @cached_property
    def worst(self) -> tuple[Stretch, ...]:
        """The longest stretches of breaks, at most ten."""
        rows, lengths = self.runs
        assert self.log.steps is not None
        stretches = []
        for place in np.argsort(-lengths, kind="stable")[:_WORST].tolist():
            row, length = int(rows[place]), int(lengths[place])
            part = slice(row, row + length)
            stretches.append(
                Stretch(
                    int(self.log.episodes[row]),
                    int(self.log.steps[row]),
                    row,
                    length,
                    None if self.clock is None else float(self.clock.seconds[part].sum()),
                    tuple(np.unique(self.rules[part][self.breaks[part]]).tolist()),
                )
            )
        return tuple(stretches)

    @property
    def longest_run(self) -> int:
        """Steps of the longest stretch of breaks, 0 without any."""
        return self.worst[0].length if self.worst else 0

    @property
    def breaks_per_thousand(self) -> float:
        """Broken steps in a thousand steps."""
        return _PER * self.broken / self.steps

    @cached_property
    def clock(self) -> Clock | None:
        """When the steps were; None where the log does not say."""
        return clock_of(self.log)

    @property
    def breaks_per_minute(self) -> float:
        """Broken steps in a minute, gaps left out; NaN where no time is known."""
        return float("nan") if self.clock is None else self.broken / self.clock.minutes

    @cached_property
    def worst_minute(self) -> Minute | None:
        """The first minute with the most breaks; None without any, or where no time is known."""
        if self.clock is None or not self.broken:
            return None
        assert self.log.steps is not None
        rows = np.flatnonzero(self.is_broken)
        breaks = self.clock.most_in_a_minute(rows)
        row = int(rows[np.argmax(breaks)])
        return Minute(int(self.log.episodes[row]), int(self.log.steps[row]), row, int(breaks.max()))

    @property
    def most_in_a_minute(self) -> float:
        """Breaks of the worst minute; NaN where no time is known."""
        if self.clock is None:
            return float("nan")
        return 0.0 if self.worst_minute is None else float(self.worst_minute.breaks)

    @property
    def time_gaps(self) -> float:
        """Where the time between two steps of an episode jumps; NaN where no time is known."""
        return float("nan") if self.clock is None else float(len(self.clock.gaps))

    @cached_property
    def _jumps(self) -> NDArray[np.int64]:
        """How many steps the numbers leave out after each step of an episode, (N - 1,)."""
        assert self.log.steps is not None
        jumps = np.diff(self.log.steps) - 1
        jumps[self.log.episode_starts[1:] - 1] = 0
        return np.asarray(jumps)

    @property
    def gaps(self) -> int:
        """Where the numbers of the steps of an episode do not count up."""
        return int((self._jumps != 0).sum())

    @property
    def missing_steps(self) -> int:
        """Steps that the numbers leave out, as those in which a value was missing."""
        return int(self._jumps[self._jumps > 0].sum())

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

        starts, lengths = self.log.episode_starts, self.log.episode_lengths
        covered, broken, outside, near_ones = (
            by_episode(column, starts).astype(np.int64)
            for column in (self.is_covered, self.is_broken, self.outside, self.near >= 0)
        )
        longest = np.zeros(len(starts), dtype=np.int64)
        rows, run = self.runs
        np.maximum.at(longest, np.searchsorted(starts, rows, side="right") - 1, run)
        with np.errstate(invalid="ignore", divide="ignore"):
            agreement = 1.0 - broken / covered
        minutes, worst = np.full((2, len(starts)), np.nan)
        if self.clock is not None:
            minutes = np.add.reduceat(self.clock.seconds, starts) / 60.0
            worst = np.zeros(len(starts))
            broken_rows = np.flatnonzero(self.is_broken)
            places = np.searchsorted(starts, broken_rows, side="right") - 1
            np.maximum.at(worst, places, self.clock.most_in_a_minute(broken_rows))
        return pd.DataFrame(
            {
                "episode": self.log.episodes[starts],
                "steps": lengths,
                "covered": covered,
                "broken": broken,
                "longest_run": longest,
                "outside": outside,
                "near": near_ones,
                "agreement": agreement,
                "breaks_per_thousand": _PER * broken / lengths,
                "minutes": minutes,
                "breaks_per_minute": broken / minutes,
                "worst_minute": worst,
                "first_row": starts,
            }
        )

    def rule_table(self) -> pd.DataFrame:
        """One row a rule, in their order.

        Returns:
            `name` (as "R1"), `id`, `applies` and `broken` (steps), `episodes` in which it applies,
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
        executed = self.executed.reshape(self.steps, -1)
        m = len(self.rule_set.actions)
        for index, dimension in enumerate(self.rule_set.actions):
            end = "" if m == 1 else f"_{index}"
            labels = np.array(dimension.label_names)
            interval = dimension.is_interval
            columns[f"done{end}"] = (
                self._done[:, index] if interval else _words(labels, self.labels[:, index])
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

    @property
    def _done(self) -> NDArray[Any]:
        return matched_log(self.rule_set, self.log).actions.reshape(self.steps, -1)

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
            "outside": int(self.outside.sum()),
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
        clock, minute = self.clock, self.worst_minute
        if clock is None:
            return None
        return {
            "step_seconds": clock.step,
            "minutes": clock.minutes,
            "breaks_per_minute": self.breaks_per_minute,
            "worst_minute": None if minute is None else minute._asdict(),
            "gaps": len(clock.gaps),
            "longest_gap_seconds": clock.longest_gap,
        }


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
    require_demands(rule_set, "the audit")
    must = "the log must be Demonstrations"
    require(log, Demonstrations, must, "load it: load_demonstrations(path)")
    matched = matched_log(rule_set, log)
    shield = Shield(rule_set, projection=projection)
    decision = shield.decide_batch(matched.observations, matched.actions)
    says = np.array([rule.action for rule in rule_set.rules] + [-1], dtype=np.int64)
    breaks = (decision.rules >= 0) & (matched.labels != says[decision.rules])
    every = near.looked_at(rule_set, len(log))
    demonstrated = None
    if demonstrations is not None:
        demonstrated = matched_log(
            rule_set, demonstrations, called="the demonstrations"
        ).observations
    spreads = near.spreads_of(matched.observations if demonstrated is None else demonstrated)
    nearly = np.full(len(log), -1, dtype=np.int64)
    nearly[::every] = near.near_misses(
        rule_set, matched.observations[::every], matched.labels[::every], spreads
    )
    nearly[breaks.any(axis=1)] = -1
    if demonstrations is None or demonstrated is None:
        drift = drift_from_rules(rule_set, log, matched, decision.rules)
    else:
        in_force = shield.rules_in_force(demonstrated)
        drift = drift_from_demonstrations(
            rule_set,
            (log, matched.observations, decision.rules),
            (demonstrations, demonstrated, in_force),
        )
    return Audit(
        rule_set=rule_set,
        log=log,
        observations=matched.observations,
        labels=matched.labels,
        rules=decision.rules,
        breaks=breaks,
        executed=decision.executed,
        outside=decision.outside,
        near=nearly,
        looked_at=every,
        freedom=float(shield.freedom(matched.observations, decision.rules).mean()),
        drift=drift,
        notes=tuple(dict.fromkeys((*log.notes, *matched.notes))),
    )


def _words(names: NDArray[np.str_], places: NDArray[np.int64]) -> Any:
    """A column of few words; -1 is the last."""
    import pandas as pd

    known, first = np.unique(names, return_inverse=True)
    return pd.Categorical.from_codes(first[places], known.tolist())
