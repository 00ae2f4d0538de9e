"""Tables of Arrow in memory; files of Arrow's own, which are Feather files too, and its streams."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sarl_core.demonstrations.formats.arrow.messages import unpacked_size
from sarl_core.demonstrations.formats.arrow.nested import (
    Leaf,
    TableOfLeaves,
    few_leaves,
    leaves_of,
    refuse_nested,
    values_in,
)
from sarl_core.demonstrations.formats.arrow.parquet_file import (
    column_from_arrow,
    refusing_damage,
    times_from_arrow,
)
from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.metadata import KEY, Metadata, decode_metadata
from sarl_core.demonstrations.formats.opened_table import TableColumn, as_float32, check_names
from sarl_core.errors import InputError
from sarl_core.limits import require_memory, table_memory

FILE_MAGIC = b"ARROW1"
STREAM_MAGIC = b"\xff\xff\xff\xff"
_FILE_START = 8  # bytes before the stream that a file holds


@dataclass(frozen=True)
class ArrowTable(TableOfLeaves):
    """A table of Arrow that is in memory.

    Attributes:
        table: The ``pyarrow.Table``.
        metadata: What the file says besides.
    """

    table: Any
    metadata: Metadata

    def read(self, columns: ColumnMap) -> dict[str, TableColumn]:
        """Numbers of the columns that a map uses.

        Args:
            columns: The map.

        Returns:
            A column for each name.

        Raises:
            InputError: If a column holds something else, or the table is damaged.
        """
        d = len(columns.observations)
        rows = self.table.num_rows
        require_memory(self.table.nbytes + table_memory(rows, d, len(columns.used) - d))
        read: dict[str, TableColumn] = {}
        with refusing_damage():
            for name in columns.used:
                reader = times_from_arrow if name == columns.time else column_from_arrow
                column = reader(name, self._values(name))
                read[name] = as_float32(column) if name in columns.observations else column
        return read

    def _values(self, name: str) -> Any:
        import pyarrow as pa

        leaf = self.leaves[name]
        column = self.table.column(leaf.column)
        if not leaf.path:
            refuse_nested(name, column.type)
            return column
        parts, at = [], 0
        for chunk in column.chunks:
            parts.append(values_in(leaf, chunk, at))
            at += len(chunk)
        return pa.chunked_array(parts)


def arrow_table(table: Any) -> ArrowTable:
    """A table of Arrow with its columns of single values.

    Args:
        table: A ``pyarrow.Table`` that has been validated.

    Returns:
        The table.

    Raises:
        InputError: If it has no rows, too many columns, or two of one name.
    """
    check_names(table.column_names)
    if table.num_rows == 0:
        raise InputError(
            "there are no steps, only columns; give at least two observations with their actions"
        )
    leaves: dict[str, Leaf] = {}
    with refusing_damage():
        for field, column in zip(table.schema, table.columns, strict=True):
            leaves |= leaves_of(field.name, field.type, column[0])
        described = (table.schema.metadata or {}).get(KEY.encode())
    leaves = few_leaves(leaves)
    check_names(tuple(leaves))
    metadata = Metadata() if described is None else decode_metadata(described)
    return ArrowTable(leaves, table, metadata)


def open_arrow(data: memoryview) -> ArrowTable:
    """Read a file or a stream of Arrow.

    Args:
        data: The whole file.

    Returns:
        The table.

    Raises:
        InputError: If it is damaged or cut off, or unpacks to too much.
    """
    return arrow_table(table_of_stream(data))


def table_of_stream(data: memoryview) -> Any:
    """The ``pyarrow.Table`` of a file or a stream; arguments and errors as of `open_arrow`."""
    import pyarrow as pa

    if bytes(data[: len(FILE_MAGIC)]) == FILE_MAGIC:
        if bytes(data[-len(FILE_MAGIC) :]) != FILE_MAGIC:
            raise InputError("it is damaged or cut off; save or download it again")
        # What stands in a file is a stream; the list of its parts at the end is not needed.
        data = data[_FILE_START:]
    stream = pa.py_buffer(data)
    with refusing_damage():
        require_memory(len(data) + unpacked_size(stream))
        table = pa.ipc.open_stream(stream).read_all().unify_dictionaries()
        # Arrow trusts what stands in a file, places outside of it too.
        table.validate(full=True)
    return table
