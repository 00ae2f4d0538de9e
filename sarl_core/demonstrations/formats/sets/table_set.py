"""Tables of the same columns in several files, one after the other as one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats import vocabulary
from sarl_core.demonstrations.formats.columns import SINGLES, ColumnMap, guess_roles, listed
from sarl_core.demonstrations.formats.kinds import FORMATS, extension_of, format_of, unpacked
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.opened_table import Table, TableColumn
from sarl_core.demonstrations.formats.sets.file_set import FileSet
from sarl_core.demonstrations.words import counted_as_they_come
from sarl_core.errors import InputError, quoted
from sarl_core.limits import require_memory

_EPISODE = "episode"  # the column that says which file a row is from
_MARKS = ("step", "terminated", "truncated", "first", "last")


@dataclass(frozen=True)
class TableSet:
    """Several tables of the same columns.

    Attributes:
        files: Their paths, in the order of the set.
        tables: The opened tables.
        marks: Where no column numbers the episodes and each file begins one: what else says in
            a file that another one begins, by what it is. None where a column numbers them.
        size: Bytes of all files.
    """

    files: tuple[str, ...]
    tables: tuple[Table, ...]
    marks: Mapping[str, str] | None
    size: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns that every file has."""
        every = [set(table.names) for table in self.tables]
        own = tuple(name for name in self.tables[0].names if all(name in one for one in every))
        return own if self.marks is None else (*own, _EPISODE)

    @property
    def named(self) -> bool:
        """Whether those names stand in the files."""
        return self.tables[0].named

    @property
    def metadata(self) -> Metadata:
        """What the first file says besides."""
        return self.tables[0].metadata

    def read(self, columns: ColumnMap) -> dict[str, TableColumn]:
        """Numbers of the columns that a map uses.

        Args:
            columns: The map.

        Returns:
            A column for each name.

        Raises:
            InputError: As of a single table, with the name of the file.
        """
        needed = columns if self.marks is None else _without_episode(columns)
        parts: list[dict[str, TableColumn]] = []
        begins: list[NDArray[np.bool_]] = []
        size = self.size
        for file, table in zip(self.files, self.tables, strict=True):
            with naming(file):
                read = table.read(needed if needed.used else ColumnMap((), table.names[:1]))
                parts.append(read)
                size += sum(column.values.nbytes for column in read.values())
                require_memory(size)
                n = len(next(iter(read.values())).values)
                marked = table.read(ColumnMap((), tuple((self.marks or {}).values())))
                begins.append(_begins(n, self.marks or {}, marked))
        joined = {name: _joined([part[name] for part in parts]) for name in needed.used}
        if self.marks is not None and _EPISODE in columns.used:
            joined[_EPISODE] = TableColumn(np.cumsum(np.concatenate(begins)) - 1)
        elif columns.episode is not None:
            column = joined[columns.episode]
            # Words that stand together are one episode, in whatever order they would be sorted.
            own = counted_as_they_come(column.values) if column.words else column.values
            numbers = renumbered(own, list(map(len, begins)))
            if numbers is not own:
                joined[columns.episode] = TableColumn(numbers, column.missing)
        return {name: joined[name] for name in columns.used}


def open_tables(files: FileSet) -> tuple[Table, tuple[str, ...]]:
    """Open the tables among some files as one.

    Args:
        files: Of which others than tables are left alone.

    Returns:
        The table, and notes on how it was put together.

    Raises:
        InputError: If there are none, files of several formats, or files whose columns differ.
    """
    paths = tables_among(files)
    tables: list[Table] = []
    contents = files.contents(paths)
    for path in paths:
        with naming(path):
            open_table = format_of(path).open_table
            assert open_table is not None
            tables.append(open_table(unpacked(contents.pop(path), path)))
        if len(paths) == 1 and not tables[0].named:
            raise _without_tables(files)
        with naming(path):
            _require_same(tables[0], tables[-1], paths[0])
    size = sum(files.sizes[path] for path in paths)
    if len(tables) == 1:
        return tables[0], ()
    first = guess_roles(tables[0].names).columns
    marks = None
    if first.episode is None and _EPISODE not in tables[0].names:
        marks = {role: name for role, name in first.singles.items() if role in _MARKS}
    table = TableSet(tuple(paths), tuple(tables), marks, size)
    each = "" if marks is None else "; each begins an episode, as no column numbers them"
    return table, (f"{one_set_note(paths)}{each}",)


def one_set_note(paths: Sequence[str]) -> str:
    """That several files are one.

    Args:
        paths: Of the files, two or more, in their order.

    Returns:
        The note.
    """
    first, last = (PurePosixPath(path).name for path in (paths[0], paths[-1]))
    return f"{len(paths):,} files were read as one set, from {first!r} to {last!r}"


def tables_among(files: FileSet) -> list[str]:
    """Those of the one format that tables are in.

    Args:
        files: Of which others than tables are left alone.

    Returns:
        Their paths.

    Raises:
        InputError: If there are none, or of several formats.
    """
    by_kind: dict[str, list[str]] = {}
    for path in files.sizes:
        form = FORMATS.get(extension_of(path))
        if form is not None and form.open_table is not None:
            by_kind.setdefault(form.kind, []).append(path)
    if len(by_kind) > 1:  # JSON says something about what lies beside it
        by_kind.pop("JSON", None)
    if not by_kind:
        raise _without_tables(files)
    if len(by_kind) > 1:
        first, second = (f"{kind} ({paths[0]!r})" for kind, paths in list(by_kind.items())[:2])
        raise InputError(
            f"it holds files of several formats, {first} and {second}; give those of one"
        )
    return next(iter(by_kind.values()))


def _without_tables(files: FileSet) -> InputError:
    return InputError(
        f"it is {files.what} without obs.csv and actions.csv, and without any other file that "
        "holds a table with names; give a file, or a folder with those"
    )


def _require_same(first: Table, table: Table, path: str) -> None:
    """Refuse a file whose columns are not those of the first."""
    if not table.named:
        raise InputError(
            "it has no header, and several files are put together by the names of their columns; "
            "write one into each"
        )
    if table.names == first.names:
        return
    lacking, surplus = (
        [name for name in names if name not in others and not vocabulary.numbers_rows(name)]
        for names, others in ((first.names, table.names), (table.names, first.names))
    )
    if lacking:
        what = f"it has no column {listed(lacking[:1])}, and {path!r} has"
    elif surplus:
        what = f"it has a column {listed(surplus[:1])}, and {path!r} has none"
    else:
        return  # in another order, which the names mend, or with row numbers in some alone
    raise InputError(f"{what}; give files of the same columns")


def _begins(n: int, marks: Mapping[str, str], read: Mapping[str, TableColumn]) -> NDArray[np.bool_]:
    """Which of the n rows of a file begin an episode: the first, and those that marks say."""
    begins = np.zeros(n, dtype=np.bool_)
    begins[:1] = True
    for role, name in marks.items():
        values = read[name].values
        if role == "step":
            begins[1:] |= values[1:] <= values[:-1]
        elif role == "first":
            begins |= values != 0
        else:
            begins[1:] |= values[:-1] != 0
    return begins


def _without_episode(columns: ColumnMap) -> ColumnMap:
    """The map without the column that no file has."""
    return replace(
        columns,
        observations=tuple(name for name in columns.observations if name != _EPISODE),
        actions=tuple(name for name in columns.actions if name != _EPISODE),
        **{role: None for role in SINGLES if getattr(columns, role) == _EPISODE},
    )


def _joined(parts: Sequence[TableColumn]) -> TableColumn:
    missing: NDArray[np.bool_] | None = None
    if any(part.missing is not None for part in parts):
        missing = np.concatenate(
            [
                np.zeros(len(part.values), np.bool_) if part.missing is None else part.missing
                for part in parts
            ]
        )
    worded = [part for part in parts if part.words]
    if worded:
        return _joined_words(parts, worded, missing)
    return TableColumn(np.concatenate([part.values for part in parts]), missing)


def _joined_words(
    parts: Sequence[TableColumn], worded: Sequence[TableColumn], missing: NDArray[np.bool_] | None
) -> TableColumn:
    """Columns of words as one, in the order of the file that has them all, else sorted."""
    for part in parts:
        if not part.words and (part.missing is None or not part.missing.all()):
            raise InputError(
                f"a column holds numbers in one file and words, as {quoted(worded[0].words[0])}, "
                "in another; write it alike in all files"
            )
    words = max((part.words for part in worded), key=len)
    if not all({*part.words} <= {*words} for part in worded):
        words = tuple(sorted({word for part in worded for word in part.words}))
    numbers = {word: number for number, word in enumerate(words)}
    values = [
        np.array([*(numbers[word] for word in part.words), -1])[
            part.values if part.words else np.full(len(part.values), -1)
        ]
        for part in parts
    ]
    return TableColumn(np.concatenate(values).astype(np.int64), missing, words)


def renumbered(values: NDArray[Any], lengths: Sequence[int]) -> NDArray[Any]:
    """The numbers of episodes, where those of each file begin again.

    Args:
        values: Of all files, one file after the other: a number a row, or a number an episode.
        lengths: How many are of each file.

    Returns:
        As many; the same where each episode has a number of its own, or goes on in the next file.
    """
    if values.dtype.kind not in "iu":
        return values
    ends = np.cumsum(lengths)
    parts = np.split(values.astype(np.int64), ends[:-1])
    seen: set[int] = set()
    for part in parts:
        numbers = set(np.unique(part).tolist())
        if seen & numbers:
            break
        seen |= numbers
    else:
        return values  # each episode has a number of its own
    if _continues(parts):
        return values
    after = 0
    numbered = []
    for part in parts:
        numbered.append(part - part.min() + after)
        after = int(numbered[-1].max()) + 1
    return np.concatenate(numbered)


def _continues(parts: Sequence[NDArray[np.int64]]) -> bool:
    """Whether files are pieces of one table, cut anywhere: the numbers go on from each to the next.

    Files that hold one episode each, all of one number, do not.
    """
    rising = all(
        bool(np.all(np.diff(np.concatenate([before[-1:], part])) >= 0))
        for before, part in pairwise(parts)
    )
    return rising and any(part[0] != parts[0][0] or part[-1] != parts[0][0] for part in parts)
