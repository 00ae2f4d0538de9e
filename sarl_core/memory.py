"""Memory that is free, and that the system does not know to be."""

from __future__ import annotations

import ctypes
import sys


def release() -> None:
    """Give what is free to the system: what allocators keep looks like use to whoever watches."""
    if pyarrow := sys.modules.get("pyarrow"):
        pyarrow.default_memory_pool().release_unused()
    if sys.platform == "linux":  # and there GNU's C library has it
        getattr(ctypes.CDLL(None), "malloc_trim", int)(0)
