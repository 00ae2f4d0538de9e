"""A file with named columns, opened: what it is, and what is read of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats import vocabulary
from sarl_core.demonstrations.formats.columns import ColumnMap, refuse_doubled
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.words import Coded
from sarl_core.errors import InputError, quoted

MAX_COLUMNS = 4096
MAX_NAME = 300  # characters of a column's name; a person has to read it in every rule


class Table(Protocol):
    """A file with named columns, opened and not yet read."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns."""

    @property
    def named(self) -> bool:
        """Whether those names stand in the file."""

    @property
    def metadata(self) -> Metadata:
        """What the file says besides."""

    def read(self, columns: ColumnMap) -> dict[str, TableColumn]:
        """Numbers of the columns that a map uses."""


@dataclass(frozen=True)
class TableColumn:
    """Numbers of one column, or words by number.

    Attributes:
        values: Shape (N,), bool, integers or floats; NaN or 0 where missing. Of words their
            numbers, int64; -1 where missing.
        missing: Shape (N,), where the column is empty, or None if it is nowhere.
        words: What the numbers stand for, in their order; () where they are numbers.
    """

    values: NDArray[Any]
    missing: NDArray[np.bool_] | None = None
    words: tuple[str, ...] = ()

    @classmethod
    def of_words(cls, coded: Coded) -> TableColumn:
        """A column of words; one without any is empty."""
        missing = coded.codes < 0
        if not coded.words:
            return cls(np.full(len(missing), np.nan), missing)
        return cls(coded.codes, missing if missing.any() else None, coded.words)

    @property
    def with_gaps(self) -> NDArray[Any]:
        """The values, not a number where missing."""
        if self.missing is None or self.values.dtype.kind == "f":
            return self.values
        return np.where(self.missing, np.nan, self.values)

    @property
    def is_time(self) -> bool:
        """Whether each of its words is a date, a time of day, or both."""
        return bool(self.words) and all(map(vocabulary.is_time, self.words))

    def at(self, rows: NDArray[np.int64]) -> TableColumn:
        """The same column in some of its rows."""
        missing = None if self.missing is None else self.missing[rows]
        return replace(self, values=self.values[rows], missing=missing)


def as_float32(column: TableColumn) -> TableColumn:
    """A column in the numbers that rules compare; words, and true and false, stay as they are."""
    if column.words or column.values.dtype.kind == "b":
        return column
    with np.errstate(over="ignore", invalid="ignore"):  # found as infinite
        return TableColumn(column.with_gaps.astype(np.float32, copy=False), column.missing)


def side_by_side(columns: Sequence[NDArray[Any]]) -> NDArray[np.float32] | None:
    """The block that columns were read into.

    Args:
        columns: d arrays of shape (N,).

    Returns:
        Shape (N, d), float32, with all of its columns in this order; None where they stand
        elsewhere, or in another order.
    """
    block = columns[0].base
    if block is None or block.dtype != np.float32 or block.shape != (len(columns[0]), len(columns)):
        return None
    places = [(one.ctypes.data, one.strides) for one in columns]
    of_block = [(one.ctypes.data, one.strides) for one in block.T]
    return block if places == of_block else None


def check_names(names: Sequence[str]) -> None:
    """Refuse a table with too many columns, a name nobody can read, or two of one name."""
    if len(names) > MAX_COLUMNS:
        raise InputError(
            f"there are {len(names):,} columns, more than the {MAX_COLUMNS:,} that rules a person "
            "reads could use; keep fewer"
        )
    long = next((name for name in names if len(name) > MAX_NAME), None)
    if long is not None:
        raise InputError(
            f"the column {quoted(long)} has a name of {len(long):,} characters; give it one of "
            f"{MAX_NAME} at most"
        )
    refuse_doubled(names)
