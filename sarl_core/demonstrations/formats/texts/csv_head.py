"""What stands before the first row of a CSV file: its names, its delimiter, and what is no row."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from typing import Literal, NamedTuple, cast

from sarl_core.errors import InputError, quoted

Delimiter = Literal[";", "\t", "|", ","]
_DELIMITERS: tuple[Delimiter, ...] = (";", "\t", "|", ",")  # a comma may be a decimal sign
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?|[+-]?(nan|inf|infinity)", re.I)
_FRACTION = re.compile(r"[+-]?\d*[.,]\d*(e[+-]?\d+)?|[+-]?\d+e[+-]?\d+|[+-]?(nan|inf)", re.I)
_STATED = re.compile(r'"?sep=(.)"?', re.I)  # as Excel writes it
_COMMENT = re.compile(r'\s*"?(#|%|//)')
# Quotation marks around a field, between which a line may break; others, as of inches, are text.
_FIELD = rb'(?: *+"(?:[^"]++|"")*+" *+(?=[;\t|,\r\n]|\Z)|[^\r\n;\t|,]*+)'
_LINE = re.compile(rb"(" + _FIELD + rb"(?:[;\t|,]" + _FIELD + rb")*+)(\r\n|\r|\n|\Z)")
_BREAK = re.compile(r"\r\n|\r|\n")
_MAX_LINE = 2**24  # characters of a header
_LONGEST_UNIT = 24
_AROUND = '",;| \t'  # a title, where a spreadsheet has filled its line
_LOOKED_AT = 20  # lines below the first, to tell a title from the header
_NOTHING = frozenset({"", "-", "--", "?", "na", "n/a", "#n/a", "<na>", "nan", "null", "none"})
# What stands in a row of units where there is none, or in a row of types.
_NO_UNITS = _NOTHING | frozenset(
    {"unitless", "str", "string", "text"}
    | {"int", "integer", "int64", "float", "float32", "float64", "double", "bool", "boolean"}
    | {"datetime", "date", "object", "category"}
)


@dataclass(frozen=True)
class CsvHead:
    """How a CSV file begins.

    Attributes:
        names: Of the columns, "column 1"... without a header.
        named: Whether there is a header.
        delimiter: Between two fields.
        units: Of columns, as far as a row below the header gives them.
        start: Where the first row begins, in bytes.
        line: Its line, from 1.
        comment: What the comments before the header begin with, "" where there are none.
        title: The first line of what stands above the header and is no comment, "" for nothing.
    """

    names: tuple[str, ...]
    named: bool
    delimiter: Delimiter
    units: Mapping[str, str]
    start: int
    line: int
    comment: str = ""
    title: str = ""


class _HeadLine(NamedTuple):
    text: str
    start: int
    number: int


def read_head(data: memoryview, delimiter: Delimiter | None = None) -> CsvHead:
    """Find out how a CSV file begins.

    Args:
        data: The whole file, in UTF-8.
        delimiter: Between two fields, where that is known.

    Returns:
        Its names, and where its rows begin. Lines of comments (`#`, `%`, `//`), `sep=;`, a title
        and a row of units are no rows; the last comment is the header where no other line is. A
        line that begins as such a comment is none further down either.

    Raises:
        InputError: If there is nothing in it, or its first lines cannot be read.
    """
    lines = _lines(data)
    line = next(lines, None)
    if line is None:
        raise InputError("there is nothing but white space in it; give rows of numbers")
    stated = _STATED.fullmatch(line.text)
    if stated is not None:
        if stated[1] not in _DELIMITERS:
            raise InputError(
                f"its first line says that {quoted(stated[1])} separates fields; use ; , | or tabs"
            )
        delimiter = cast("Delimiter", stated[1])
        line = next(lines, None)
    comment, sign = "", ""
    while line is not None and (marker := _COMMENT.match(line.text)):
        comment, sign = line.text[marker.end() :].strip(), marker[1]
        line = next(lines, None)
    if sign:
        lines = (one for one in lines if not one.text.lstrip().startswith(sign))
    if line is None:
        raise InputError(
            "there are no steps, only a header; give at least two observations with their actions"
        )
    ahead = [line, *islice(lines, _LOOKED_AT)]
    above = _title_lines([one.text for one in ahead], delimiter)
    title = ahead[0].text.strip(_AROUND) if above else ""
    line, lines = ahead[above], chain(ahead[above + 1 :], lines)
    delimiter = delimiter or _delimiter([one.text for one in ahead[above:]])
    first = _fields(line.text, delimiter)
    names = _fields(comment, delimiter)
    if names and len(names) == len(first) and any(map(is_number, first)):
        return CsvHead(_with_all_names(names), True, delimiter, {}, line.start, line.number, sign)
    second, third = next(lines, None), next(lines, None)
    below = _fields(second.text, delimiter) if second is not None else []
    first = _as_wide(first, below)
    if not _is_header(first, below):
        names = [f"column {number}" for number in range(1, len(first) + 1)]
        return CsvHead(tuple(names), False, delimiter, {}, line.start, line.number, sign)
    if second is None:
        raise InputError(
            "there are no steps, only a header; give at least two observations with their actions"
        )
    units: dict[str, str] = {}
    names_of_all = _with_all_names(first)
    if third is not None and _gives_units(below, _fields(third.text, delimiter), len(first)):
        units = {
            name: unit
            for name, text in zip(names_of_all, below, strict=True)
            if (unit := _unit(text))
        }
        second = third
    return CsvHead(names_of_all, True, delimiter, units, second.start, second.number, sign, title)


def _lines(data: memoryview) -> Iterator[_HeadLine]:
    """The lines in which something stands, each with what is quoted in it to its end."""
    start, number = 0, 1
    while start < len(data):
        match = _LINE.match(data, start, start + _MAX_LINE)
        if match is None or match.end() - start >= _MAX_LINE:
            raise InputError("its first line is too long; give a CSV file with one row a step")
        text = bytes(match[1]).decode()
        if text.strip():
            yield _HeadLine(text, start, number)
        start, number = match.end(), number + 1 + len(_BREAK.findall(text))


def _title_lines(texts: Sequence[str], delimiter: Delimiter | None) -> int:
    """How many of the first lines are a title or facts on the table: the header comes after them.

    They fill at most half as many fields as the header and the last of the lines do.
    """
    sign = delimiter or _delimiter(texts[-1:])
    rows = [[field for field in _fields(text, sign) if field.strip()] for text in texts]
    wide = len(rows[-1])
    header = next((place for place, row in enumerate(rows) if 2 * len(row) > wide), 0)
    names = (
        header + 1 < len(rows) and len(rows[header]) > 2 and not any(map(is_number, rows[header]))
    )
    return header if names else 0


def _delimiter(texts: Sequence[str]) -> Delimiter:
    """What separates the fields of the first line, by the number of fields in the others."""
    unquoted = re.sub(r'"(?:[^"]|"")*"', "", texts[0])
    signs = [sign for sign in _DELIMITERS if sign in unquoted] or [","]
    for sign in signs:  # a name may hold one of them that separates nothing
        names, *rows = (_fields(text, sign) for text in texts)
        # In most rows: what is wrong with the others is said where they are read.
        if 2 * sum(len(_as_wide(names, row)) == len(row) for row in rows) >= len(rows):
            return sign
    return signs[0]


def _fields(line: str, delimiter: str) -> list[str]:
    """The fields of a line; a line break in one of them, as between two words, is a space."""
    text = io.StringIO(line, newline="")
    try:
        fields = next(csv.reader(text, delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error as error:
        raise InputError("its first line cannot be read as CSV; check its quotation marks") from (
            error
        )
    return [" ".join(field.split()) if _BREAK.search(field) else field for field in fields]


def is_number(field: str) -> bool:
    """Whether a field holds a number, with a decimal point or comma."""
    return _NUMBER.fullmatch(field.strip()) is not None


def _is_header(fields: Sequence[str], below: Sequence[str]) -> bool:
    """Whether a first line holds names rather than numbers."""
    stripped = [field.strip() for field in fields]
    if any(_FRACTION.fullmatch(field) for field in stripped):
        return False  # one wrong field does not make names of the others
    if any(field and not _NUMBER.fullmatch(field) for field in stripped):
        return True
    # A data frame without names numbers its columns.
    counted = len(fields) > 1 and stripped == [str(index) for index in range(len(fields))]
    return counted and any(_FRACTION.fullmatch(field.strip()) for field in below)


def _as_wide(names: list[str], below: Sequence[str]) -> list[str]:
    """The header as wide as the rows, where only one of both ends in a delimiter."""
    if len(below) == len(names) + 1 and not below[-1].strip():
        return [*names, ""]
    return names[:-1] if len(below) == len(names) - 1 and not names[-1].strip() else names


def _with_all_names(names: Sequence[str]) -> tuple[str, ...]:
    """The names, of which only the first may be empty, as that of a counter is."""
    return tuple(
        f"unnamed: {number}" if number and not name.strip() else name
        for number, name in enumerate(names)
    )


def _gives_units(fields: Sequence[str], below: Sequence[str], columns: int) -> bool:
    """Whether a row is one of units: no number, and text where numbers follow."""
    if len(fields) != columns or len(below) != columns or any(map(is_number, fields)):
        return False
    numbers = [field for field, under in zip(fields, below, strict=True) if is_number(under)]
    telling = [field for field in numbers if field.strip().lower() not in _NOTHING]
    return bool(telling) and all(len(field.strip()) <= _LONGEST_UNIT for field in numbers)


def _unit(text: str) -> str:
    """The unit that a field of such a row gives, "" for none."""
    bare = re.sub(r"^[\[(<](.*)[\])>]$", r"\1", text.strip()).strip()
    return "" if bare.lower() in _NO_UNITS else bare
