"""What the pages of a Parquet file unpack to, by their own headers and before any is unpacked.

The sizes in the file's footer are only what its writer said; the reader of Arrow goes by the
headers of the pages, so these are what counts. They are in Thrift's compact protocol.
"""

from __future__ import annotations

from typing import Any

from sarl_core.errors import InputError

_MOST_PAGES = 500_000
_DEEPEST = 8  # structures within structures; a page's header has three levels
# Fields of a page's header, and of the headers of data pages within it.
_UNPACKED, _PACKED, _DATA, _DATA_2, _VALUES = 2, 3, 5, 8, 1
_BOOLEAN, _BYTE, _WHOLE, _DOUBLE, _TEXT, _LIST, _STRUCTURE = (1, 2), 3, (4, 5, 6), 7, 8, (9, 10), 12


def largest_chunk(data: memoryview, metadata: Any, columns: list[int]) -> int:
    """Bytes that the pages of one column in one row group unpack to, of the largest.

    Args:
        data: The whole file.
        metadata: Its ``pyarrow.parquet.FileMetaData``.
        columns: Which of its columns, from 0.

    Returns:
        The size; all pages of a chunk are counted, though they are not unpacked at once.

    Raises:
        InputError: If the footer and the pages do not fit, or there are far too many pages.
    """
    largest = pages = 0
    for index in range(metadata.num_row_groups):
        group = metadata.row_group(index)
        for column in columns:
            size, count = _chunk(data, group.column(column), group.num_rows)
            largest, pages = max(largest, size), pages + count
            if pages > _MOST_PAGES:
                raise InputError(
                    "it is cut into far too many pages; save it again with larger ones"
                )
    return largest


def _chunk(data: memoryview, chunk: Any, rows: int) -> tuple[int, int]:
    """Bytes and number of the pages of a chunk."""
    if chunk.num_values != rows:
        raise _damaged()
    start = chunk.data_page_offset
    if chunk.has_dictionary_page and 0 < (chunk.dictionary_page_offset or 0) < start:
        start = chunk.dictionary_page_offset
    end = min(start + chunk.total_compressed_size, len(data))
    size = pages = values = 0
    while values < rows:
        if not 0 <= start < end:
            raise _damaged()
        try:
            header, start = _structure(data, start, 0)
            packed, unpacked = int(header[_PACKED]), int(header[_UNPACKED])
            for field in (_DATA, _DATA_2):
                if field in header:
                    values += int(header[field][_VALUES])
        except (IndexError, KeyError, TypeError) as error:
            raise _damaged() from error
        if packed < 0 or unpacked < 0:
            raise _damaged()
        start, size, pages = start + packed, size + unpacked, pages + 1
        if pages > _MOST_PAGES:
            break
    return size, pages


def _damaged() -> InputError:
    return InputError("it is damaged or cut off; save or download it again")


def _structure(data: memoryview, at: int, depth: int) -> tuple[dict[int, Any], int]:
    """Whole numbers and structures by the number of their field, and where the next thing is."""
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
        return None, _after_list(data, at, depth)
    if kind == _DOUBLE:
        return None, at + 8
    if kind in (*_BOOLEAN, _BYTE):
        return None, at + 1
    raise IndexError  # maps do not occur


def _after_list(data: memoryview, at: int, depth: int) -> int:
    head, at = data[at], at + 1
    size = head >> 4
    if size == 15:
        size, at = _varint(data, at)
    for _ in range(size):
        _, at = _value(data, at, head & 15, depth + 1)
        if at > len(data):
            raise IndexError
    return at


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
