"""Many episodes in worker processes, piece by piece, for a server with several callers.

`rollout` with several jobs serves one caller who waits for all. Here every finished piece is
handed over at once, so that what is done stays when the rest is called off; callers take turns on
one set of processes; and what fails in one task leaves the others alone.
"""

from __future__ import annotations

import os
import time
from collections import defaultdict, deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.errors import InputError, SarlError, WorkError
from sarl_core.rollouts.episodes import Episodes, run_seeds
from sarl_core.rollouts.packed_shield import PackedShield, pack, unpack
from sarl_core.rollouts.workers import beginning
from sarl_core.shielding.shield import Shield

_PIECE_SECONDS = 1.0  # what one piece should take: progress is told, and work ends, this often
_FIRST_PIECE = 4
LARGEST_PIECE = 32  # environments that `play` steps side by side
_IDLE_SECONDS = 300  # after which a process that nobody needs ends


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

    env_id: str
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


class Found(NamedTuple):
    """What came of a piece of a task.

    Attributes:
        task: Index of the task.
        result: The next of its episodes, in the order of their seeds, with their steps where the
            task keeps them; or why there are no more.
    """

    task: int
    result: Episodes | SarlError


class _Piece(NamedTuple):
    task: int
    start: int
    seeds: NDArray[np.int64]


@dataclass
class _Pace:
    """How many episodes of an agent in an environment make a piece, as far as is known."""

    size: int = _FIRST_PIECE


class _Progress:
    """How far a task is."""

    def __init__(self, task: Task, pace: _Pace) -> None:
        self.task, self.pace = task, pace
        self.seeds = task.seeds
        self.asked = self.given = 0  # episodes handed to a process; given to the caller
        self.early: dict[int, Episodes] = {}  # finished before those that come before them
        self.failed = False

    @property
    def is_open(self) -> bool:
        return not self.failed and self.asked < len(self.seeds)


class WorkerPool:
    """Processes that run episodes; they start when first needed."""

    def __init__(self, workers: int | None = None, *, gives_way: bool = True) -> None:
        """Start nothing yet.

        Args:
            workers: Processes; as many as there are processors where not given, at most 8.
            gives_way: Whether other programs go first, as where pages are served meanwhile. On a
                busy machine the work then takes long; where somebody waits for it, it should not.
        """
        self.workers = workers or min(os.cpu_count() or 1, 8)
        self._gives_way = gives_way
        self._lock = Lock()
        self._processes: Any = None

    def run(self, tasks: Sequence[Task]) -> Generator[Found, None, None]:
        """Run the episodes of several tasks, in their order.

        Ending the iteration early calls off the pieces that no process has begun.

        Args:
            tasks: What to run.

        Yields:
            Pieces as they are finished; of one task, in the order of the seeds.

        Raises:
            WorkError: If a process ended in the middle of its work.
        """
        paces: defaultdict[tuple[str, int], _Pace] = defaultdict(_Pace)
        progress = [_Progress(task, paces[task.env_id, id(task.agent)]) for task in tasks]
        pack_once = cache(pack)  # tasks that have the same shield share what is sent of it
        waiting = deque(range(len(tasks)))
        running: dict[Any, _Piece] = {}
        try:
            while True:
                while waiting and not progress[waiting[0]].is_open:
                    waiting.popleft()
                # One more than there are processes, so that none of them waits for this loop; not
                # all at once, so that another caller's pieces come in between.
                if waiting and len(running) <= self.workers:
                    piece = _next_piece(waiting[0], progress[waiting[0]])
                    shield = tasks[piece.task].shield
                    content = None if shield is None else pack_once(shield)
                    running[self._submit(tasks[piece.task], content, piece)] = piece
                    continue
                if not running:
                    return
                yield from self._collect(running, progress)
        finally:
            for future in running:
                future.cancel()

    def close(self) -> None:
        """End the processes, when what they have begun is done."""
        with self._lock:
            processes, self._processes = self._processes, None
        if processes is not None:
            processes.shutdown(wait=True)

    def _submit(self, task: Task, content: bytes | None, piece: _Piece) -> Any:
        from concurrent.futures import BrokenExecutor

        from joblib.externals.loky.process_executor import ProcessPoolExecutor

        shield = None if content is None else PackedShield(content, task.without)
        work = (
            _work,
            task.env_id,
            task.agent,
            shield,
            piece.seeds,
            task.keep_steps,
            task.max_steps,
        )
        with self._lock:
            if self._processes is not None:
                try:
                    return self._processes.submit(*work)
                except BrokenExecutor:  # another caller's loss; the processes are made anew
                    pass
            self._processes = ProcessPoolExecutor(
                self.workers,
                timeout=_IDLE_SECONDS,
                env={"OMP_NUM_THREADS": "1"},
                **beginning(gives_way=self._gives_way),
            )
            return self._processes.submit(*work)

    def _collect(
        self, running: dict[Any, _Piece], progress: list[_Progress]
    ) -> Generator[Found, None, None]:
        """Wait for a piece, and hand over what can be."""
        from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, wait

        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            piece = running.pop(future)
            state = progress[piece.task]
            try:
                episodes, seconds = future.result()
            except SarlError as error:
                if not state.failed:
                    state.failed = True
                    yield Found(piece.task, error)
                continue
            except BrokenExecutor as error:
                # Whoever submits next finds them broken and makes new ones.
                raise WorkError(
                    "a process that ran episodes ended unexpectedly, as when memory runs out; "
                    "run again, with fewer episodes at a time"
                ) from error
            state.pace.size = round(len(episodes) * _PIECE_SECONDS / max(seconds, 1e-3))
            state.early[piece.start] = episodes
            while (ready := state.early.pop(state.given, None)) is not None:
                state.given += len(ready)
                yield Found(piece.task, ready)


def _next_piece(task: int, state: _Progress) -> _Piece:
    size = min(max(state.pace.size, 1), LARGEST_PIECE)
    piece = _Piece(task, state.asked, state.seeds[state.asked : state.asked + size])
    state.asked += len(piece.seeds)
    return piece


def _work(
    env_id: str,
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
