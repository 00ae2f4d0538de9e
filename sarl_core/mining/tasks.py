"""Many small pieces of work, one after the other or in processes, that can be called off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from typing import Any, TypeVar

from sarl_core.errors import WorkError
from sarl_core.progress import CancelledError, Progress, report

_AHEAD = 8  # pieces on their way at once: each carries its demonstrations along
_LOOK_SECONDS = 0.5  # between two looks at whether the caller still wants it

Result = TypeVar("Result")


def run_each(
    work: Callable[..., Result],
    tasks: Sequence[tuple[Any, ...]],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Do the same with different arguments.

    Args:
        work: A function of a module, which processes can find.
        tasks: The arguments of each call.
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
    found: dict[int, Result] = {}
    running: dict[Future[Result], int] = {}
    waiting = list(enumerate(tasks))[::-1]
    try:
        while waiting or running:
            while waiting and len(running) < _AHEAD:
                place, task = waiting.pop()
                running[_submitted(executor, work, task)] = place
            ready, _ = wait(running, timeout=_LOOK_SECONDS, return_when=FIRST_COMPLETED)
            for future in ready:
                found[running.pop(future)] = future.result()
            report(progress, len(found), len(tasks))
    except BrokenExecutor as error:
        raise WorkError(
            "a process that mined rules ended unexpectedly, as when memory runs out; run again"
        ) from error
    finally:
        for future in running:
            future.cancel()
    return [found[place] for place in range(len(tasks))]


def _submitted(
    executor: Executor, work: Callable[..., Result], task: tuple[Any, ...]
) -> Future[Result]:
    try:
        return executor.submit(work, *task)
    except BrokenExecutor:
        raise
    except RuntimeError as error:
        # The program has come to its end, and takes no more work.
        raise CancelledError("stopped, because the program ends; nothing was kept") from error
