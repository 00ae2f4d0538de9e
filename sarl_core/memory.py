"""Memory that is free, and that the system does not know to be."""

from __future__ import annotations

import ctypes
import sys

LARGE = 2**20
"""Bytes from which an array is a large one."""
_MMAP_THRESHOLD = -3  # the parameter's number in GNU's C library


def give_back_large_arrays() -> None:
    """Let what large arrays took go to the system as soon as nobody holds them.

    GNU's C library by itself keeps up to 64 MB of them for what comes next, in the memory of every
    thread that had some.
    """
    if sys.platform == "linux":
        getattr(ctypes.CDLL(None), "mallopt", lambda *_: 0)(_MMAP_THRESHOLD, LARGE)


def release() -> None:
    """Give what is free to the system: what allocators keep looks like use to whoever watches."""
    if pyarrow := sys.modules.get("pyarrow"):
        pyarrow.default_memory_pool().release_unused()
    if sys.platform == "linux":  # and there GNU's C library has it
        getattr(ctypes.CDLL(None), "malloc_trim", int)(0)
