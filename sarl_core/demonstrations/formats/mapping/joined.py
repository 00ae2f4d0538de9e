"""Several columns that are one action: which of them is 1 says what was done."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats.columns import ColumnMap, listed
from sarl_core.demonstrations.formats.mapping.roles import TOGETHER, Roles
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.errors import InputError, quoted

if TYPE_CHECKING:
    from sarl_core.demonstrations.formats.opened_table import Table, TableColumn

_NONE = ("none", "nothing", "none of them")  # what a label is called where no column is 1


@dataclass(frozen=True)
class JoinedTable:
    """A table in which some columns are one.

    Attributes:
        table: As it was opened.
        groups: For the name of each such column those that it is made of.
    """

    table: Table
    groups: Mapping[str, tuple[str, ...]]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, each group in the place of its first."""
        first = {parts[0]: name for name, parts in self.groups.items()}
        others = {part for parts in self.groups.values() for part in parts[1:]}
        return tuple(first.get(name, name) for name in self.table.names if name not in others)

    @property
    def named(self) -> bool:
        """Whether the names stand in the file."""
        return self.table.named

    @property
    def metadata(self) -> Metadata:
        """What the file says besides."""
        return self.table.metadata

    def read(self, columns: ColumnMap) -> dict[str, TableColumn]:
        """Numbers of the columns that a map uses, and the words of those that are joined.

        Args:
            columns: The map.

        Returns:
            A column for each name.

        Raises:
            InputError: As the table's own; or if columns that are joined hold anything but 1 and
                0, or two of them are 1 in one row.
        """
        groups = {name: parts for name, parts in self.groups.items() if name in columns.used}
        single = [name for name in columns.actions if name not in groups]
        parts = [part for each in groups.values() for part in each]
        read = self.table.read(replace(columns, actions=(*single, *parts)))
        joined = {
            name: _one_of(each, [read[part] for part in each]) for name, each in groups.items()
        }
        return {name: joined[name] if name in joined else read[name] for name in columns.used}


def joined(table: Table, roles: Roles) -> Table:
    """A table in which the columns that a person said are one action are one column.

    Args:
        table: The opened file.
        roles: What was said; of "left+right" that it is the action.

    Returns:
        The table itself where nothing of the kind was said.

    Raises:
        InputError: If a column is in two groups, or also has a role of its own, or a group is
            something else than an action.
    """
    groups: dict[str, tuple[str, ...]] = {}
    names = set(table.names)
    for name, role in roles.items():
        parts = tuple(name.split(TOGETHER))
        if name in names or len(parts) < 2 or not names.issuperset(parts):
            continue
        if role.role != "action" or role.kind == "continuous":
            raise InputError(
                f"{listed(parts)} can be one action together and nothing else; write "
                f"{quoted(name)} with the role action"
            )
        groups[name] = parts
    every = [*(part for parts in groups.values() for part in parts), *(names & roles.keys())]
    doubled = next((name for index, name in enumerate(every) if name in every[:index]), None)
    if doubled is not None:
        raise InputError(f"the column {quoted(doubled)} is mapped twice; give it one meaning")
    return JoinedTable(table, groups) if groups else table


def never_together(columns: Sequence[NDArray[np.bool_] | None]) -> bool:
    """Whether columns may be one action: each is 1 at times and else 0, and never two at once.

    Args:
        columns: As `ones_of` gives them, each of shape (N,).

    Returns:
        False for one column.
    """
    ones = [one for one in columns if one is not None and one.any()]
    if len(ones) < len(columns) or len(columns) < 2:
        return False
    return bool(np.sum(ones, axis=0, dtype=np.int64).max() == 1)


def one_action_note(names: Sequence[str], columns: Sequence[TableColumn]) -> tuple[str, ...]:
    """A sentence on actions that may be one.

    Args:
        names: Of their columns.
        columns: Those.

    Returns:
        () where they are not.
    """
    if not never_together([ones_of(column) for column in columns]):
        return ()
    option = shlex.quote(f"{TOGETHER.join(names)}=action")
    return (
        f"the actions {listed(names)} are never 1 in the same row; if they are one action, say so "
        f"with --column {option} (on the page Demonstrations: in the form)",
    )


def ones_of(column: TableColumn) -> NDArray[np.bool_] | None:
    """Where a column is 1, None if it holds anything but 1 and 0."""
    if column.words or column.missing is not None:
        return None
    ones = column.values == 1
    return ones if bool(np.all(ones | (column.values == 0))) else None


def labels_together(names: Sequence[str], columns: Sequence[NDArray[np.bool_]]) -> tuple[str, ...]:
    """The labels of columns that are one action.

    Args:
        names: Of the columns.
        columns: Where each is 1, of shape (N,).

    Returns:
        What the columns say apart from a beginning that all share; before them a word for none of
        them, where there are such rows.
    """
    words = _words(names)
    if np.logical_or.reduce(list(columns)).all():
        return words
    return (next(word for word in _NONE if word not in words), *words)


def _one_of(names: Sequence[str], columns: Sequence[TableColumn]) -> TableColumn:
    """The column of words that says which of several is 1."""
    ones = []
    for name, column in zip(names, columns, strict=True):
        one = ones_of(column)
        if one is None:
            raise InputError(
                f"column {quoted(name)} holds something else than 1 and 0, so it is no part of an "
                "action; map it as an action of its own"
            )
        ones.append(one)
    counts = np.sum(ones, axis=0, dtype=np.int64)
    if counts.max() > 1:
        row = int(np.argmax(counts > 1))
        both = [name for name, one in zip(names, ones, strict=True) if one[row]]
        raise InputError(
            f"the columns {listed(both)} are both 1 in row {row + 1}, so they are not one action; "
            "map each as an action of its own"
        )
    words = labels_together(names, ones)
    codes = np.argmax(ones, axis=0)
    if len(words) > len(names):
        codes = np.where(counts > 0, codes + 1, 0)
    return replace(columns[0], values=codes.astype(np.int64), words=words)


def _words(names: Sequence[str]) -> tuple[str, ...]:
    """What the columns say apart from a beginning that all share: left, right."""
    words = [re.split(r"(?<=[_ .\-/])", name) for name in names]
    alike = takewhile(lambda each: len(set(each)) == 1, zip(*words, strict=False))
    start = sum(len(each[0]) for each in alike)
    rest = tuple(name[start:] for name in names)
    return rest if all(rest) else tuple(names)
