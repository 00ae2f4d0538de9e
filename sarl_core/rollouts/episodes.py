"""Running episodes: many environments side by side, one batch policy, one batch shield.

Each episode has its own seed, a fresh environment and its own random numbers, so its outcome
does not depend on what runs beside it, nor on the number of processes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent, EpisodicAgent
from sarl_core.arrays import make_read_only
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.environments.failures import ends_tell, failed, failure_text
from sarl_core.errors import SarlError, require_whole
from sarl_core.mining.language import share_text
from sarl_core.notebooks import table_html
from sarl_core.processes import completed, executor_of, workers_of
from sarl_core.progress import Progress, report
from sarl_core.rollouts.failures import safety_facts
from sarl_core.rollouts.player import EpisodeArrays, EpisodeFaultError, Observer, play
from sarl_core.rollouts.statistics import (
    MeanInterval,
    Rate,
    ReturnStatistics,
    cost_interval,
    rate_of,
    summarise,
    worst_tenth,
)
from sarl_core.rollouts.steps import StepTable, concatenate
from sarl_core.rollouts.trial import make_agent

if TYPE_CHECKING:
    import pandas as pd

    from sarl_core.shielding.shield import Shield

MAX_STEPS = 100_000  # where an environment sets itself no limit; an episode has to end

LOST = (
    "a process that ran episodes ended unexpectedly, as when memory runs out; "
    "run again, with fewer episodes at a time"
)

_BATCH = 32  # more brings nothing: the policy's share of a step is small by then
_ROUNDS = 4  # of pieces for all processes; progress is told after each


@dataclass(frozen=True, eq=False, repr=False)
class Episodes:
    """E finished episodes; arrays are read-only.

    Attributes:
        env_id: Environment.
        agent: Name of the agent.
        seeds: Seed of each episode, (E,) int64.
        returns: Sum of rewards, (E,) float64.
        lengths: Steps, (E,) int64.
        interventions: Steps at which the shield changed the action, (E,) int64.
        covered: Steps at which some rule applied, (E,) int64.
        terminated: Whether the environment ended the episode, (E,) bool.
        truncated: Whether a limit ended it, the environment's or the run's, (E,) bool.
        last_rewards: Reward of each episode's last step, which tells a crash, (E,) float64.
        steps: Every step, or None where they were not kept.
        flips: How often the shield switched on or off, (E,) int64, or None where it was not
            counted.
        outside: Steps at which the proposed action breaks a rule whose data the state lies
            outside of, (E,) int64; none where not given.
        withheld: Those of them at which no action was changed, because rules abstain there,
            (E,) int64; none where not given.
        invalid: Steps at which the action passed because the observation was no state or the
            action none that there is, (E,) int64; None where no shield lets them pass.
        cut: Whether that was the run's, before the episode's own end, (E,) bool; none where not
            given.
        freedom: What the rules left the agent to choose from, mean over the steps, 0 to 1, (E,);
            NaN where not given.
        costs: Sum of what the environment said that the steps cost, (E,); NaN where it does not.
        notes: What is to be said of how rules and environment were matched, as clauses.
        signalled: 1 where some step was a failure, 0 where none was, NaN where that cannot be
            said, (E,); None where the ends of the episodes tell, or nothing does.
        failure: What a failure was in them, in words; "" where that is not known.
    """

    env_id: str
    agent: str
    seeds: NDArray[np.int64]
    returns: NDArray[np.float64]
    lengths: NDArray[np.int64]
    interventions: NDArray[np.int64]
    covered: NDArray[np.int64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    last_rewards: NDArray[np.float64]
    steps: StepTable | None = None
    flips: NDArray[np.int64] | None = None
    outside: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    withheld: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    cut: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    freedom: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    costs: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    notes: tuple[str, ...] = ()
    invalid: NDArray[np.int64] | None = None
    signalled: NDArray[np.float64] | None = None
    failure: str = ""

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        nothing: tuple[tuple[str, Any], ...] = (
            ("outside", np.int64(0)),
            ("withheld", np.int64(0)),
            ("cut", np.False_),
            ("freedom", np.float64("nan")),
            ("costs", np.float64("nan")),
        )
        for name, value in nothing:
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(len(self.seeds), value))
        make_read_only(self)

    def __len__(self) -> int:
        """Number of episodes E."""
        return len(self.seeds)

    def __repr__(self) -> str:
        """As `Episodes(env_id='CartPole-v1', agent='expert', episodes=10, mean_return=500.0)`."""
        return (
            f"Episodes(env_id={self.env_id!r}, agent={self.agent!r}, episodes={len(self)}, "
            f"steps={int(self.lengths.sum())}, mean_return={self.returns.mean():.1f})"
        )

    def _repr_html_(self) -> str:
        """Failures, returns and what the shield did, for a notebook."""
        summary, returns = self.summary(), self.statistics
        rows = [
            *safety_facts(summary, len(self), self.env_id, shielded=bool(self.covered.any())),
            ("return", f"mean {returns.mean:.1f} ± {returns.std:.1f}"),
            ("", f"IQM {returns.iqm:.1f} (95 %: {returns.low:.1f} to {returns.high:.1f})"),
            ("steps", f"{int(self.lengths.sum()):,}"),
            ("interventions", f"{share_text(summary['intervention_rate'])} of the steps"),
            ("coverage", f"{share_text(summary['coverage'])} of the steps"),
        ]
        rows += [("note", remark) for remark in self.remarks]
        return table_html(repr(self), ("what", "value"), rows)

    def part(self, start: int, stop: int) -> Episodes:
        """Some of the episodes, as if no others had been run.

        Args:
            start: Index of the first one.
            stop: Index after the last one, above `start`; may lie beyond the end.

        Returns:
            Those episodes, numbered from 0.
        """
        changed: dict[str, Any] = {name: getattr(self, name)[start:stop] for name in _COLUMNS}
        if self.steps is not None:
            ends = np.searchsorted(self.steps.episode, [start, stop])
            changed["steps"] = self.steps.take(slice(*ends.tolist())).numbered_from(-start)
        if self.flips is not None:
            changed["flips"] = self.flips[start:stop]
        if self.invalid is not None:
            changed["invalid"] = self.invalid[start:stop]
        if self.signalled is not None:
            changed["signalled"] = self.signalled[start:stop]
        return replace(self, **changed)

    @cached_property
    def statistics(self) -> ReturnStatistics:
        """Mean, interquartile mean and its interval of the returns; worked out once."""
        return summarise(self.returns)

    @cached_property
    def failures(self) -> Rate | None:
        """How many failed; None where it is not known which episodes are failures.

        Whether an episode that was cut off would have failed later is not known: then the rate is
        the least that it can be.
        """
        return rate_of(self.failed, self.undecided) if self.failures_known else None

    @property
    def failures_known(self) -> bool:
        """Whether it is known which episodes are failures, and some can be."""
        return self.signalled is not None or ends_tell(self.env_id)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Which episodes failed, (E,); none where it is not known."""
        if self.signalled is not None:
            return np.asarray(self.signalled == 1.0)
        return failed(self.env_id, self.terminated, self.last_rewards)

    @property
    def undecided(self) -> NDArray[np.bool_]:
        """Of which episodes it is not known, (E,), as of one cut off before it could fail."""
        if self.signalled is None:
            return self.cut
        return np.isnan(self.signalled) | (self.cut & ~self.failed)

    @property
    def cost(self) -> NDArray[np.float64]:
        """What each episode cost, (E,): what its steps did; else 1 for a failure.

        NaN where neither is known, as of an episode that was cut off before it could fail.
        """
        if not np.isnan(self.costs).all() or self.failures is None:
            return self.costs
        return np.where(self.undecided, np.nan, self.failed)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know of how they came about, as clauses."""
        if not self.cut.any():
            return self.notes
        steps = int(self.lengths[self.cut].max())
        return (
            *self.notes,
            cut_text(int(self.cut.sum()), len(self), steps, may_fail=self.failures_known),
        )

    def summary(self) -> dict[str, float]:
        """What the episodes say together (``evaluate --json``).

        Returns:
            `mean`, `std`, `iqm`, `iqm_low`, `iqm_high` of the returns, and as shares of all
            steps `intervention_rate` and `coverage`; and `outside_rate`, the share of the
            interventions, those that were withheld with them, outside the rules' data. Where
            invalid steps pass, `invalid_steps`, how many there were; where there are some, `cut`,
            the number of episodes that were cut off. `worst_tenth` is the mean return of the worst
            tenth of the episodes. Where they are known, `freedom` and `cost`, means over the steps
            and over the episodes, `cost_low` and `cost_high` (95 %; none where all cost the same),
            `cost_worst_tenth`, and `failures`, `failure_rate`, `failure_low` and `failure_high`
            (95 %, Clopper and Pearson's). Of how many episodes it is not known whether they
            failed, as of those that were cut off before, `undecided` says where there are some:
            then the rate is the least that it can be, and the interval leaves room for all of
            them.
        """
        returns = self.statistics
        steps = float(self.lengths.sum())
        broken = int(self.interventions.sum() + self.withheld.sum())
        invalid = {} if self.invalid is None else {"invalid_steps": int(self.invalid.sum())}
        return {
            "mean": returns.mean,
            "std": returns.std,
            "iqm": returns.iqm,
            "iqm_low": returns.low,
            "iqm_high": returns.high,
            "intervention_rate": float(self.interventions.sum()) / steps,
            "coverage": float(self.covered.sum()) / steps,
            "outside_rate": float(self.outside.sum()) / max(broken, 1),
            **invalid,
            **self._known(),
        }

    def _known(self) -> dict[str, float]:
        """What is not known of all episodes, where it is."""
        known: dict[str, float] = {"worst_tenth": worst_tenth(self.returns, worst="lowest")}
        if self.cut.any():
            known["cut"] = int(self.cut.sum())
        if not np.isnan(self.freedom).any():
            known["freedom"] = float((self.freedom * self.lengths).sum() / self.lengths.sum())
        if (cost := self._mean_cost) is not None:
            known["cost"] = cost.mean
            if not np.isnan(cost.low):
                known |= {"cost_low": cost.low, "cost_high": cost.high}
            known["cost_worst_tenth"] = worst_tenth(self.cost, worst="highest")
        if self.failures is not None:
            if self.failures.unknown:
                known["undecided"] = self.failures.unknown
            known |= {
                "failures": self.failures.count,
                "failure_rate": self.failures.rate,
                "failure_low": self.failures.low,
                "failure_high": self.failures.high,
            }
        return known

    @property
    def _mean_cost(self) -> MeanInterval | None:
        """With its interval; that of the failures where they are all that costs something."""
        failures = self.failures
        if failures is not None and not failures.unknown and np.isnan(self.costs).all():
            return MeanInterval(failures.rate, failures.low, failures.high)
        return cost_interval(self.cost)

    def to_dict(self) -> dict[str, Any]:
        """The document that ``evaluate --json`` prints, ready for JSON."""
        rows = zip(
            self.seeds.tolist(),
            self.returns.tolist(),
            self.lengths.tolist(),
            self.interventions.tolist(),
            self.covered.tolist(),
            strict=True,
        )
        names = ("seed", "return", "length", "interventions", "covered")
        episodes: list[dict[str, Any]] = [dict(zip(names, row, strict=True)) for row in rows]
        for episode, fell, undecided, cost, cut in zip(
            episodes,
            self.failed.tolist(),
            self.undecided.tolist(),
            self.cost.tolist(),
            self.cut.tolist(),
            strict=True,
        ):
            if self.failures_known:
                episode["failed"] = None if undecided else fell
            if not np.isnan(cost):
                episode["cost"] = cost
            if cut:
                episode["cut"] = True
        if self.invalid is not None:
            for episode, count in zip(episodes, self.invalid.tolist(), strict=True):
                episode["invalid"] = count
        return {
            "episodes": episodes,
            "summary": self.summary(),
            "notes": list(self.remarks),
            "environment": self.env_id,
            **({"failure": self.failure} if self.failure else {}),
        }

    def to_frame(self) -> pd.DataFrame:
        """One row an episode: its columns, and how it ended."""
        import pandas as pd

        return pd.DataFrame(
            {
                "seed": self.seeds,
                "return": self.returns,
                "length": self.lengths,
                "interventions": self.interventions,
                "covered": self.covered,
                "terminated": self.terminated,
                "truncated": self.truncated,
                "cut": self.cut,
                "last_reward": self.last_rewards,
                "outside": self.outside,
                "withheld": self.withheld,
                "freedom": self.freedom,
                "cost": self.cost,
            }
        )


_COLUMNS = tuple(
    column.name
    for column in fields(Episodes)
    if column.name
    not in ("env_id", "agent", "steps", "flips", "notes", "invalid", "signalled", "failure")
)


def cut_text(
    count: int,
    of: int,
    steps: int | None = None,
    *,
    may_fail: bool,
    episodes: str = "episodes",
) -> str:
    """What is to be said of episodes that were cut off.

    Args:
        count: How many were, at least 1.
        of: How many there are.
        steps: After how many steps; None if not known.
        may_fail: Whether it is known what a failure is in them.
        episodes: What they are, in the plural.

    Returns:
        A clause.
    """
    who, be = f"{count:,} of the {of:,} {episodes}", "were"
    if of == count:
        who = (
            f"the {episodes.replace('episodes', 'episode', 1)}"
            if of == 1
            else f"all {of:,} {episodes}"
        )
    alone, it = "their returns count these steps alone", "they"
    if count == 1:
        be, alone, it = "was", "its return counts these steps alone", "it"
    after = f" after {steps:,} step{'' if steps == 1 else 's'}" if steps is not None else ""
    later = f", and whether {it} would have failed later is not known"
    return (
        f"{who} {be} cut off{after} (max_steps), before {'its' if count == 1 else 'their'} end: "
        f"{alone}{later if may_fail else ''}"
    )


def join(pieces: Sequence[Episodes]) -> Episodes:
    """Put episodes of one agent in one environment behind each other.

    Args:
        pieces: At least one; if one has no steps, the whole has none; so with flips.

    Returns:
        All their episodes, in the order given.
    """
    if len(pieces) == 1:
        return pieces[0]
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(piece, name) for piece in pieces]) for name in _COLUMNS
    }
    tables: list[StepTable] = []
    before = 0
    for piece in pieces:
        if piece.steps is not None:
            tables.append(piece.steps.numbered_from(before))
        before += len(piece)
    steps = concatenate(tables) if len(tables) == len(pieces) else None
    counted = [piece.flips for piece in pieces if piece.flips is not None]
    flips = np.concatenate(counted) if len(counted) == len(pieces) else None
    passed = [piece.invalid for piece in pieces if piece.invalid is not None]
    invalid = np.concatenate(passed) if len(passed) == len(pieces) else None
    signals = [piece.signalled for piece in pieces if piece.signalled is not None]
    signalled = np.concatenate(signals) if len(signals) == len(pieces) else None
    notes = tuple(dict.fromkeys(note for piece in pieces for note in piece.notes))
    return replace(
        pieces[0],
        steps=steps,
        flips=flips,
        invalid=invalid,
        signalled=signalled,
        notes=notes,
        **columns,
    )


def rollout(
    env_id: EnvironmentOrId,
    agent: str | Path | Agent,
    *,
    shield: Shield | None = None,
    episodes: int = 10,
    seed: int = 0,
    stochastic: bool = False,
    batch: int = _BATCH,
    jobs: int = 1,
    executor: Executor | None = None,
    keep_steps: bool = True,
    max_steps: int | None = None,
    progress: Progress | None = None,
) -> Episodes:
    """Run episodes to their end.

    Args:
        env_id: What ``gymnasium.make`` takes. With several processes, an environment that the
            caller registered must be named ``module:Id``.
        agent: An agent, or what `make_agent` takes.
        shield: Checks every action; None for none.
        episodes: How many.
        seed: At least 0; episode i uses ``env.reset(seed=seed + i)`` and random numbers of that
            seed.
        stochastic: Whether a trained policy is sampled.
        batch: Environments side by side; changes the speed, never the result.
        jobs: Processes; likewise. Starting one takes about a second.
        executor: Whose processes they are, as a Dask client's; this machine's where not given.
        keep_steps: Whether to keep the record of every step (about 60 bytes and 4 d a step).
        max_steps: An episode that has not ended by then is cut off, and `Episodes.cut` says so;
            100,000 where not given.
        progress: Called with (episodes done, in all); returning False stops.

    Returns:
        The episodes in the order of their seeds. The same arguments give the same result, bit
        for bit.

    Raises:
        InputError: If a number is out of range, or agent, shield and environment do not fit.
        WorkError: If a process ended in the middle of its work.
        CancelledError: If `progress` returned False.
    """
    most = MAX_STEPS if max_steps is None else max_steps
    for name, value, least in (
        ("episodes", episodes, 1),
        ("batch", batch, 1),
        ("jobs", jobs, 1),
        ("max_steps", most, 1),
    ):
        require_whole(name, value, least)
    actor = make_agent(agent, env_id, stochastic=stochastic, seed=seed)
    seeds = np.arange(seed, seed + episodes, dtype=np.int64)
    done = 0

    def finished(count: int) -> None:
        nonlocal done
        done += count
        report(progress, done, episodes)

    work = partial(run_seeds, batch=batch, keep_steps=keep_steps, max_steps=most)
    workers = None if isinstance(actor, EpisodicAgent) else executor_of(jobs, executor)
    if workers is None:
        return work(env_id, actor, shield, seeds, finished=lambda: finished(1))
    # None larger than what runs side by side: who stops a long run need not wait for a part of it.
    rounds = workers_of(workers) * _ROUNDS
    pieces = np.array_split(seeds, min(episodes, max(rounds, -(-episodes // batch))))
    calls = ((place, work, (env_id, actor, shield, piece)) for place, piece in enumerate(pieces))
    parts: dict[int, Episodes] = {}
    with closing(completed(workers, calls, lost=LOST)) as batches:
        for finished_ones in batches:
            finished(0)  # whoever wants no more need not wait for a long episode
            for place, part in finished_ones:
                if isinstance(part, SarlError):
                    raise part
                parts[place] = part
                finished(len(part))
    return join([parts[place] for place in range(len(pieces))])


def finished_before(
    fault: EpisodeFaultError, env_id: EnvironmentOrId, agent: Agent, seed: int
) -> Episodes | None:
    """The episodes that were finished before an agent failed.

    Args:
        fault: What it raised in `rollout`.
        env_id: Environment.
        agent: Who acted.
        seed: Of the first episode.

    Returns:
        Those episodes; None where there are none.
    """
    played = fault.played
    count = 0 if played is None else int((played.terminated | played.truncated).sum())
    if played is None or not count:
        return None
    seeds = np.arange(seed, seed + len(played.lengths), dtype=np.int64)
    return _played(env_id, agent, seeds, played).part(0, count)


def run_seeds(
    env_id: EnvironmentOrId,
    agent: Agent,
    shield: Shield | None,
    seeds: NDArray[np.int64],
    *,
    batch: int = _BATCH,
    keep_steps: bool = True,
    max_steps: int | None = None,
    finished: Callable[[], None] | None = None,
    observer: Observer | None = None,
    render_mode: str | None = None,
) -> Episodes:
    """Run the episodes of some seeds, which need not follow each other, in this process.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: Chooses the actions.
        shield: Checks them; None for none.
        seeds: Shape (E,), at least one.
        batch: Environments side by side; changes the speed, never the result.
        keep_steps: Whether to keep the record of every step.
        max_steps: An episode that has not ended by then is cut off; `MAX_STEPS` where not given.
        finished: Called after every episode; may raise to stop.
        observer: Sees every state, the last ones included.
        render_mode: Of the environments.

    Returns:
        The episodes in the order of the seeds; each is what `rollout` makes of its seed.

    Raises:
        InputError: If agent, shield and environment do not fit.
    """
    outcome = play(
        env_id,
        agent,
        shield,
        seeds,
        batch=batch,
        max_steps=MAX_STEPS if max_steps is None else max_steps,
        keep_steps=keep_steps,
        finished=finished,
        observer=observer,
        render_mode=render_mode,
    )
    return _played(env_id, agent, seeds, outcome)


def _played(
    env_id: EnvironmentOrId, agent: Agent, seeds: NDArray[np.int64], outcome: EpisodeArrays
) -> Episodes:
    what = failure_text(env_id)
    return Episodes(str(env_id), agent.name, seeds, failure=what, **outcome._asdict())
