"""Processes that work for this one: they end with it, and let others go first where they should."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Thread
from typing import Any

_LOOK_SECONDS = 2.0  # between two looks at whether the process that asked is still there
_NICENESS = 5  # whoever serves pages goes first, and the work goes on all the same

_gives_way: ContextVar[bool] = ContextVar("gives_way", default=False)


@contextmanager
def giving_way() -> Iterator[None]:
    """Let processes that are started meanwhile give way to other programs, as a server's do."""
    token = _gives_way.set(True)
    try:
        yield
    finally:
        _gives_way.reset(token)


def parallel(jobs: int) -> Any:
    """A `joblib.Parallel` whose processes end with this one.

    Args:
        jobs: Processes.

    Returns:
        To be entered, and called with what is to be done.
    """
    from joblib import Parallel

    return Parallel(n_jobs=jobs, backend="loky", **beginning(gives_way=_gives_way.get()))


def beginning(*, gives_way: bool) -> dict[str, Any]:
    """What processes are to do first: end with this one, and let others go first.

    Args:
        gives_way: Whether others go first.

    Returns:
        Arguments ``initializer`` and ``initargs`` of whatever starts processes.
    """
    return {"initializer": _begin, "initargs": (os.getpid(), gives_way)}


def _begin(parent: int, gives_way: bool) -> None:
    if gives_way and hasattr(os, "nice"):
        os.nice(_NICENESS)
    Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    """Wait until the process that asked is gone. Killed, it tells nobody."""
    while os.getppid() == parent:
        time.sleep(_LOOK_SECONDS)
    os._exit(0)
