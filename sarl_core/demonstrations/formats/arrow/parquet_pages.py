"""What the pages of a Parquet file unpack to, by their own headers and before any is unpacked.

The sizes in the file's footer are only what its writer said; the reader of Arrow goes by the
headers of the pages, so these are what counts. Footer and headers are in Thrift's compact
protocol. The footer is read here too: what Arrow shows of it to Python ends the whole process
where it is damaged.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from sarl_core.errors import InputError

MOST_FOOTER = 2**23  # bytes; it takes a hundred times as much in memory
_MOST_PAGES = 500_000
_WIDEST = 8  # bytes of a number
_DEEPEST = 16  # structures and lists within one another; a footer has nine levels
# Fields of the footer, of a row group, of a chunk (one column in one row group), of what is said
# of it, of a page's header, and of the headers of data pages within it.
_GROUPS = 4
_CHUNKS, _ROWS = 1, 3
_SAID = 3
_CHUNK_VALUES, _CHUNK_SIZE, _FIRST_PAGE, _DICTIONARY = 5, 7, 9, 11
_UNPACKED, _PACKED, _DATA, _DATA_2, _VALUES = 2, 3, 5, 8, 1
_BOOLEAN, _BYTE, _WHOLE, _DOUBLE, _TEXT, _LIST, _STRUCTURE = (1, 2), 3, (4, 5, 6), 7, 8, (9, 10), 12


def footer_size(data: memoryview) -> int:
    """Bytes of the footer, as the file ends by saying."""
    return int.from_bytes(data[-8:-4], "little")


def largest_chunk(
    data: memoryview, rows: int, columns: list[int], lists: Collection[int] = ()
) -> int:
    """Bytes that the pages of one column in one row group unpack to, of the largest.

    Args:
        data: The whole file.
        rows: How many it has.
        columns: Which of its columns, from 0.
        lists: Which of these hold lists, as many values as they like in each row.

    Returns:
        The size; all pages of a chunk are counted, though they are not unpacked at once. Values in
        lists count besides: a few bytes can stand for any number of them.

    Raises:
        InputError: If the footer and the pages do not fit, or there are far too many pages.
    """
    largest = pages = group_rows = 0
    try:
        footer, _ = _structure(data, len(data) - 8 - footer_size(data), 0)
        for group in footer.get(_GROUPS) or ():
            group_rows += group[_ROWS]
            for column in columns:
                said = group[_CHUNKS][column][_SAID]
                size, count = _chunk(data, said, None if column in lists else group[_ROWS])
                largest, pages = max(largest, size), pages + count
                if pages > _MOST_PAGES:
                    raise InputError(
                        "it is cut into far too many pages; save it again with larger ones"
                    )
    except (IndexError, KeyError, TypeError, AttributeError) as error:
        raise _damaged() from error
    if group_rows != rows:
        raise _damaged()
    return largest


def _chunk(data: memoryview, said: dict[int, Any], rows: int | None) -> tuple[int, int]:
    """Bytes and number of the pages of a chunk; without a number of rows, it holds lists."""
    if rows is not None and said[_CHUNK_VALUES] != rows:
        raise _damaged()
    start = said[_FIRST_PAGE]
    if 0 < said.get(_DICTIONARY, 0) < start:
        start = said[_DICTIONARY]
    end = min(start + said[_CHUNK_SIZE], len(data))
    size = pages = values = 0
    while start < end if rows is None else values < rows:
        if not 0 <= start < end:
            raise _damaged()
        header, start = _structure(data, start, 0)
        packed, unpacked = header[_PACKED], header[_UNPACKED]
        for field in (_DATA, _DATA_2):
            if field in header:
                values += header[field][_VALUES]
        if packed < 0 or unpacked < 0 or values < 0:
            raise _damaged()
        start, size, pages = start + packed, size + unpacked, pages + 1
        if pages > _MOST_PAGES:
            break
    return size + (_WIDEST * values if rows is None else 0), pages


def _damaged() -> InputError:
    return InputError("it is damaged or cut off; save or download it again")


def _structure(data: memoryview, at: int, depth: int) -> tuple[dict[int, Any], int]:
    """What it holds by the number of its field, texts as None; and where the next thing is."""
    fields: dict[int, Any] = {}
    field = 0
    while (head := data[at]) != 0:
        at += 1
        kind = head & 15
        if head >> 4:
            field += head >> 4
        else:
            field, at = _whole(data, at)
        value, at = (None, at) if kind in _BOOLEAN else _value(data, at, kind, depth)
        fields[field] = value
    return fields, at + 1


def _value(data: memoryview, at: int, kind: int, depth: int) -> tuple[Any, int]:
    if depth > _DEEPEST:
        raise IndexError
    if kind in _WHOLE:
        return _whole(data, at)
    if kind == _STRUCTURE:
        return _structure(data, at, depth + 1)
    if kind == _TEXT:
        size, at = _varint(data, at)
        return None, at + size
    if kind in _LIST:
        return _list(data, at, depth)
    if kind == _DOUBLE:
        return None, at + 8
    if kind in (*_BOOLEAN, _BYTE):
        return None, at + 1
    raise IndexError  # maps do not occur


def _list(data: memoryview, at: int, depth: int) -> tuple[list[Any], int]:
    """The structures of a list; nothing of a list of anything else."""
    head, at = data[at], at + 1
    size = head >> 4
    if size == 15:
        size, at = _varint(data, at)
    structures = []
    for _ in range(size):
        value, at = _value(data, at, head & 15, depth + 1)
        if at > len(data):
            raise IndexError
        if isinstance(value, dict):
            structures.append(value)
    return structures, at


def _whole(data: memoryview, at: int) -> tuple[int, int]:
    number, at = _varint(data, at)
    return (number >> 1) ^ -(number & 1), at


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    number = shift = 0
    while (byte := data[at]) & 128:
        number |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if shift > 63:
            raise IndexError
    return number | byte << shift, at + 1
