"""Work in processes: many calls, as many on their way as are worked on, that can be called off.

The seam is `concurrent.futures.Executor`. Processes of this machine are one kind; another, as a
Dask client's, fits in wherever an executor is taken.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Generator, Hashable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import closing
from functools import cache
from threading import Lock, Thread
from typing import Any, ParamSpec, TypeVar, cast

from sarl_core.errors import SarlError, WorkError
from sarl_core.memory import LARGE
from sarl_core.progress import CancelledError, Progress, report

_UNSAID = 15  # calls that an executor works on at once which does not say how many they are
_IDLE_SECONDS = 300  # after which a process that nobody needs ends
_LOOK_SECONDS = 0.5  # between two looks at whether the caller still wants it
_PARENT_SECONDS = 2.0  # between two looks at whether the process that asked is still there
_LOST = "a process ended unexpectedly, as when memory runs out; run again"
# As `give_back_large_arrays` has it, and from the first array on.
_ALLOCATION = {"MALLOC_MMAP_THRESHOLD_": str(LARGE)}
_NICENESS = 5  # whoever serves pages goes first, and the work goes on all the same

Key = TypeVar("Key", bound=Hashable)
Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")


class Processes(Executor):
    """Processes that end with this one; they start when first needed, and anew after a loss."""

    def __init__(
        self,
        workers: int | None = None,
        *,
        gives_way: bool = False,
        threads: int = 1,
        without: Sequence[str] = (),
    ) -> None:
        """Start nothing yet.

        Args:
            workers: Processes; as many as there are processors where not given, at most 8.
            gives_way: Whether other programs go first, as where pages are served meanwhile. On a
                busy machine the work then takes long; where somebody waits for it, it should not.
            threads: Of each, where what it calls can use several.
            without: Packages that are not loaded there: some load others wherever they are
                installed, which takes memory and time also where nothing needs them.
        """
        self._without = tuple(without)
        self.workers = workers or min(os.cpu_count() or 1, 8)
        self._gives_way, self._threads = gives_way, threads
        self._lock = Lock()
        self._processes: Any = None

    def submit(
        self,
        call: Callable[Arguments, Result],
        /,
        *arguments: Arguments.args,
        **named: Arguments.kwargs,
    ) -> Future[Result]:
        """See `Executor.submit`."""
        import numpy as np
        from loky import ProcessPoolExecutor

        from sarl_core.shared_arrays import handed_over

        with self._lock:
            if self._processes is not None:
                try:
                    return self._submitted(call, *arguments, **named)
                except BrokenExecutor:  # another caller's loss; the processes are made anew
                    pass
            self._processes = ProcessPoolExecutor(
                self.workers,
                timeout=_IDLE_SECONDS,
                initializer=_begin,
                initargs=(os.getpid(), self._gives_way, self._without),
                env={"OMP_NUM_THREADS": str(self._threads), **_ALLOCATION},
                job_reducers={np.ndarray: handed_over},
                # A process may let go of a result, and of its file, before that is read here.
                result_reducers={},
            )
            return self._submitted(call, *arguments, **named)

    def _submitted(
        self, call: Callable[Arguments, Result], *arguments: Any, **named: Any
    ) -> Future[Result]:
        future: Future[Result] = self._processes.submit(call, *arguments, **named)
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, when what they have begun is done."""
        with self._lock:
            processes, self._processes = self._processes, None
        if processes is not None:
            processes.shutdown(wait=wait, kill_workers=cancel_futures)


@cache
def processes(jobs: int) -> Processes:
    """Processes of this program, the same ones whenever as many are asked for.

    Args:
        jobs: How many.
    """
    return Processes(jobs)


def workers_of(executor: Executor) -> int:
    """How many calls an executor works on at once, as far as it says so."""
    workers = getattr(executor, "workers", None)
    return workers if isinstance(workers, int) and workers > 0 else _UNSAID


def executor_of(jobs: int, executor: Executor | None) -> Executor | None:
    """Who works where a caller names an executor, or a number of processes.

    Args:
        jobs: Processes.
        executor: Goes before them.

    Returns:
        None where all is done here.
    """
    return executor if executor is not None or jobs == 1 else processes(jobs)


def _begin(parent: int, gives_way: bool, without: Sequence[str]) -> None:
    """End with the process that asked, let others go first where they should, and load less."""
    for package in without:
        # None where a module would be: importing it fails as where it is not installed.
        sys.modules.setdefault(package, None)  # type: ignore[arg-type]
    if gives_way and hasattr(os, "nice"):
        os.nice(_NICENESS)
    Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    """Wait until the process that asked is gone. Killed, it tells nobody."""
    while os.getppid() == parent:
        time.sleep(_PARENT_SECONDS)
    os._exit(0)


def completed(
    executor: Executor,
    calls: Iterable[tuple[Key, Callable[..., Result], tuple[Any, ...]]],
    *,
    lost: str,
) -> Generator[list[tuple[Key, Result | SarlError]], None, None]:
    """Make calls, and hand over what is done as it is done.

    Ending the iteration early calls off what nobody has begun.

    Args:
        executor: Makes the calls. Several callers take turns on one.
        calls: What they are known by, a function that processes can find, and its arguments. The
            next one is asked for when there is room for it.
        lost: The sentence for when a process ended in the middle of its work.

    Yields:
        What was done since the last time, with the errors that are sentences; now and then nothing.

    Raises:
        WorkError: If a process ended in the middle of its work.
        CancelledError: If the program ends and takes no more work.
    """
    waiting = iter(calls)
    running: dict[Future[Result], Key] = {}
    try:
        # One more than are worked on, so that nobody waits for this loop; not all at once, so that
        # another caller's come in between, and since each carries its arguments along.
        most = workers_of(executor) + 1
        while True:
            while len(running) < most and (call := next(waiting, None)) is not None:
                key, work, arguments = call
                running[_submitted(executor, work, arguments)] = key
            if not running:
                return
            ready, _ = wait(running, timeout=_LOOK_SECONDS, return_when=FIRST_COMPLETED)
            yield [(running.pop(future), _outcome(future)) for future in ready]
    except BrokenExecutor as error:
        raise WorkError(lost) from error
    except getattr(executor, "losses", ()) as error:
        raise WorkError(cast(Any, executor).loss_text(error, lost)) from error
    finally:
        for future in running:
            future.cancel()


def _submitted(
    executor: Executor, work: Callable[..., Result], arguments: tuple[Any, ...]
) -> Future[Result]:
    try:
        return executor.submit(work, *arguments)
    except BrokenExecutor:
        raise
    except RuntimeError as error:
        # The program has come to its end, and takes no more work.
        raise CancelledError("stopped, because the program ends; nothing was kept") from error


def _outcome(future: Future[Any]) -> Any:
    try:
        return future.result()
    except SarlError as error:
        return error


def run_each(
    work: Callable[..., Result],
    tasks: Sequence[tuple[Any, ...]],
    *,
    lost: str = _LOST,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Do the same with different arguments.

    Args:
        work: A function of a module, which processes can find.
        tasks: The arguments of each call.
        lost: The sentence for when a process ended in the middle of its work.
        executor: Its processes do the work; here, one after the other, where there is none.
        progress: Told how many are done; may stop the rest.

    Returns:
        One result a task, in their order.

    Raises:
        WorkError: If a process ended in the middle of its work.
        CancelledError: If the caller wants no more.
    """
    report(progress, 0, len(tasks))
    if executor is None:
        done = []
        for task in tasks:
            done.append(work(*task))
            report(progress, len(done), len(tasks))
        return done
    results: dict[int, Result] = {}
    calls = ((place, work, task) for place, task in enumerate(tasks))
    with closing(completed(executor, calls, lost=lost)) as batches:
        for batch in batches:
            for place, result in batch:
                if isinstance(result, SarlError):
                    raise result
                results[place] = result
            report(progress, len(results), len(tasks))
    return [results[place] for place in range(len(tasks))]
