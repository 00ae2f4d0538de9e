"""Steps that lack a value (an empty cell, NaN, null, NA), or hold an infinite one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError

Missing = Literal["refuse", "drop"]
"""What becomes of such steps: the file is refused, or they are left out."""
Holes = Mapping[str, NDArray[np.bool_]]
"""For each column, as messages call it, where it has no value, (N,)."""
_LISTED = 4  # columns in a sentence


def complete_rows(
    holes: Holes,
    infinite: Holes,
    rows: NDArray[np.int64] | None,
    missing: Missing,
) -> tuple[NDArray[np.int64], str]:
    """The steps that lack nothing.

    Args:
        holes: Where columns have no value.
        infinite: Where they have an infinite one; one or more columns in the two together.
        rows: Shape (N,), the rows the steps had in the file, from 0; None if they are those.
        missing: What becomes of the others.

    Returns:
        Which steps are left, and a note on the others.

    Raises:
        InputError: With the columns, how many steps, and the first row; if they are refused, or
            hardly any would be left.
    """
    lacking = np.logical_or.reduce([*holes.values(), *infinite.values()])
    n, count = len(lacking), int(np.count_nonzero(lacking))
    parts = [(holes, "is empty or not a number (NaN)"), (infinite, "is infinite")]
    where = ", and ".join(_where(columns, what) for columns, what in parts if columns)
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
    wrong = [f"lack{'s' * one} a value"] * bool(holes)
    wrong += [f"hold{'s' * one} an infinite {'one' if holes else 'value'}"] * bool(infinite)
    return np.flatnonzero(~lacking), (
        f"{count:,} of {n:,} steps {' or '.join(wrong)} and {'was' if one else 'were'} left out "
        f"({where}); the others keep their episodes and their step numbers"
    )


def _where(columns: Holes, what: str) -> str:
    """In how many rows columns are so, those with the most first."""
    counts = [(name, int(np.count_nonzero(hole))) for name, hole in columns.items()]
    (first, most), *others = sorted(counts, key=lambda one: -one[1])
    n = len(columns[first])
    where = f"{first} {what} in {most:,} of {n:,} rows"
    where += "".join(f", {name} in {each:,}" for name, each in others[: _LISTED - 1])
    if len(others) >= _LISTED:
        where += f", {len(others) - _LISTED + 1:,} more columns in some"
    return where
