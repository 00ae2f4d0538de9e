"""How much is read: one limit of memory for every reader, which is a setting, and of features."""

from __future__ import annotations

import math
import os
import stat
from pathlib import Path

from sarl_core.errors import InputError, quoted

READ_LIMIT = "SARL_READ_LIMIT_GIB"  # environment variable: for the command line and the dashboard
MAX_FEATURES = 4096  # more than rules that a person reads can speak of
_DEFAULT = 1.0  # a million steps of a hundred features and their file take about as much
_A_ROW = 40  # bytes: two numbers that are kept, and some for a moment
_CHUNK = 2**20


def read_limit() -> int:
    """Bytes that a file and what is read from it may take.

    It is held against what a file says of itself before anything is unpacked. While arrays are
    brought into their final form there are two of some, so the peak may be twice as much.

    Returns:
        The environment variable `READ_LIMIT`, given in GiB; 1 GiB where it is not set.

    Raises:
        InputError: If it is set to something else than a positive number.
    """
    text = os.environ.get(READ_LIMIT, "")
    if not text.strip():
        return int(_DEFAULT * 2**30)
    try:
        gibibytes = float(text)
    except ValueError:
        gibibytes = 0.0
    if not 0.0 < gibibytes <= 2**20:
        raise InputError(
            f"the environment variable {READ_LIMIT} is {quoted(text)}; set it to the GiB of memory "
            "that reading a file may take, as 4 or 0.5"
        )
    return int(gibibytes * 2**30)


def require_memory(size: int) -> None:
    """Refuse what would take more memory than the limit.

    Args:
        size: Bytes of the file and of all that is read from it.

    Raises:
        InputError: If it is too much; the sentence says how the limit is set.
    """
    limit = read_limit()
    if size > limit:
        raise InputError(
            f"it unpacks to {_in_gib(size)}, more than the {limit / 2**30:g} GiB of memory that a "
            f"file may take; give a smaller one, or set the environment variable {READ_LIMIT} to "
            "more"
        )


def table_memory(rows: int, features: int, others: int) -> int:
    """Bytes that a table takes as demonstrations.

    Args:
        rows: N.
        features: Columns of observations.
        others: Columns of anything else.

    Returns:
        Numbers of 4 and of 8 bytes, and what numbering and checking the rows takes beside.
    """
    return rows * (4 * features + 8 * others + _A_ROW)


def _in_gib(size: int) -> str:
    if size >= 2**60:
        return "far more than any computer has"
    return f"{math.ceil(size / 2**30 * 10) / 10:,} GiB"  # rounded up: it is more than a limit


def limited_bytes(path: Path, limit: int | None = None) -> bytes:
    """The content of a file that is not larger than expected.

    Args:
        path: A file, or a pipe.
        limit: Bytes; `read_limit()` where not given.

    Returns:
        What is in it.

    Raises:
        InputError: If there is more in it.
        OSError: If it cannot be read.
    """
    most = read_limit() if limit is None else limit
    with path.open("rb") as file:
        about = os.fstat(file.fileno())
        if stat.S_ISREG(about.st_mode):
            if about.st_size > most:
                raise _too_long(about.st_size, most)
            return file.read()
        # What has no size of its own, as a pipe, may never end.
        chunks: list[bytes] = []
        while chunk := file.read(_CHUNK):
            chunks.append(chunk)
            if len(chunks) * _CHUNK > most + _CHUNK:
                raise _too_long(len(chunks) * _CHUNK, most)
        return b"".join(chunks)


def _too_long(size: int, limit: int) -> InputError:
    if limit == read_limit():
        require_memory(size)
    return InputError(
        f"it has {size / 2**20:,.0f} MB, more than the {limit / 2**20:,.0f} MB of any such file; "
        "give the right one"
    )
