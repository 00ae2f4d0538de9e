"""CSV: one row a step; the delimiter, the header and the decimal sign are found in the file."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO, Literal

import numpy as np

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.parquet_file import column_from_arrow, shown
from sarl_core.demonstrations.formats.tables import Column, check_names, columns_of
from sarl_core.errors import InputError

Delimiter = Literal[";", "\t", "|", ","]
_DELIMITERS: tuple[Delimiter, ...] = (";", "\t", "|", ",")  # a comma may be a decimal sign
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?|[+-]?(nan|inf|infinity)", re.I)
_FRACTION = re.compile(r"[+-]?\d*[.,]\d*(e[+-]?\d+)?|[+-]?\d+e[+-]?\d+|[+-]?(nan|inf)", re.I)
_BOMS = {
    codecs.BOM_UTF32_LE: "UTF-32",
    codecs.BOM_UTF32_BE: "UTF-32",
    codecs.BOM_UTF16_LE: "UTF-16",
    codecs.BOM_UTF16_BE: "UTF-16",
}
_MAX_LINE = 2**24  # characters of a header


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
    """

    names: tuple[str, ...]
    named: bool
    delimiter: Delimiter
    decimal: str
    body: memoryview
    first_line: int

    @property
    def metadata(self) -> Metadata:
        """CSV carries none."""
        return Metadata()

    def read(self, columns: ColumnMap) -> dict[str, Column]:
        """Numbers of the columns that a map uses.

        Args:
            columns: The map.

        Returns:
            A column for each name.

        Raises:
            InputError: If a row has another length than the first, or a field is no number.
        """
        import pyarrow as pa

        try:
            # Straight to float32: by way of float64 a few numbers would be rounded twice.
            table = self._parse(columns.used, dict.fromkeys(columns.observations, pa.float32()))
        except pa.ArrowInvalid:
            try:
                table = self._parse(columns.used, {})
            except pa.ArrowInvalid as error:
                raise self._explained(columns.used) from error
        texts = [
            name
            for name in columns.used
            if not (
                pa.types.is_floating(kind := table.schema.field(name).type)
                or pa.types.is_integer(kind)
                or pa.types.is_boolean(kind)
                or pa.types.is_null(kind)
            )
        ]
        if texts:
            raise self._explained(texts)
        return {name: column_from_arrow(name, table.column(name)) for name in columns.used}

    def _parse(self, used: Sequence[str], types: dict[str, Any]) -> Any:
        import pyarrow as pa
        import pyarrow.csv

        return pyarrow.csv.read_csv(
            pa.BufferReader(pa.py_buffer(self.body)),
            read_options=pyarrow.csv.ReadOptions(column_names=list(self.names)),
            parse_options=pyarrow.csv.ParseOptions(delimiter=self.delimiter),
            convert_options=pyarrow.csv.ConvertOptions(
                null_values=[""],
                strings_can_be_null=True,
                decimal_point=self.decimal,
                include_columns=list(used),
                column_types=types,
            ),
        )

    def _explained(self, suspects: Sequence[str]) -> InputError:
        """Read row by row what could not be read at once, to say where it fails."""
        places = [(self.names.index(name), name) for name in suspects]
        for number, (line, row) in enumerate(self._rows(), start=1):
            if len(row) != len(self.names):
                return InputError(
                    f"row {number} (line {line}) has {len(row)} fields in place of "
                    f"{len(self.names)}; mend that row"
                )
            for index, name in places:
                if not _readable(row[index], self.decimal):
                    return InputError(
                        f"column {name!r} holds {shown(row[index])} in row {number} (line {line}), "
                        "which is no number; mend that row"
                    )
        return InputError("it cannot be read as CSV; check its quotation marks and delimiters")

    def _rows(self) -> Iterator[tuple[int, list[str]]]:
        text = io.TextIOWrapper(io.BytesIO(self.body), encoding="utf-8", newline="")
        reader = csv.reader(text, delimiter=self.delimiter)
        try:
            for row in reader:
                if row:
                    yield self.first_line - 1 + reader.line_num, row
        except csv.Error:
            return


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
    skipped = re.match(rb"\s*", data)
    start = skipped.end() if skipped is not None else 0
    line = 1 + bytes(data[:start]).count(b"\n")
    head, end = _line(data, start)
    if not head:
        raise InputError("there is nothing but white space in it; give rows of numbers")
    delimiter = like.delimiter if like is not None else _delimiter(head)
    fields = _fields(head, delimiter)
    second, _ = _line(data, end)
    named = _is_header(fields, _fields(second, delimiter) if second else [])
    if named:
        names = tuple(fields)
        check_names(names)
    else:
        names = tuple(f"column {number}" for number in range(1, len(fields) + 1))
        check_names(names)
        end = start
    body = data[end:]
    if not re.search(rb"\S", body):
        raise InputError(
            "there are no steps, only a header; give at least two observations with their actions"
        )
    decimal = like.decimal if like is not None else _decimal(body, delimiter)
    return CsvTable(names, named, delimiter, decimal, body, line + named)


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

    columns: dict[str, Any] = columns_of(demonstrations)
    for name, values in columns.items():
        if "\n" in name or "\r" in name:
            raise InputError(
                f"the column {name!r} has a line break in its name, which CSV cannot "
                "hold; save it as .parquet"
            )
        if name.startswith("action") and values.dtype.kind == "f":
            # Their type is found out on reading: as float64, with a point that says it is one.
            columns[name] = _decimals(values.astype(np.float64))
    pyarrow.csv.write_csv(pa.table(columns), out, pyarrow.csv.WriteOptions(quoting_style="needed"))


def _decimals(values: Any) -> Any:
    import pyarrow as pa

    whole = bool(np.all(values == np.floor(values)))
    return pa.array([repr(value) for value in values.tolist()]) if whole else values


def _as_text(data: memoryview) -> memoryview:
    """The file without its byte order mark, if it is text in UTF-8."""
    for mark, encoding in _BOMS.items():
        if bytes(data[: len(mark)]) == mark:
            raise InputError(f"it is text in {encoding}; save it as UTF-8")
    if bytes(data[:3]) == codecs.BOM_UTF8:
        data = data[3:]
    codes = np.frombuffer(data, dtype=np.uint8)
    if codes.size and codes.min() == 0:
        raise InputError("it is no text; give a CSV file in UTF-8")
    if codes.size == 0 or codes.max() < 128:  # ASCII, which is UTF-8; decoding would take longer
        return data
    try:
        codecs.utf_8_decode(data, "strict", True)
    except UnicodeDecodeError as error:
        line = 1 + bytes(data[: error.start]).count(b"\n")
        raise InputError(
            f"it is not UTF-8 in line {line} (byte 0x{data[error.start]:02x}); save it as UTF-8"
        ) from None
    return data


def _line(data: memoryview, start: int) -> tuple[str, int]:
    """The line that starts somewhere, and where the next one starts."""
    match = re.compile(rb"([^\r\n]*)(\r\n|\r|\n|$)").match(data, start, start + _MAX_LINE)
    if match is None or match.end() - start >= _MAX_LINE:
        raise InputError("its first line is too long; give a CSV file with one row a step")
    return bytes(match[1]).decode(), match.end()


def _delimiter(head: str) -> Delimiter:
    unquoted = re.sub(r'"(?:[^"]|"")*"', "", head)
    return next((sign for sign in _DELIMITERS if sign in unquoted), ",")


def _fields(line: str, delimiter: str) -> list[str]:
    try:
        fields = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error as error:
        raise InputError("its first line cannot be read as CSV; check its quotation marks") from (
            error
        )
    if fields and fields[0].startswith("#"):  # as numpy.savetxt writes a header
        fields[0] = fields[0][1:].lstrip()
    return fields


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


def _decimal(body: memoryview, delimiter: str) -> str:
    """A comma if there are commas and no points, and the comma does not separate fields."""
    if delimiter == "," or re.search(rb",", body) is None:
        return "."
    return "," if re.search(rb"\.", body) is None else "."


def _readable(field: str, decimal: str) -> bool:
    text = field.strip().replace(decimal, ".")
    if text == "" or text.lower() in ("true", "false"):
        return True
    return _NUMBER.fullmatch(text) is not None and "," not in text
