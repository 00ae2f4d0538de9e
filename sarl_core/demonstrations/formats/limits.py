"""How much a file may unpack to."""

from __future__ import annotations

from sarl_core.errors import InputError

MAX_UNPACKED = 2**30  # bytes; a million steps of a hundred float64 features take 0.8 * 10**9


def too_large(size: int) -> InputError:
    """The error for a file that unpacks to more than `MAX_UNPACKED` bytes."""
    return InputError(
        f"it unpacks to {size / 2**30:,.1f} GiB, more than the {MAX_UNPACKED / 2**30:g} GiB that "
        "are read; keep fewer steps or columns"
    )
