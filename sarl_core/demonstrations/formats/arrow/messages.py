"""What the messages of an Arrow stream unpack to, by their own headers and before any is unpacked.

A compressed buffer begins with the size that it unpacks to, and the reader of Arrow takes so much
memory. Where the buffers stand is said in a flatbuffer, of which the few fields are read here.
"""

from __future__ import annotations

import struct
from typing import Any

_MOST_MESSAGES = 500_000
# Places of fields in a message, a dictionary's batch and a batch of records.
_KIND, _HEADER = 1, 2
_DICTIONARY_DATA = 1
_BUFFERS, _COMPRESSION = 2, 3
_SCHEMA, _DICTIONARY, _RECORDS = 1, 2, 3


def unpacked_size(data: Any) -> int:
    """Bytes that the buffers of a stream take when they are unpacked.

    Args:
        data: The stream, a ``pyarrow.Buffer``.

    Returns:
        Their sum; 0 where nothing is compressed, as they are then used where they stand.

    Raises:
        ValueError: If the stream is damaged, or has far too many messages.
        pyarrow.ArrowException: Likewise.
    """
    import pyarrow as pa

    size = 0
    try:
        for count, message in enumerate(pa.ipc.MessageReader.open_stream(data)):
            if count > _MOST_MESSAGES:
                raise ValueError("far too many messages")
            size += _unpacked(memoryview(message.metadata), message.body)
    except (struct.error, IndexError) as error:
        raise ValueError("a message does not fit its own header") from error
    return size


def _unpacked(message: memoryview, body: Any) -> int:
    root = _number("<I", message, 0)
    kind = _field(message, root, _KIND)
    header = _field(message, root, _HEADER)
    if kind is None or header is None or (code := message[kind]) == _SCHEMA:
        return 0
    batch: int | None = _followed(message, header)
    if code == _DICTIONARY:
        place = _field(message, _followed(message, header), _DICTIONARY_DATA)
        batch = None if place is None else _followed(message, place)
    elif code != _RECORDS:
        batch = None
    if batch is None or _field(message, batch, _COMPRESSION) is None:
        return 0
    listed = _field(message, batch, _BUFFERS)
    if listed is None or body is None:
        return 0
    vector = _followed(message, listed)
    content = memoryview(body)
    size = 0
    for index in range(_number("<I", message, vector)):
        start, length = struct.unpack_from("<qq", message, vector + 4 + 16 * index)
        if length > 0:
            size += max(_number("<q", content, start), 0)  # -1 where this one is not compressed
    return size


def _field(data: memoryview, table: int, field: int) -> int | None:
    """Where a field of a table stands; None where it is left out."""
    names = table - _number("<i", data, table)
    if 4 + 2 * field >= _number("<H", data, names):
        return None
    place = _number("<H", data, names + 4 + 2 * field)
    return table + place if place else None


def _followed(data: memoryview, place: int) -> int:
    return place + _number("<I", data, place)


def _number(form: str, data: memoryview, place: int) -> int:
    if place < 0:
        raise IndexError
    return int(struct.unpack_from(form, data, place)[0])
