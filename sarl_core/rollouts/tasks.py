"""Many episodes, piece by piece, here or in processes, for a server with several callers.

`rollout` with several jobs serves one caller who waits for all. Here every finished piece is
handed over at once, so that what is done stays when the rest is called off; callers take turns on
one set of processes; and what fails in one task leaves the others alone.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent, EpisodicAgent
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, SarlError
from sarl_core.processes import completed
from sarl_core.rollouts.episodes import LOST, Episodes, run_seeds
from sarl_core.rollouts.packed_shield import PackedShield, pack, unpack
from sarl_core.rollouts.rule_use import without_rule
from sarl_core.shielding.shield import Shield

_PIECE_SECONDS = 1.0  # what one piece should take: progress is told, and work ends, this often
_FIRST_PIECE = 4
_LARGEST_PIECE = 32  # environments that `play` steps side by side


@dataclass(frozen=True, eq=False)
class Task:
    """Episodes to run.

    Attributes:
        env_id: What ``gymnasium.make`` takes.
        agent: Chooses the actions.
        shield: Checks them, or None.
        seed: Of the first episode.
        episodes: How many; episode i has seed + i.
        keep_steps: Whether to keep the record of every step.
        without: Index of a rule that is taken out of the shield; None for none.
        which: Indices of the episodes that are run, ascending; all where None.
        max_steps: After which an episode is cut off; `episodes.MAX_STEPS` where None.
    """

    env_id: EnvironmentOrId
    agent: Agent
    shield: Shield | None
    seed: int
    episodes: int
    keep_steps: bool = False
    without: int | None = None
    which: tuple[int, ...] | None = None
    max_steps: int | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            InputError: If there is no episode to run, or the seed is negative.
        """
        if self.episodes < 1 or self.seed < 0:
            raise InputError(
                f"{self.episodes} episodes from seed {self.seed} cannot be run; give at least "
                "one episode, and a seed of 0 or more"
            )
        if self.which is not None and not set(self.which) <= set(range(self.episodes)):
            raise InputError(
                f"episodes {self.which} are not among the {self.episodes} there are; choose of them"
            )

    @cached_property
    def seeds(self) -> NDArray[np.int64]:
        """Of the episodes that are run."""
        which = range(self.episodes) if self.which is None else self.which
        return self.seed + np.array(which, dtype=np.int64)


class TaskPiece(NamedTuple):
    """What came of a piece of a task.

    Attributes:
        task: Index of the task.
        result: The next of its episodes, in the order of their seeds, with their steps where the
            task keeps them; or why there are no more.
    """

    task: int
    result: Episodes | SarlError


class _PiecePlace(NamedTuple):
    """Which episodes of which task a piece is."""

    task: int
    start: int


@dataclass
class _Pace:
    """How many episodes of an agent in an environment make a piece, as far as is known."""

    size: int = _FIRST_PIECE


class _Progress:
    """How far a task is."""

    def __init__(self, task: Task, pace: _Pace) -> None:
        self.task, self.pace = task, pace
        self.seeds = task.seeds
        self.submitted = self.given = 0  # episodes handed to a process; given to the caller
        self.early: dict[int, Episodes] = {}  # finished before those that come before them
        self.failed = False

    def next_seeds(self) -> NDArray[np.int64]:
        size = min(max(self.pace.size, 1), _LARGEST_PIECE)
        seeds = self.seeds[self.submitted : self.submitted + size]
        self.submitted += len(seeds)
        return seeds


def run_tasks(
    tasks: Sequence[Task], executor: Executor | None = None
) -> Generator[TaskPiece, None, None]:
    """Run the episodes of several tasks, in their order.

    Ending the iteration early calls off the pieces that no process has begun.

    Args:
        tasks: What to run.
        executor: Its processes do the work; here, one piece after the other, where there is none,
            or where an agent is an `EpisodicAgent`.

    Yields:
        Pieces as they are finished; of one task, in the order of the seeds.

    Raises:
        WorkError: If a process ended in the middle of its work.
        SarlError: Without an executor, if episodes cannot be run.
    """
    if executor is None or any(isinstance(task.agent, EpisodicAgent) for task in tasks):
        yield from _run_here(tasks)
        return
    paces: defaultdict[tuple[EnvironmentOrId, int], _Pace] = defaultdict(_Pace)
    progress = [_Progress(task, paces[task.env_id, id(task.agent)]) for task in tasks]
    with closing(completed(executor, _calls(progress), lost=LOST)) as batches:
        for batch in batches:
            for place, outcome in batch:
                yield from _handed_over(place, outcome, progress[place.task])


def _run_here(tasks: Sequence[Task]) -> Iterator[TaskPiece]:
    for index, task in enumerate(tasks):
        shield = task.shield
        if shield is not None and task.without is not None:
            shield = without_rule(shield, task.without)
        for start in range(0, len(task.seeds), _LARGEST_PIECE):
            episodes = run_seeds(
                task.env_id,
                task.agent,
                shield,
                task.seeds[start : start + _LARGEST_PIECE],
                keep_steps=task.keep_steps,
                max_steps=task.max_steps,
            )
            yield TaskPiece(index, episodes)


def _calls(
    progress: Sequence[_Progress],
) -> Iterator[tuple[_PiecePlace, Callable[..., tuple[Episodes, float]], tuple[Any, ...]]]:
    """Pieces to run, each cut off when there is room for it."""
    pack_once = cache(pack)  # tasks that have the same shield share what is sent of it
    for index, state in enumerate(progress):
        task = state.task
        shield = None
        if task.shield is not None:
            shield = PackedShield(pack_once(task.shield), task.without)
        while not state.failed and state.submitted < len(state.seeds):
            place = _PiecePlace(index, state.submitted)
            seeds, keep_steps = state.next_seeds(), task.keep_steps
            arguments = (task.env_id, task.agent, shield, seeds, keep_steps, task.max_steps)
            yield place, _work, arguments


def _handed_over(
    place: _PiecePlace, outcome: tuple[Episodes, float] | SarlError, state: _Progress
) -> Iterator[TaskPiece]:
    """What can be handed over when a piece is finished."""
    if isinstance(outcome, SarlError):
        if not state.failed:
            state.failed = True
            yield TaskPiece(place.task, outcome)
        return
    episodes, seconds = outcome
    state.pace.size = round(len(episodes) * _PIECE_SECONDS / max(seconds, 1e-3))
    state.early[place.start] = episodes
    while (ready := state.early.pop(state.given, None)) is not None:
        state.given += len(ready)
        yield TaskPiece(place.task, ready)


def _work(
    env_id: EnvironmentOrId,
    agent: Agent,
    shield: PackedShield | None,
    seeds: NDArray[np.int64],
    keep_steps: bool,
    max_steps: int | None,
) -> tuple[Episodes, float]:
    """Run one piece and say how long it took; in a process."""
    start = time.perf_counter()
    try:
        in_force = None if shield is None else unpack(shield)
        episodes = run_seeds(
            env_id, agent, in_force, seeds, keep_steps=keep_steps, max_steps=max_steps
        )
    except SarlError:
        raise
    except Exception as error:  # of other people's environments, which may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(
            f"an episode in {env_id} failed ({reason}); choose another environment or agent"
        ) from error
    return episodes, time.perf_counter() - start
