"""Telling how far long work is, and letting the caller stop it."""

from __future__ import annotations

from collections.abc import Callable

from sarl_core.errors import WorkError

Progress = Callable[[int, int], bool | None]
"""Called with (done, in all); returning False stops the work."""


class CancelledError(WorkError):
    """The caller stopped the work."""


def report(progress: Progress | None, done: int, total: int) -> None:
    """Tell the caller.

    Args:
        progress: Who to tell, or None.
        done: Units finished.
        total: Units in all.

    Raises:
        CancelledError: If the caller wants no more.
    """
    if progress is not None and progress(done, total) is False:
        raise CancelledError(f"stopped after {done} of {total}; nothing was kept")


def part_of(progress: Progress | None, before: int, total: int) -> Progress:
    """The progress of a part of some work, told as that of the whole.

    Args:
        progress: Who to tell of the whole, or None.
        before: Units finished before the part.
        total: Units in all parts.

    Returns:
        For the part; it raises what `report` raises.
    """
    return lambda done, _: report(progress, before + done, total)
