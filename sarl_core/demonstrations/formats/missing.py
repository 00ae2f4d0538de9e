"""Steps that lack a value: an empty cell, NaN, null or NA among observations, actions, rewards."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError

Missing = Literal["refuse", "drop"]
"""What becomes of such steps: the file is refused, or they are left out."""
_LISTED = 4  # columns in a sentence


def complete_rows(
    holes: Mapping[str, NDArray[np.bool_]],
    rows: NDArray[np.int64] | None,
    missing: Missing,
) -> tuple[NDArray[np.int64], str]:
    """The steps that lack nothing.

    Args:
        holes: For each column, as messages call it, where it has no value, (N,); one or more.
        rows: Shape (N,), the rows the steps had in the file, from 0; None if they are those.
        missing: What becomes of the others.

    Returns:
        Which steps are left, and a note on the others.

    Raises:
        InputError: With the columns, how many steps, and the first row; if they are refused, or
            hardly any would be left.
    """
    lacking = np.logical_or.reduce(list(holes.values()))
    n, count = len(lacking), int(np.count_nonzero(lacking))
    counts = [(name, int(np.count_nonzero(hole))) for name, hole in holes.items()]
    (first, most), *others = sorted(counts, key=lambda one: -one[1])
    where = f"{first} is empty or not a number (NaN) in {most:,} of {n:,} rows"
    where += "".join(f", {name} in {each:,}" for name, each in others[: _LISTED - 1])
    if len(others) >= _LISTED:
        where += f", {len(others) - _LISTED + 1:,} more columns in some"
    if missing == "refuse":
        row = int(np.argmax(lacking))
        number = 1 + (row if rows is None else int(rows[row]))
        raise InputError(
            f"{where}, the first of them row {number}; mend {'them' if count > 1 else 'it'}, or "
            f'leave out the steps that lack a value (--missing drop, in Python missing="drop")'
        )
    if n - count < 2:
        raise InputError(
            f"{where}, so {'no step' if n == count else 'one step alone'} would be left; leave out "
            "the columns that are empty instead"
        )
    one = count == 1
    return np.flatnonzero(~lacking), (
        f"{count:,} of {n:,} steps {'lacks' if one else 'lack'} a value and "
        f"{'was' if one else 'were'} left out ({where}); the others keep their episodes and their "
        "step numbers"
    )
