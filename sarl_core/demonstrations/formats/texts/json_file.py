"""JSON: lines of which each is the object of a row, or one list of such objects."""

from __future__ import annotations

import codecs
import re
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import msgspec

from sarl_core.demonstrations.formats.arrow.table import ArrowTable, arrow_table
from sarl_core.demonstrations.formats.opened_table import MAX_COLUMNS
from sarl_core.documents import parse_json
from sarl_core.errors import InputError, quoted
from sarl_core.limits import require_memory

_BLOCK = 2**14  # rows that are brought into their final form at once
_MOST_LINE = 2**24  # bytes
_DEEPEST = 6  # objects, or lists, within one another
_NUMBER = 8  # bytes

_DECODER = msgspec.json.Decoder()
_ENCODER = msgspec.json.Encoder()
_PERHAPS_COLON = b"\\u003"  # one that would be written as such
_UNREADABLE = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)


class _Doubled(dict[str, Any]):
    """An object in which a name stands twice.

    Attributes:
        name: The first that does.
    """

    def __init__(self, pairs: Sequence[tuple[str, Any]]) -> None:
        super().__init__(pairs)
        names = [name for name, _ in pairs]
        self.name = next(name for name in names if names.count(name) > 1)


def open_json_lines(data: memoryview) -> ArrowTable:
    """Read a file with one JSON object a line.

    Args:
        data: The whole file.

    Returns:
        The table; `car.speed` is the column of `speed` in the object `car`.

    Raises:
        InputError: If a line is something else, or a column holds values of several kinds.
    """
    return _table(_rows_of_lines(data), len(data))


def open_json(data: memoryview) -> ArrowTable:
    """Read a JSON file with a list of objects, or an object with a list for each column.

    Args:
        data: The whole file.

    Returns:
        As of `open_json_lines`.

    Raises:
        InputError: Likewise.
    """
    try:
        document = parse_json(bytes(data), finite=False, object_pairs_hook=_object)
    except InputError:
        raise
    except ValueError as error:
        try:  # lines under the name of the other format
            return open_json_lines(data)
        except InputError:
            raise InputError(f"it is not JSON ({error}); save it again") from error
    if isinstance(document, dict) and document and all(_is_column(v) for v in document.values()):
        if isinstance(document, _Doubled):
            raise InputError(
                f"the column {quoted(document.name)} stands twice; give each column its own name"
            )
        lengths = {len(values) for values in document.values()}
        if len(lengths) > 1:
            raise InputError(
                f"its columns have different lengths, from {min(lengths):,} to {max(lengths):,}; "
                "give each as many values"
            )
        document = [
            dict(zip(document, row, strict=True)) for row in zip(*document.values(), strict=True)
        ]
    if not isinstance(document, list):
        raise InputError(
            "it is no list of rows; give a list of objects, one a step, or a file of JSON lines"
        )
    blocks = (document[at : at + _BLOCK] for at in range(0, len(document), _BLOCK))
    return _table(blocks, len(data))


def _is_column(values: Any) -> bool:
    return isinstance(values, list)


def _rows_of_lines(data: memoryview) -> Iterator[list[Any]]:
    """The rows, block by block."""
    lines: list[bytes] = []
    first = 1
    start = len(codecs.BOM_UTF8) if bytes(data[:3]) == codecs.BOM_UTF8 else 0
    for match in re.compile(rb"[^\n]+").finditer(data, start):
        if match.end() - match.start() > _MOST_LINE:
            raise InputError(f"row {first + len(lines)} is too long; give one row a step")
        if match[0].strip():
            lines.append(match[0])
        if len(lines) == _BLOCK:
            yield _decoded(lines, first)
            first, lines = first + len(lines), []
    if lines:
        yield _decoded(lines, first)


def _decoded(lines: Sequence[bytes], first: int) -> list[Any]:
    text = b"\n".join(lines)
    try:
        rows = list(_DECODER.decode_lines(text))
    except _UNREADABLE:
        rows = [_row(line, number) for number, line in enumerate(lines, first)]
    # Of two values with one name, the decoder gives the last. Each name has a colon behind it; most
    # files have no other, and need not be written again to count them.
    names = sum(len(row) for row in rows if isinstance(row, dict))
    if names == text.count(b":") or _has_all_names(rows, text):
        return rows
    return [
        row if _has_all_names(row, line) else _parsed(line, number)
        for number, (line, row) in enumerate(zip(lines, rows, strict=True), first)
    ]


def _has_all_names(value: Any, text: bytes) -> bool:
    """Whether what was read from a text has all names in it; False also where that is unclear.

    Written again, it has as many colons then, those within texts among them.
    """
    if _PERHAPS_COLON in text:
        return False
    try:
        return _ENCODER.encode(value).count(b":") == text.count(b":")
    except (ValueError, OverflowError, RecursionError):  # of what only the slower reader takes
        return False


def _row(line: bytes, number: int) -> Any:
    try:
        return _DECODER.decode(line)
    except _UNREADABLE:  # NaN is, too, as many programs write it
        return _parsed(line, number)


def _parsed(line: bytes, number: int) -> Any:
    """A row by the slower reader, which takes NaN and sees a name that stands twice."""
    try:
        return parse_json(line, finite=False, object_pairs_hook=_object)
    except ValueError as error:
        raise InputError(f"row {number} is no JSON object; write one object a line") from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    held = dict(pairs)
    return held if len(held) == len(pairs) else _Doubled(pairs)


def _table(blocks: Iterator[list[Any]], size: int) -> ArrowTable:
    """The table of rows, block by block."""
    import pyarrow as pa

    tables: list[Any] = []
    names: dict[str, None] = {}
    rows = 0
    for block in blocks:
        columns: dict[str, list[Any]] = {}
        for index, row in enumerate(block):
            if not isinstance(row, dict):
                raise InputError(
                    f"row {rows + index + 1} is {quoted(row)} and no object; write one object a "
                    "row, with the names of the columns"
                )
            for name, value in _flat(row, "", rows + index + 1):
                if name not in columns:
                    columns[name] = []
                    names[name] = None
                    _require_room(names, size, rows + len(block))
                held = columns[name]
                if len(held) > index:
                    raise _two_values(name, rows + index + 1)
                held += [None] * (index - len(held))
                held.append(value)
        for held in columns.values():
            held += [None] * (len(block) - len(held))
        rows += len(block)
        tables.append(pa.table({name: _array(name, held) for name, held in columns.items()}))
    if not tables:
        raise InputError("there are no rows in it; give one object a step")
    try:
        return arrow_table(pa.concat_tables(tables, promote_options="permissive"))
    except pa.ArrowException as error:
        raise InputError(
            "a column holds numbers in some rows and something else in others; write one kind"
        ) from error


def _require_room(names: Collection[str], size: int, rows: int) -> None:
    """Refuse more columns than anybody reads, or than fit."""
    if len(names) > MAX_COLUMNS:
        raise InputError(
            f"its rows have more than {MAX_COLUMNS:,} columns between them; keep fewer"
        )
    require_memory(size + rows * len(names) * _NUMBER)


def _flat(row: dict[str, Any], before: str, number: int, depth: int = 0) -> Iterator[Any]:
    """Names and values, those of objects within it under both names."""
    if depth > _DEEPEST:
        raise _too_deep(number)
    if isinstance(row, _Doubled):
        raise _two_values(before + row.name, number)
    for key, value in row.items():
        if isinstance(value, dict):  # one without anything in it is nothing
            yield from _flat(value, f"{before}{key}.", number, depth + 1)
        else:
            yield f"{before}{key}", [None] if _holds_objects(value, number) else value


def _too_deep(number: int) -> InputError:
    return InputError(f"row {number} is nested too deeply; give each number a column of its own")


def _two_values(name: str, number: int) -> InputError:
    return InputError(
        f"row {number} has two values for the column {quoted(name)}; give each column its own name"
    )


def _holds_objects(value: Any, number: int, depth: int = 0) -> bool:
    """Whether it is a list with objects in it, which is no column of numbers."""
    if depth > _DEEPEST:
        raise _too_deep(number)
    return isinstance(value, list) and any(
        isinstance(one, dict) or _holds_objects(one, number, depth + 1) for one in value
    )


def _array(name: str, values: list[Any]) -> Any:
    import pyarrow as pa

    try:
        if any(type(value) is int and value >= 2**63 for value in values):
            return pa.array(values, pa.uint64())  # as ids that are random may be
        return pa.array(values)
    except (pa.ArrowException, ValueError, OverflowError, TypeError) as error:
        kinds = sorted({_kind(value) for value in values} - {""})
        what, advice = " and ".join(kinds), "write one kind"
        if len(kinds) == 1:
            what, advice = "numbers that are too large", "write ids as texts"
        raise InputError(f"column {quoted(name)} holds {what}; {advice}") from error


def _kind(value: Any) -> str:
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, (int, float)):
        return "numbers"
    if isinstance(value, (str, list)):
        return "texts" if isinstance(value, str) else "lists"
    return ""
