"""Running an ablation: piece by piece, in any process, going on where it was called off."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, SarlError, require_whole
from sarl_core.processes import executor_of
from sarl_core.progress import Progress, report
from sarl_core.rollouts.episodes import MAX_STEPS, Episodes, join
from sarl_core.rollouts.player import check_environment
from sarl_core.rollouts.rule_use import RuleUse, join_use, rule_use
from sarl_core.rollouts.tasks import Task, TaskPiece, run_tasks
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield
from sarl_core.studies.ablation import MOST_RULES, Ablation, rules_to_take_out

LEAST_EPISODES = 2  # a difference that was seen once says nothing about the next

_TOGETHER = 32  # rules whose episodes are handed over at once: the processes wait between

Runner = Callable[[Sequence[Task]], Iterator[TaskPiece]]
"""Runs tasks, as `run_tasks` does."""


class _Outcome(NamedTuple):
    """Of an episode without a rule."""

    gained: float
    failed: bool
    cut: bool
    undecided: bool


class AblationProgress(NamedTuple):
    """How far an ablation is.

    Attributes:
        done: Episodes known.
        total: Episodes that have to be known, as far as can be told.
        text: What is being done.
    """

    done: int
    total: int
    text: str


class AblationRecord:
    """All that has been run of an ablation; more episodes and more rules go on from there.

    Attributes:
        env_id: Environment.
        agent: Chooses the actions.
        shield: With all its rules, in the order of the environment's features.
        seed: Of the first episode.
        max_steps: After which an episode is cut off; `episodes.MAX_STEPS` where None.
        notes: What is to be said of how rules and environment were matched, as clauses.
    """

    def __init__(
        self,
        env_id: EnvironmentOrId,
        agent: Agent,
        shield: Shield,
        seed: int,
        max_steps: int | None = None,
    ) -> None:
        """Begin with nothing.

        Args:
            env_id: What ``gymnasium.make`` takes.
            agent: Chooses the actions.
            shield: With all its rules.
            seed: Of the first episode; episode i has seed + i.
            max_steps: After which an episode is cut off.

        Raises:
            InputError: If the environment cannot be used, the shield is not for it, or there is
                no rule to take out.
        """
        _, fitted, self.notes = check_environment(env_id, shield)
        assert fitted is not None
        shield = fitted
        if not any(rule.enabled for rule in shield.rule_set.rules):
            raise InputError(
                "the rule set has no rule in force that could be taken out; mine with lower "
                "thresholds, or switch a rule on"
            )
        self.env_id, self.agent, self.shield, self.seed = env_id, agent, shield, seed
        self.max_steps = max_steps
        self._lock = Lock()
        self._base: Episodes | None = None
        self._use: RuleUse | None = None
        # For each rule that was taken out, by episode.
        self._without: dict[int, dict[int, _Outcome]] = {}
        self._latest: tuple[tuple[int, int, int], Ablation] | None = None

    def run(
        self, episodes: int, most: int, runner: Runner
    ) -> Generator[AblationProgress, None, None]:
        """Run what is not known yet. Who stops iterating keeps what is finished.

        Args:
            episodes: How many, E.
            most: Rules to take out at most.
            runner: Runs the episodes.

        Yields:
            How far it is, after every piece.

        Raises:
            SarlError: If episodes cannot be run.
        """
        yield from self._run_base(episodes, runner)
        use = self._use
        assert use is not None
        use = use.part(0, episodes)
        chosen, _ = rules_to_take_out(use, most)
        matters = {rule: np.flatnonzero(use.matters[rule]).tolist() for rule in chosen}
        total = episodes + sum(map(len, matters.values()))
        yield AblationProgress(total - self._open(matters), total, "Taking rules out …")
        for first in range(0, len(chosen), _TOGETHER):
            # What another caller has found meanwhile is not run again.
            missing = self._missing({rule: matters[rule] for rule in chosen[first:][:_TOGETHER]})
            owners = list(missing)
            tasks = [self._task(episodes, rule, which) for rule, which in missing.items()]
            for piece in _pieces(runner(tasks)):
                rule = owners[piece.task]
                assert isinstance(piece.result, Episodes)
                self._keep(rule, piece.result)
                place = chosen.index(rule) + 1
                done = total - self._open(matters)
                yield AblationProgress(done, total, f"Without rule {place} of {len(chosen)} …")

    def _missing(self, matters: Mapping[int, Sequence[int]]) -> dict[int, tuple[int, ...]]:
        """The episodes that are to be run without each rule, where there are any."""
        missing = {}
        for rule, places in matters.items():
            known = self._known(rule)
            if which := tuple(place for place in places if place not in known):
                missing[rule] = which
        return missing

    def _open(self, matters: Mapping[int, Sequence[int]]) -> int:
        """How many episodes are still to be run."""
        return sum(map(len, self._missing(matters).values()))

    def _task(self, episodes: int, rule: int, which: tuple[int, ...]) -> Task:
        return Task(
            self.env_id,
            self.agent,
            self.shield,
            self.seed,
            episodes,
            without=rule,
            which=which,
            max_steps=self.max_steps,
        )

    def _run_base(self, episodes: int, runner: Runner) -> Generator[AblationProgress, None, None]:
        have = len(self._base) if self._base is not None else 0
        yield AblationProgress(min(have, episodes), episodes, "With all rules …")
        if have >= episodes:
            return
        task = Task(
            self.env_id,
            self.agent,
            self.shield,
            self.seed + have,
            episodes - have,
            keep_steps=True,
            max_steps=self.max_steps,
        )
        for piece in _pieces(runner([task])):
            assert isinstance(piece.result, Episodes)
            self._extend(piece.result)
            have += len(piece.result)
            yield AblationProgress(have, episodes, f"With all rules: {have} of {episodes} episodes")

    def _extend(self, fresh: Episodes) -> None:
        """Take in more episodes under all rules; another caller may have done so already."""
        use = rule_use(fresh, self.shield)
        with self._lock:
            have = len(self._base) if self._base is not None else 0
            known = self.seed + have - int(fresh.seeds[0])
            if not 0 <= known < len(fresh):
                return
            # The rules were put in order before, so the episodes do not tell how.
            notes = tuple(dict.fromkeys((*self.notes, *fresh.notes)))
            bare = replace(fresh, steps=None, notes=notes).part(known, len(fresh))
            use = use.part(known, len(fresh))
            if self._base is None or self._use is None:
                self._base, self._use = bare, use
            else:
                self._base, self._use = join([self._base, bare]), join_use([self._use, use])

    def _known(self, rule: int) -> dict[int, _Outcome]:
        with self._lock:
            return dict(self._without.get(rule, {}))

    def _keep(self, rule: int, episodes: Episodes) -> None:
        places = (episodes.seeds - self.seed).tolist()
        outcomes = map(
            _Outcome,
            episodes.returns.tolist(),
            episodes.failed.tolist(),
            episodes.cut.tolist(),
            episodes.undecided.tolist(),
        )
        with self._lock:
            self._without.setdefault(rule, {}).update(zip(places, outcomes, strict=True))

    def result(self, episodes: int, most: int) -> Ablation | None:
        """What is known of so many episodes and rules.

        Args:
            episodes: How many, E.
            most: Rules to take out at most.

        Returns:
            The ablation, with the rules that are finished; None while the episodes under all rules
            are not. The same object as the last time if nothing has been added.
        """
        with self._lock:
            if self._base is None or self._use is None or len(self._base) < episodes:
                return None
            key = (episodes, most, sum(map(len, self._without.values())))
            if self._latest is not None and self._latest[0] == key:
                return self._latest[1]
            base, use = self._base.part(0, episodes), self._use.part(0, episodes)
            chosen, rest = rules_to_take_out(use, most)
            finished: list[int] = []
            columns: list[list[NDArray[Any]]] = []
            played = 0
            for rule in chosen:
                known = self._without.get(rule, {})
                places = np.flatnonzero(use.matters[rule]).tolist()
                if not all(place in known for place in places):
                    continue
                finished.append(rule)
                played += len(places)
                columns.append(
                    [of.copy() for of in (base.returns, base.failed, base.cut, base.undecided)]
                )
                for place in places:
                    for column, value in zip(columns[-1], known[place], strict=True):
                        column[place] = value
            returns, failed, cut, undecided = (
                np.array([row[of] for row in columns]).reshape(len(finished), episodes)
                for of in range(4)
            )
            ablation = Ablation(
                shield=self.shield,
                base=base,
                use=use,
                rules=tuple(finished),
                returns=returns,
                failed=failed.astype(np.bool_),
                cut=cut.astype(np.bool_),
                undecided=undecided.astype(np.bool_),
                left_out=(*(rule for rule in chosen if rule not in finished), *rest),
                played=played,
            )
            self._latest = key, ablation
            return ablation


def ablate(
    env_id: EnvironmentOrId,
    agent: str | Path | Agent,
    shield: Shield,
    *,
    episodes: int = 50,
    seed: int = 0,
    most: int = MOST_RULES,
    stochastic: bool = False,
    jobs: int = 1,
    executor: Executor | None = None,
    max_steps: int | None = None,
    progress: Progress | None = None,
) -> Ablation:
    """Take the rules of a shield out one by one, and run the same episodes again.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: An agent, or what `make_agent` takes.
        shield: With all its rules.
        episodes: How many, E; at least 2.
        seed: Episode i starts from seed + i, with every rule taken out and with none, and draws
            the same random numbers.
        most: Rules to take out at most: those that change the most actions.
        stochastic: Whether a trained policy is sampled.
        jobs: Processes; changes the speed, never the result.
        executor: Whose processes they are; this machine's where not given.
        max_steps: An episode that has not ended by then is cut off; `episodes.MAX_STEPS` where not
            given.
        progress: Called with (episodes done, in all, as far as can be told); returning False
            stops.

    Returns:
        The ablation; the same arguments give the same one, bit for bit.

    Raises:
        InputError: If a number is out of range, or agent, shield and environment do not fit.
        CancelledError: If `progress` returned False.
    """
    for name, value, least in (
        ("episodes", episodes, LEAST_EPISODES),
        ("most", most, 1),
        ("jobs", jobs, 1),
        ("max_steps", MAX_STEPS if max_steps is None else max_steps, 1),
    ):
        require_whole(name, value, least)
    actor = make_agent(agent, env_id, stochastic=stochastic, seed=seed)
    record = AblationRecord(env_id, actor, shield, seed, max_steps)
    runner = partial(run_tasks, executor=executor_of(jobs, executor))
    for done, total, _ in record.run(episodes, most, runner):
        report(progress, done, total)
    ablation = record.result(episodes, most)
    assert ablation is not None
    return ablation


def _pieces(pieces: Iterator[TaskPiece]) -> Iterator[TaskPiece]:
    for piece in pieces:
        if isinstance(piece.result, SarlError):
            raise piece.result
        yield piece
