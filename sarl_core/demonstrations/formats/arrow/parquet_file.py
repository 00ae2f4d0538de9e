"""Parquet: one row a step, metadata under the schema's key `sarl`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.arrow.nested import (
    Leaf,
    TableOfLeaves,
    few_leaves,
    has_lists,
    leaf_type,
    leaves_of,
    refuse_nested,
    values_in,
)
from sarl_core.demonstrations.formats.arrow.parquet_pages import (
    MOST_FOOTER,
    footer_size,
    largest_chunk,
)
from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.metadata import (
    KEY,
    Metadata,
    decode_metadata,
    encode_metadata,
)
from sarl_core.demonstrations.formats.opened_table import MAX_NAME, TableColumn, check_names
from sarl_core.demonstrations.formats.saved_columns import columns_of
from sarl_core.demonstrations.formats.times import of_words
from sarl_core.demonstrations.words import Coded, in_order
from sarl_core.errors import InputError, quoted
from sarl_core.limits import read_limit, require_memory, table_memory

MAGIC = b"PAR1"
_BATCH = 2**17  # rows that are brought into their final form at once
_COPIES = 4  # that Arrow has of a long text while it reads it


@dataclass(frozen=True)
class ParquetTable(TableOfLeaves):
    """An opened Parquet file.

    Attributes:
        metadata: What the file says besides.
        file: The ``pyarrow.parquet.ParquetFile``.
        data: The whole file.
    """

    metadata: Metadata
    file: Any
    data: memoryview

    def read(self, columns: ColumnMap) -> dict[str, TableColumn]:
        """Numbers of the columns that a map uses.

        Args:
            columns: The map.

        Returns:
            A column for each name.

        Raises:
            InputError: If a column holds lists or far too much text, or the file is damaged.
        """
        with refusing_damage():
            schema, rows = self.file.schema_arrow, self.file.metadata.num_rows
            leaves = {name: self.leaves[name] for name in columns.used}
            for name, leaf in leaves.items():
                if not leaf.path:
                    refuse_nested(name, schema.field(name).type)
            d = len(columns.observations)
            needed = len(self.data) + table_memory(rows, d, len(columns.used) - d)
            # Before a page is unpacked: a few bytes can stand for any number of rows, or of bytes.
            require_memory(needed)
            used = dict.fromkeys(leaf.column for leaf in leaves.values())
            require_memory(needed + _largest_of(self.file, self.data, used))
            flat = [name for name, leaf in leaves.items() if not leaf.path]
            others = [name for name in flat if not _is_numeric(schema.field(name).type)]
            if _COPIES * _largest_of(self.file, self.data, others) > read_limit():
                raise InputError(
                    f"column {quoted(others[0])} holds no numbers and too much text; write "
                    "numbers or a few words, or leave it out"
                )
            # Texts by their dictionary: each stands there once, however often it occurs.
            texts = [name for name in flat if is_text(schema.field(name).type)]
            texts += [
                ".".join((leaf.column, *map(str, leaf.path)))
                for leaf in leaves.values()
                if leaf.path and is_text(leaf_type(leaf, schema.field(leaf.column).type))
            ]
            file = _opened(self.data, texts)
            # The features side by side, as they are needed in the end: columns would be copied.
            block = np.empty((rows, d), dtype=np.float32)
            places = dict(zip(columns.observations, block.T, strict=True))
            read: dict[str, TableColumn] = {}
            for column in used:
                wanted = {name: leaf for name, leaf in leaves.items() if leaf.column == column}
                read |= _columns(file, column, wanted, columns, schema, places)
            return {name: read[name] for name in columns.used}


def whole_table(table: ParquetTable, columns: Sequence[str]) -> Any:
    """Some columns as they stand in the file, lists of any length among them.

    Args:
        table: The opened file.
        columns: Of the file.

    Returns:
        A ``pyarrow.Table``.

    Raises:
        InputError: If they are damaged, or unpack to too much.
    """
    with refusing_damage():
        sizes = [_largest_of(table.file, table.data, [column]) for column in columns]
        require_memory(len(table.data) + table.file.metadata.num_row_groups * sum(sizes))
        return table.file.read(columns=list(columns), use_threads=False)


def open_parquet(data: memoryview) -> ParquetTable:
    """Open a Parquet file without reading its columns.

    Args:
        data: The whole file.

    Returns:
        The table.

    Raises:
        InputError: If it is cut off or damaged, has too many columns or would not fit in memory.
    """
    # The list of columns and row groups stands at the end, and its length behind it.
    if MOST_FOOTER < footer_size(data) < len(data) and data[-4:] == MAGIC:
        raise InputError(
            "its list of columns and row groups is far too long; save it in fewer row groups"
        )
    with refusing_damage():
        file = _opened(data)
        check_names(file.schema_arrow.names)
        rows = file.metadata.num_rows
        described = (file.schema_arrow.metadata or {}).get(KEY.encode())
    if rows == 0:
        raise InputError(
            "there are no steps, only columns; give at least two observations with their actions"
        )
    metadata = Metadata() if described is None else decode_metadata(described)
    with refusing_damage():
        leaves = _leaves_of(file, data)
    leaves = few_leaves(leaves)
    check_names(tuple(leaves))
    return ParquetTable(leaves, metadata, file, data)


@contextmanager
def refusing_damage() -> Iterator[None]:
    """Turn what Arrow raises on a damaged file into one sentence."""
    import pyarrow as pa

    try:
        yield
    # RuntimeError is what becomes of exceptions of Parquet's own code.
    except (pa.ArrowException, OSError, ValueError, OverflowError, RuntimeError) as error:
        raise _damaged() from error


def _opened(data: memoryview, texts: Sequence[str] = ()) -> Any:
    """The file, with some columns to be read as dictionaries."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    return pq.ParquetFile(pa.BufferReader(pa.py_buffer(data)), read_dictionary=list(texts))


def _columns(
    file: Any,
    column: str,
    leaves: Mapping[str, Leaf],
    used: ColumnMap,
    schema: Any,
    places: Mapping[str, NDArray[np.float32]],
) -> dict[str, TableColumn]:
    """The leaves of one column, brought into their final form and place batch by batch."""
    import pyarrow as pa

    rows = file.metadata.num_rows
    values: dict[str, NDArray[Any]] = {}
    missing: dict[str, NDArray[np.bool_]] = {}
    texts: dict[str, list[Any]] = {}  # together they are words, in one order
    at = 0
    for batch in file.iter_batches(_BATCH, columns=[column], use_threads=False):
        end = at + batch.num_rows
        if end > rows:
            raise _damaged()
        for name, leaf in leaves.items():
            held = values_in(leaf, batch.column(0), at)
            if is_text(held.type) or _is_time(held.type):
                texts.setdefault(name, []).append(held)
                continue
            part = column_from_arrow(name, held, at)
            if name not in values:
                # True and false are more than 1 and 0.
                as_it_is = name not in places or part.values.dtype.kind == "b"
                values[name] = np.empty(rows, part.values.dtype) if as_it_is else places[name]
            # What overflows float32 is found as infinite.
            with np.errstate(over="ignore", invalid="ignore"):
                values[name][at:end] = part.with_gaps if name in places else part.values
            if part.missing is not None:
                missing.setdefault(name, np.zeros(rows, dtype=np.bool_))[at:end] = part.missing
        at = end
    if len(values) + len(texts) < len(leaves) or at != rows:
        raise _damaged()
    numbers = {name: TableColumn(one, missing.get(name)) for name, one in values.items()}
    kind = schema.field(column).type  # a file that is read by dictionaries forgets their order
    ordered = pa.types.is_dictionary(kind) and kind.ordered
    words = {
        name: times_from_arrow(name, pa.chunked_array(one))
        if name == used.time
        else TableColumn.of_words(_words(name, pa.chunked_array(one), ordered=ordered))
        for name, one in texts.items()
    }
    return numbers | words


def _leaves_of(file: Any, data: memoryview) -> dict[str, Leaf]:
    """Where each column of single values stands."""
    leaves: dict[str, Leaf] = {}
    for field in file.schema_arrow:
        first = None
        # How long a list is stands in no schema; where its first row cannot be looked at for
        # little memory, it stays one column, which is refused where it is needed.
        if has_lists(field.type) and _largest_of(file, data, [field.name]) < read_limit():
            batch = next(file.iter_batches(1, columns=[field.name], use_threads=False), None)
            first = batch.column(0)[0] if batch is not None and batch.num_rows else None
        leaves |= leaves_of(field.name, field.type, first)
    return leaves


def _largest_of(file: Any, data: memoryview, columns: Collection[str]) -> int:
    """Bytes that the largest chunk of some columns unpacks to."""
    import pyarrow as pa

    flat: list[int] = []
    nested: set[int] = set()
    at = 0
    for field in file.schema_arrow:  # a row group counts the flat columns within nested ones
        end = at + _leaves(field.type)
        if field.name in columns:
            flat += range(at, end)
            if pa.types.is_nested(field.type):
                nested.update(range(at, end))
        at = end
    if at != file.metadata.num_columns:
        raise _damaged()
    return largest_chunk(data, file.metadata.num_rows, flat, nested)


def _leaves(kind: Any) -> int:
    import pyarrow as pa

    if isinstance(kind, pa.BaseExtensionType):
        return _leaves(kind.storage_type)
    if not pa.types.is_nested(kind):
        return 1
    return sum(_leaves(kind.field(index).type) for index in range(kind.num_fields))


def _damaged() -> InputError:
    return InputError("it is damaged or cut off; save or download it again")


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


def column_from_arrow(name: str, column: Any, start: int = 0) -> TableColumn:
    """Numbers of an Arrow column, or its words.

    Args:
        name: For the message.
        column: A ``pyarrow.ChunkedArray`` or ``pyarrow.Array``.
        start: Row of its first value, from 0.

    Returns:
        Its numbers.

    Raises:
        InputError: If it holds something else, with the first row.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    kind = column.type
    if is_text(kind) or _is_time(kind):
        ordered = pa.types.is_dictionary(kind) and kind.ordered
        return TableColumn.of_words(_words(name, column, ordered=ordered))
    if pa.types.is_dictionary(kind):
        column, kind = pc.cast(column, kind.value_type), kind.value_type
    if pa.types.is_decimal(kind):
        column, kind = pc.cast(column, pa.float64()), pa.float64()
    if pa.types.is_duration(kind):
        column, kind = _seconds(column), pa.float64()
    if not _is_numeric(kind):
        place = pc.index(pc.is_valid(column), True).as_py()
        if place < 0:
            raise InputError(
                f"column {quoted(name)} is empty in row {start + 1}; fill it or leave it out"
            )
        raise InputError(
            f"column {quoted(name)} holds {quoted(_value(column[place]))} in row "
            f"{start + place + 1}, which is no number; mend that row"
        )
    if column.null_count == 0:
        return TableColumn(_numbers(column))
    missing = np.asarray(pc.is_null(column).to_numpy(zero_copy_only=False))
    if pa.types.is_null(kind):
        return TableColumn(np.full(len(column), np.nan), missing)
    filler = pa.scalar(float("nan") if pa.types.is_floating(kind) else 0, pa.float64()).cast(kind)
    return TableColumn(_numbers(pc.fill_null(column, filler)), missing)


def times_from_arrow(name: str, column: Any) -> TableColumn:
    """Times of an Arrow column; arguments and errors as of `column_from_arrow`.

    Returns:
        Times of NumPy, numbers as they stand there, or a word that is no time.
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    kind = column.type
    if not _is_time(kind):
        held = column_from_arrow(name, column)
        return of_words(held) if held.words else held
    if pa.types.is_time(kind):
        column = pc.cast(pc.cast(column, pa.time64("us")), pa.int64())
    zone = kind.tz if pa.types.is_timestamp(kind) else None
    return TableColumn(_numbers(pc.cast(column, pa.timestamp("us", zone), safe=False)))


def _words(name: str, column: Any, *, ordered: bool) -> Coded:
    """The words of an Arrow column, each looked at once however often it occurs."""
    import pyarrow as pa
    import pyarrow.compute as pc

    chunked = column if isinstance(column, pa.ChunkedArray) else pa.chunked_array([column])
    if _is_time(chunked.type):
        chunked = pc.cast(chunked, pa.large_string())
    if not pa.types.is_dictionary(chunked.type):
        chunked = pc.dictionary_encode(chunked.combine_chunks())  # once, and not chunk by chunk
    whole = chunked
    if isinstance(chunked, pa.ChunkedArray):
        whole = chunked.unify_dictionaries().combine_chunks()
    whole = whole.chunk(0) if isinstance(whole, pa.ChunkedArray) else whole
    codes = np.asarray(pc.fill_null(pc.cast(whole.indices, pa.int64()), -1))
    sizes = np.asarray(pc.fill_null(pc.binary_length(whole.dictionary), 0))
    if sizes.size and sizes.max() > MAX_NAME:
        row = int(np.argmax(codes == int(np.argmax(sizes))))
        raise InputError(
            f"column {quoted(name)} holds {quoted(_value(whole[row]))} in row {row + 1}, which is "
            "no number and too long for a word; shorten it, or leave the column out"
        )
    texts = pc.cast(whole.dictionary, pa.large_string()).to_pylist()
    return in_order(codes, [text or "" for text in texts], ordered=ordered)


def _seconds(column: Any) -> Any:
    """How long durations last."""
    import pyarrow as pa
    import pyarrow.compute as pc

    microseconds = pc.cast(column, pa.duration("us"), safe=False)
    return pc.divide(pc.cast(microseconds, pa.int64()), pa.scalar(1e6))


def _numbers(column: Any) -> NDArray[Any]:
    """Without a missing one."""
    import pyarrow as pa
    import pyarrow.compute as pc

    kind = column.type
    # `to_numpy` would load pandas, which takes longer than to read the file.
    if isinstance(column, pa.Array):
        if pa.types.is_integer(kind) or pa.types.is_floating(kind):
            return np.from_dlpack(column)
        if pa.types.is_boolean(kind):
            return np.from_dlpack(pc.cast(column, pa.uint8())).view(np.bool_)
    return np.asarray(column.to_numpy(zero_copy_only=False))


def _is_numeric(kind: Any) -> bool:
    """Whether its values are numbers, true and false, or nothing at all."""
    import pyarrow as pa

    if pa.types.is_dictionary(kind):
        return _is_numeric(kind.value_type)
    return bool(
        pa.types.is_integer(kind)
        or pa.types.is_floating(kind)
        or pa.types.is_boolean(kind)
        or pa.types.is_decimal(kind)
        or pa.types.is_null(kind)
    )


def _is_time(kind: Any) -> bool:
    """Whether its values are dates, times of day, or both, which are told as words."""
    import pyarrow as pa

    return bool(pa.types.is_timestamp(kind) or pa.types.is_date(kind) or pa.types.is_time(kind))


def is_text(kind: Any) -> bool:
    """Whether an Arrow type's values are texts, be it by a dictionary."""
    import pyarrow as pa

    if pa.types.is_dictionary(kind):
        return is_text(kind.value_type)
    return bool(
        pa.types.is_string(kind)
        or pa.types.is_large_string(kind)
        or pa.types.is_string_view(kind)
        or pa.types.is_binary(kind)
        or pa.types.is_large_binary(kind)
        or pa.types.is_binary_view(kind)
    )


def _value(scalar: Any) -> Any:
    """What an Arrow scalar is in Python; of a text what is quoted, however long it is."""
    import pyarrow as pa

    if isinstance(scalar, pa.DictionaryScalar):
        scalar = scalar.value
    if isinstance(scalar, pa.BinaryScalar):
        return bytes(scalar.as_buffer()[:200])
    return str(scalar)
