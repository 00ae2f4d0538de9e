"""CSV: one row a step; the delimiter, the header and the decimal sign are found in the file."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.fields import TRUTH
from sarl_core.demonstrations.formats.arrow.parquet_file import (
    column_from_arrow,
    is_text,
    times_from_arrow,
)
from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.opened_table import TableColumn, as_float32, check_names
from sarl_core.demonstrations.formats.saved_columns import columns_in_words
from sarl_core.demonstrations.formats.texts.csv_head import Delimiter, read_head
from sarl_core.demonstrations.requirements import without_fraction
from sarl_core.errors import InputError, quoted
from sarl_core.limits import require_memory, table_memory

_UTF_32 = (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)
_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_MOST_DIFFERENT = 1_000  # texts of a column that are kept once each
_BLOCK = 2**22  # bytes that are looked through at once
_FEED, _RETURN = b"\n\r"
# What Arrow's parser of numbers takes beside numbers, 0x and nan(, wherever it stands; looked for
# by their ends, as digits are everywhere.
_NO_NUMBERS = re.compile(rb"[xX(](?:(?<=0[xX])|(?<=[nN][aA][nN]\())")
_NOTHING = ("", "NA", "N/A", "n/a", "#N/A", "<NA>", "NaN", "nan", "NAN", "null", "NULL", "Null")
# A number, and a field that holds one, nothing, or a truth value; as Arrow's own matcher has it.
_NUMBER_TEXT = r"([+-]?(\d+(POINT\d*)?|POINT\d+)(e[+-]?\d+)?|[+-]?(nan|inf|infinity))"
_ID = re.compile(r"[+-]?\d+")
_NUMBER_FIELD = rf"^\s*({_NUMBER_TEXT}|true|false|na|#?n/a|<na>|null|)\s*$"


@dataclass(frozen=True)
class CsvTable:
    """A CSV file whose form has been found out.

    Attributes:
        names: Names of the columns, "column 1"... without a header.
        named: Whether there is a header.
        delimiter: Between two fields.
        decimal: The decimal sign.
        body: The file from its first data row on.
        first_line: Line of the first data row, from 1.
        units: Of columns, where a row below the header gives them.
        title: What stands above the header and is no comment, "" for nothing.
        notes: Sentences on where it was taken from.
    """

    names: tuple[str, ...]
    named: bool
    delimiter: Delimiter
    decimal: str
    body: memoryview
    first_line: int
    units: Mapping[str, str] = field(default_factory=dict)
    title: str = ""
    notes: tuple[str, ...] = ()

    @property
    def metadata(self) -> Metadata:
        """CSV carries units at most."""
        notes = [*self.notes]
        if self.title:
            notes.append(f"the lines above the header were not read, {quoted(self.title)} first")
        if self.units:
            name, unit = next(iter(self.units.items()))
            notes.append(
                f"the row below the header gives units, as {quoted(unit)} for {quoted(name)}"
            )
        return Metadata(notes=tuple(notes), column_units=self.units)

    def read(self, columns: ColumnMap) -> dict[str, TableColumn]:
        """Numbers of the columns that a map uses.

        Args:
            columns: The map.

        Returns:
            A column for each name.

        Raises:
            InputError: If a row has another length than the first, or a field is no number.
        """
        import pyarrow as pa

        if not columns.used:  # Arrow would take no column for all of them
            return {}
        # Numbers take up to 8 bytes each on the way, whatever they take as text.
        rows = _count_lines(self.body)
        require_memory(len(self.body) + table_memory(rows, 0, len(columns.used)))
        try:
            # Straight to float32: by way of float64 a few numbers would be rounded twice.
            table = self._parse(columns.used, dict.fromkeys(columns.observations, pa.float32()))
        except pa.ArrowInvalid:
            try:
                table = self._parse(columns.used, {})
            except pa.ArrowInvalid as error:
                self._require_numbers(columns.used)
                raise InputError(
                    "it cannot be read as CSV; check its quotation marks and delimiters"
                ) from error
        kinds = {name: table.schema.field(name).type for name in columns.used}
        texts = {name for name, kind in kinds.items() if is_text(kind)}
        # What Arrow takes for a number and a person does not: 0x10, nan(1).
        if _NO_NUMBERS.search(self.body):
            self._require_numbers([name for name in columns.used if name not in texts])
        for name in texts - {columns.time}:
            self._require_words(name, table.column(name))
        spelled = self._spelled([one for one in columns.actions if pa.types.is_boolean(kinds[one])])
        if columns.episode is not None and pa.types.is_floating(kinds[columns.episode]):
            spelled |= self._ids(columns.episode)
        # Each column is given back as soon as its numbers stand in one piece.
        left = dict(zip(columns.used, table.columns, strict=True))
        del table
        read = {
            name: (times_from_arrow if name == columns.time else column_from_arrow)(
                name, left.pop(name)
            )
            for name in columns.used
        } | spelled
        return {
            name: as_float32(column) if name in columns.observations else column
            for name, column in read.items()
        }

    def _parse(self, used: Sequence[str], types: dict[str, Any]) -> Any:
        import pyarrow as pa
        import pyarrow.csv

        return pyarrow.csv.read_csv(
            pa.BufferReader(pa.py_buffer(self.body)),
            read_options=pyarrow.csv.ReadOptions(column_names=list(self.names)),
            parse_options=pyarrow.csv.ParseOptions(delimiter=self.delimiter),
            convert_options=pyarrow.csv.ConvertOptions(
                null_values=list(_NOTHING),
                strings_can_be_null=True,
                auto_dict_encode=True,  # a word stands there once, however often it occurs
                auto_dict_max_cardinality=_MOST_DIFFERENT,
                decimal_point=self.decimal,
                include_columns=list(used),
                column_types=types,
            ),
        )

    def _require_words(self, name: str, column: Any) -> None:
        """Refuse a column of texts in which numbers stand: one of the two is a slip."""
        import pyarrow.compute as pc

        texts = pc.cast(pc.unique(column), "large_string")
        pattern = rf"^\s*{_NUMBER_TEXT}\s*$".replace("POINT", re.escape(self.decimal))
        if pc.any(pc.match_substring_regex(texts, pattern, ignore_case=True)).as_py():
            self._require_numbers([name])
            raise InputError(
                f"column {quoted(name)} holds both numbers and true or false; write numbers"
            )

    def _spelled(self, names: Sequence[str]) -> dict[str, TableColumn]:
        """Columns of true and false as somebody has written those, where it was always alike."""
        import pyarrow as pa

        if not names:
            return {}
        table = self._parse(names, dict.fromkeys(names, pa.large_string()))
        read = {name: column_from_arrow(name, table.column(name)) for name in names}
        return {
            name: column
            for name, column in read.items()
            if len(set(map(str.lower, column.words)) & {*TRUTH}) == len(column.words)
        }

    def _ids(self, name: str) -> dict[str, TableColumn]:
        """A column of whole numbers too long for any type of numbers, as texts."""
        import pyarrow as pa

        column = column_from_arrow(name, self._parse([name], {name: pa.large_string()}).column(0))
        return {name: column} if column.words and all(map(_ID.fullmatch, column.words)) else {}

    def _require_numbers(self, suspects: Sequence[str]) -> None:
        """Say in which row a file is wrong, block by block and with nothing taken for a number."""
        import pyarrow as pa
        import pyarrow.compute as pc
        import pyarrow.csv

        wrong: list[Any] = []

        def keep(row: Any) -> Literal["error"]:
            wrong.append(row)
            return "error"

        pattern = _NUMBER_FIELD.replace("POINT", re.escape(self.decimal))
        row = 0
        try:
            for block in pyarrow.csv.open_csv(
                pa.BufferReader(pa.py_buffer(self.body)),
                # In one thread, which knows the numbers of the rows.
                read_options=pyarrow.csv.ReadOptions(
                    column_names=list(self.names), use_threads=False
                ),
                parse_options=pyarrow.csv.ParseOptions(
                    delimiter=self.delimiter, invalid_row_handler=keep
                ),
                convert_options=pyarrow.csv.ConvertOptions(
                    include_columns=list(suspects),
                    column_types=dict.fromkeys(suspects, pa.large_string()),
                    strings_can_be_null=False,
                ),
            ):
                misfits: list[tuple[int, str, str]] = []
                for name in suspects:
                    fields = block.column(name)
                    matches = pc.match_substring_regex(fields, pattern, ignore_case=True)
                    place = pc.index(matches, False).as_py()
                    if place >= 0:
                        misfits.append((place, name, fields[place].as_py()))
                if misfits:
                    place, name, field = min(misfits)
                    raise InputError(
                        f"column {quoted(name)} holds {quoted(field)} in "
                        f"{self._place(row + place + 1)}, which is no number; mend that row"
                    )
                row += block.num_rows
        except pa.ArrowInvalid as error:
            if wrong and wrong[0].number is not None:
                count = wrong[0].actual_columns
                raise InputError(
                    f"{self._place(wrong[0].number)} has {count} field{'s' if count > 1 else ''} "
                    f"in place of {len(self.names)}; mend that row"
                ) from error

    def _place(self, row: int) -> str:
        """A row (from 1) for a sentence, with its line where rows and lines go together."""
        if re.search(rb'"', self.body):
            return f"row {row}"
        return f"row {row} (line {self.first_line - 1 + _line_of(self.body, row)})"


class _Lines(NamedTuple):
    """Where lines start and end in a part of a file.

    Attributes:
        starts: Where a line that is not empty starts.
        ends: Where a line ends, in its first sign: a return and a feed are one end.
    """

    starts: NDArray[np.bool_]
    ends: NDArray[np.bool_]


def _lines(data: memoryview) -> Iterator[_Lines]:
    """Part by part, so that a large file takes little memory."""
    codes = np.frombuffer(data, dtype=np.uint8)
    before = _FEED
    for start in range(0, len(codes), _BLOCK):
        part = codes[start : start + _BLOCK]
        previous = np.concatenate([np.array([before], dtype=np.uint8), part[:-1]])
        feeds, returned = part == _FEED, previous == _RETURN
        breaks = feeds | (part == _RETURN)
        yield _Lines(~breaks & (returned | (previous == _FEED)), breaks & ~(feeds & returned))
        before = int(part[-1])


def _count_lines(data: memoryview) -> int:
    """As many as there are rows, or more."""
    return 1 + sum(int(np.count_nonzero(part.ends)) for part in _lines(data))


def _line_of(data: memoryview, row: int) -> int:
    """The line (from 1) of a row (from 1): a line with nothing in it is no row."""
    line, rows = 1, 0
    for part in _lines(data):
        starts = np.flatnonzero(part.starts)
        if rows + len(starts) >= row:
            return line + int(np.count_nonzero(part.ends[: starts[row - rows - 1]]))
        line, rows = line + int(np.count_nonzero(part.ends)), rows + len(starts)
    return line


def open_csv(data: memoryview, *, like: CsvTable | None = None) -> CsvTable:
    """Find out the form of a CSV file.

    Args:
        data: The whole file.
        like: A table with the same delimiter and decimal sign, as the other file of a pair.

    Returns:
        The table, not yet read.

    Raises:
        InputError: If it is not text, not UTF-8, has no rows, too many columns, or two of one
            name.
    """
    data = _as_text(data)
    head = read_head(data, like.delimiter if like is not None else None)
    check_names(head.names)
    body = _without_comments(data[head.start :], head.comment)
    decimal = like.decimal if like is not None else _decimal(body, head.delimiter)
    return CsvTable(
        head.names,
        head.named,
        head.delimiter,
        decimal,
        body,
        head.line,
        dict(head.units),
        head.title,
    )


def write_csv(demonstrations: Demonstrations, out: BinaryIO) -> None:
    """Write demonstrations with a header and commas; CSV has no place for the metadata.

    Args:
        demonstrations: To write.
        out: Where to.

    Raises:
        InputError: If a name has a line break.
    """
    import pyarrow as pa
    import pyarrow.csv

    columns = columns_in_words(demonstrations)
    for name, values in columns.items():
        if "\n" in name or "\r" in name:
            raise InputError(
                f"the column {name!r} has a line break in its name, which CSV cannot "
                "hold; save it as .parquet"
            )
        if isinstance(values, list):
            _require_plain_words(name, values)
            continue
        if name.startswith("action") and values.dtype.kind == "f":
            # Their type is found out on reading: as float64, with a point that says it is one.
            columns[name] = _decimals(values.astype(np.float64))
    pyarrow.csv.write_csv(pa.table(columns), out, pyarrow.csv.WriteOptions(quoting_style="needed"))


def _require_plain_words(name: str, texts: Sequence[str]) -> None:
    """Refuse words that would be read as something else."""
    words = dict.fromkeys(texts)
    numbers = re.compile(_NUMBER_FIELD.replace("POINT", "[.,]"), re.IGNORECASE)
    if {*map(str.lower, words)} <= {*TRUTH}:
        return
    odd = next((one for one in words if numbers.match(one) or "\n" in one or "\r" in one), None)
    if odd is not None:
        raise InputError(
            f"the column {name!r} holds {quoted(odd)} as a word, which would be read from CSV as "
            "something else; save it as .parquet"
        )


def _decimals(values: Any) -> Any:
    import pyarrow as pa

    whole = bool(without_fraction(values).all())
    return pa.array([repr(value) for value in values.tolist()]) if whole else values


def _as_text(data: memoryview) -> memoryview:
    """The file in UTF-8 and without its byte order mark; it may have been in UTF-16, as Excel's."""
    mark = bytes(data[:4])
    if mark in _UTF_32:
        raise InputError("it is text in UTF-32; save it as UTF-8")
    if mark.startswith(_UTF_16):
        require_memory(4 * len(data))  # as it stands, as text, and in UTF-8
        try:
            return memoryview(str(data, "utf-16").encode())
        except UnicodeDecodeError as error:
            raise InputError("it is damaged text in UTF-16; save it as UTF-8") from error
    if bytes(data[:3]) == codecs.BOM_UTF8:
        data = data[3:]
    codes = np.frombuffer(data, dtype=np.uint8)
    if codes.size and codes.min() == 0:
        raise InputError("it is no text; give a CSV file in UTF-8")
    if codes.size == 0 or codes.max() < 128:  # ASCII, which is UTF-8; decoding would take longer
        return data
    decoder = codecs.getincrementaldecoder("utf-8")()
    for start in range(0, len(data), _BLOCK):
        waiting = len(decoder.getstate()[0])
        try:
            decoder.decode(data[start : start + _BLOCK], start + _BLOCK >= len(data))
        except UnicodeDecodeError as error:
            wrong = start - waiting + error.start
            line = _count_lines(data[:wrong])
            raise InputError(
                f"it is not UTF-8 in line {line} (byte 0x{data[wrong]:02x}); save it as UTF-8"
            ) from None
    return data


def _without_comments(body: memoryview, sign: str) -> memoryview:
    """The rows with nothing in the lines that are comments, so that lines keep their numbers.

    A file with quotation marks stays as it is: a text of several lines may stand between them.
    """
    pattern = re.compile(rb"(?m)^[ \t]*" + re.escape(sign.encode()) + rb"[^\r\n]*")
    if not sign or re.search(rb'"', body) or pattern.search(body) is None:
        return body
    return memoryview(pattern.sub(b"", bytes(body)))


def _decimal(body: memoryview, delimiter: str) -> str:
    """A comma if numbers hold commas and none a point, and the comma does not separate fields.

    Points of dates (21.03.2024), versions and sentences say nothing.
    """
    if delimiter == "," or re.search(rb",", body) is None:
        return "."
    return "," if re.search(rb"\.", body) is None or not _holds_point(body, delimiter) else "."


def _holds_point(body: memoryview, delimiter: str) -> bool:
    """Whether some field is a number with a decimal point."""
    sign = re.escape(delimiter.encode())
    number = rb"[+-]?(?:\d+\.\d*|\.\d+)(?:[eE][+-]?\d+)?"
    field = rb'(?:^|(?<=[\r\n"]|' + sign + rb")) *" + number + rb' *(?=[\r\n"]|' + sign + rb"|$)"
    return re.search(field, body) is not None
