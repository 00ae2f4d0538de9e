"""Steps that lack a value (an empty cell, NaN, null, NA), or hold an infinite one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError

Missing = Literal["refuse", "drop"]
"""What becomes of such steps: the file is refused, or they are left out."""
Holes = Mapping[str, NDArray[np.bool_]]
"""For each column, as messages call it, where it has no value, (N,)."""
_LISTED = 4  # columns in a sentence


class StepGaps(NamedTuple):
    """How many of N steps lack something.

    Attributes:
        rows: N.
        lacking: Those without a value, or with an infinite one.
        empty: For each column that lacks values, in how many rows.
        infinite: For each column with infinite values, likewise.
    """

    rows: int
    lacking: int
    empty: Mapping[str, int]
    infinite: Mapping[str, int]

    @property
    def where(self) -> str:
        """In which columns, those with the most first."""
        parts = [
            (self.empty, "is empty or not a number (NaN)"),
            (self.infinite, "is infinite"),
        ]
        return ", and ".join(_where(columns, what, self.rows) for columns, what in parts if columns)

    @property
    def note(self) -> str:
        """What is said of them once they are left out."""
        one = self.lacking == 1
        wrong = [f"lack{'s' * one} a value"] * bool(self.empty)
        wrong += [f"hold{'s' * one} an infinite {'one' if self.empty else 'value'}"] * bool(
            self.infinite
        )
        return (
            f"{self.lacking:,} of {self.rows:,} steps {' or '.join(wrong)} and "
            f"{'was' if one else 'were'} left out ({self.where}); the others keep their episodes "
            "and their step numbers"
        )


def gaps_of(holes: Holes, infinite: Holes, rows: int) -> StepGaps:
    """Count steps that lack something.

    Args:
        holes: Where columns have no value.
        infinite: Where they have an infinite one.
        rows: Number N of steps.

    Returns:
        How many there are.
    """
    lacking = np.zeros(rows, dtype=np.bool_)
    for hole in (*holes.values(), *infinite.values()):
        lacking |= hole
    return StepGaps(
        rows,
        int(np.count_nonzero(lacking)),
        *(
            {name: int(np.count_nonzero(hole)) for name, hole in columns.items()}
            for columns in (holes, infinite)
        ),
    )


def gaps_together(parts: Sequence[StepGaps]) -> StepGaps:
    """The gaps of parts of a table as those of the whole."""

    def joined(columns: Sequence[Mapping[str, int]]) -> Mapping[str, int]:
        names = dict.fromkeys(name for one in columns for name in one)
        return {name: sum(one.get(name, 0) for one in columns) for name in names}

    return StepGaps(
        sum(part.rows for part in parts),
        sum(part.lacking for part in parts),
        joined([part.empty for part in parts]),
        joined([part.infinite for part in parts]),
    )


class TooFewStepsError(InputError):
    """Hardly a step lacks nothing.

    Attributes:
        left: Which do, (0,) or (1,).
    """

    def __init__(self, message: str, left: NDArray[np.int64]) -> None:
        super().__init__(message)
        self.left = left


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
    gaps = gaps_of(holes, infinite, len(lacking))
    n, count, where = gaps.rows, gaps.lacking, gaps.where
    if missing == "refuse":
        row = int(np.argmax(lacking))
        number = 1 + (row if rows is None else int(rows[row]))
        raise InputError(
            f"{where}, the first of them row {number}; mend {'them' if count > 1 else 'it'}, or "
            f'leave out the steps that lack a value (--missing drop, in Python missing="drop")'
        )
    if n - count < 2:
        raise TooFewStepsError(
            f"{where}, so {'no step' if n == count else 'one step alone'} would be left; leave out "
            "the columns that are empty instead",
            np.flatnonzero(~lacking),
        )
    return np.flatnonzero(~lacking), gaps.note


def _where(columns: Mapping[str, int], what: str, n: int) -> str:
    """In how many of n rows columns are so, those with the most first."""
    # Of equally many by their names, which are the same in any part of a table.
    (first, most), *others = sorted(columns.items(), key=lambda one: (-one[1], one[0]))
    where = f"{first} {what} in {most:,} of {n:,} rows"
    where += "".join(f", {name} in {each:,}" for name, each in others[: _LISTED - 1])
    if len(others) >= _LISTED:
        where += f", {len(others) - _LISTED + 1:,} more columns in some"
    return where
