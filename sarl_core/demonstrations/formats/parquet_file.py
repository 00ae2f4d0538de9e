"""Parquet: one row a step, metadata under the schema's key `sarl`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.limits import MAX_UNPACKED, too_large
from sarl_core.demonstrations.formats.metadata import (
    KEY,
    Metadata,
    decode_metadata,
    encode_metadata,
)
from sarl_core.demonstrations.formats.tables import Column, check_names, columns_of
from sarl_core.errors import InputError

MAGIC = b"PAR1"


@dataclass(frozen=True)
class ParquetTable:
    """An opened Parquet file.

    Attributes:
        names: Names of the columns.
        metadata: What the file says besides.
        file: The ``pyarrow.parquet.ParquetFile``.
    """

    names: tuple[str, ...]
    metadata: Metadata
    file: Any

    @property
    def named(self) -> bool:
        """Columns of Parquet always have names."""
        return True

    def read(self, columns: ColumnMap) -> dict[str, Column]:
        """Numbers of the columns that a map uses.

        Args:
            columns: The map.

        Returns:
            A column for each name.

        Raises:
            InputError: If a column holds lists or text, or the file is damaged.
        """
        import pyarrow as pa

        schema = self.file.schema_arrow
        for name in columns.used:
            _require_flat(name, schema.field(name).type)
        try:
            table = self.file.read(columns=list(columns.used))
        except (pa.ArrowException, OSError, ValueError) as error:
            raise InputError("it is damaged or cut off; save or download it again") from error
        return {name: column_from_arrow(name, table.column(name)) for name in columns.used}


def open_parquet(data: memoryview) -> ParquetTable:
    """Open a Parquet file without reading its columns.

    Args:
        data: The whole file.

    Returns:
        The table.

    Raises:
        InputError: If it is cut off or damaged, has too many columns or would not fit in memory.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(pa.BufferReader(pa.py_buffer(data)))
        names = tuple(file.schema_arrow.names)
        rows = file.metadata.num_rows
        described = (file.schema_arrow.metadata or {}).get(KEY.encode())
    except (pa.ArrowException, OSError, ValueError) as error:
        raise InputError("it is damaged or cut off; save or download it again") from error
    check_names(names)
    if rows == 0:
        raise InputError(
            "there are no steps, only columns; give at least two observations with their actions"
        )
    # A few bytes of Parquet can stand for any number of rows.
    if rows * len(names) * 8 > MAX_UNPACKED:
        raise too_large(rows * len(names) * 8)
    metadata = Metadata() if described is None else decode_metadata(described)
    return ParquetTable(names, metadata, file)


def write_parquet(demonstrations: Demonstrations, out: BinaryIO) -> None:
    """Write demonstrations with all that is known about them.

    Args:
        demonstrations: To write.
        out: Where to.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pa.table(columns_of(demonstrations))
    pq.write_table(
        table.replace_schema_metadata({KEY: encode_metadata(demonstrations)}),
        out,
        compression="zstd",
    )


def column_from_arrow(name: str, column: Any) -> Column:
    """Numbers of an Arrow column.

    Args:
        name: For the message.
        column: A ``pyarrow.ChunkedArray``.

    Returns:
        Its numbers.

    Raises:
        InputError: If it holds something else, with the first row.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    kind = column.type
    if pa.types.is_dictionary(kind):
        column, kind = pc.cast(column, kind.value_type), kind.value_type
    if pa.types.is_decimal(kind):
        column, kind = pc.cast(column, pa.float64()), pa.float64()
    numeric = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)
    if not numeric and not pa.types.is_null(kind):
        found = pc.index(pc.is_valid(column), True).as_py()
        if found < 0:
            raise InputError(f"column {name!r} is empty; fill or leave it out")
        raise InputError(
            f"column {name!r} holds {shown(column[found].as_py())} in row {found + 1}, which is no "
            "number; mend that row"
        )
    if column.null_count == 0:
        return Column(np.asarray(column.to_numpy()))
    missing = np.asarray(pc.is_null(column).to_numpy())
    if pa.types.is_null(kind):
        return Column(np.full(len(column), np.nan), missing)
    filler = pa.scalar(float("nan") if pa.types.is_floating(kind) else 0, pa.float64()).cast(kind)
    return Column(np.asarray(pc.fill_null(column, filler).to_numpy()), missing)


def shown(value: Any) -> str:
    """A value for a sentence, cut short and on one line."""
    text = value if isinstance(value, str) else str(value)
    return repr(text if len(text) <= 40 else f"{text[:40]}...")


def _require_flat(name: str, kind: Any) -> None:
    import pyarrow as pa

    if pa.types.is_nested(kind) or isinstance(kind, pa.BaseExtensionType):
        raise InputError(
            f"column {name!r} holds a {str(kind).split('<')[0]} in each row; give each number a "
            "column of its own"
        )
