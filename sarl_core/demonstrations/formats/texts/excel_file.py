"""Excel: the sheet of a workbook that holds the table, read as if it had been saved as CSV."""

from __future__ import annotations

import csv
import datetime
import io
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from sarl_core.archives import entry_content, opened
from sarl_core.demonstrations.formats.columns import guess_roles, listed
from sarl_core.demonstrations.formats.opened_table import MAX_COLUMNS
from sarl_core.demonstrations.formats.texts.csv_file import CsvTable, open_csv
from sarl_core.demonstrations.formats.texts.csv_head import is_number
from sarl_core.errors import InputError, quoted
from sarl_core.limits import require_memory

_MOST_ROWS = 1_048_576  # that a sheet of Excel can have
_COPIES = 4  # of what the parts of a workbook unpack to, as objects of Python
_BEGINNING = 4096  # bytes of a part in which a definition of entities would stand


def open_excel(data: memoryview) -> CsvTable:
    """Read the sheet of a workbook that holds the table, whatever stands before it.

    Args:
        data: The whole file.

    Returns:
        The table; formulas count as what they last came to.

    Raises:
        InputError: If openpyxl is not installed, it is damaged, empty or unpacks to too much, or
            several of its sheets may be meant.
    """
    try:
        import openpyxl
    except ImportError as error:
        raise InputError(
            "Excel files are read by a package that is not installed; save it as CSV, or install "
            "'sarl-explorer[excel]'"
        ) from error
    with opened(data) as archive:
        require_memory(len(data) + _COPIES * sum(info.file_size for info in archive.infolist()))
        for info in archive.infolist():
            _refuse_entities(archive, info)
    sheets: dict[str, str] = {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions that hold no values
            book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
            for sheet in book.worksheets:
                if text := _as_csv(sheet):
                    sheets[str(sheet.title)] = text
            book.close()
    except InputError:
        raise
    except Exception as error:  # whatever openpyxl meets in a damaged workbook
        raise InputError("it is damaged or no workbook; save it again, or save it as CSV") from (
            error
        )
    return _table_of(sheets)


def _table_of(sheets: Mapping[str, str]) -> CsvTable:
    """The one table among sheets that hold something."""
    tables = {name: table for name, text in sheets.items() if (table := _table(text)) is not None}
    for is_likelier in (_has_action, _has_numbers, _is_wide):
        if len(tables) > 1:
            likelier = {name: table for name, table in tables.items() if is_likelier(table)}
            tables = likelier or tables
    if len(tables) > 1:
        raise InputError(
            f"it has tables in {len(tables)} sheets, {listed(tables)}, any of which may be meant; "
            "leave one of them in the workbook, or save that one as CSV"
        )
    if not tables:
        return open_csv(memoryview(next(iter(sheets.values()), "").encode()))
    ((name, table),) = tables.items()
    others = [one for one in sheets if one != name]
    if not others:
        return table
    note = f"the sheet {quoted(name)} was read, and {listed(others)} beside it {{}} not"
    return replace(table, notes=(note.format("was" if len(others) == 1 else "were"),))


def _table(text: str) -> CsvTable | None:
    """A sheet with a header and at least two columns; None if it is something else."""
    try:
        table = open_csv(memoryview(text.encode()))
    except InputError:
        return None
    return table if table.named and len(table.names) > 1 else None


def _has_action(table: CsvTable) -> bool:
    return bool(guess_roles(table.names).columns.actions)


def _has_numbers(table: CsvTable) -> bool:
    """Whether its first row holds any, as lists of facts seldom do."""
    first = bytes(table.body).decode().splitlines()[:1]
    fields = next(csv.reader(first, delimiter=table.delimiter), [])
    return any(map(is_number, fields))


def _is_wide(table: CsvTable) -> bool:
    """Whether it has more columns than a fact and what it is called."""
    return len(table.names) > 2


def _as_csv(sheet: Any) -> str:
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    for row in _rows(sheet):
        writer.writerow([_written(value) for value in row])
    return out.getvalue()


def _refuse_entities(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> None:
    """Refuse a part that defines entities, a few of which stand for any amount of text."""
    start = entry_content(archive, info, _BEGINNING)
    if b"<!DOCTYPE" in start or b"<!ENTITY" in start:
        raise InputError(
            f"its part {quoted(info.filename)} defines entities, which no workbook needs; save it "
            "again"
        )


def _rows(sheet: Any) -> Iterator[tuple[Any, ...]]:
    """The rows down to the last that is not empty, without the columns right of the last."""
    sheet.reset_dimensions()
    width = empty = 0
    for number, row in enumerate(sheet.iter_rows(values_only=True)):
        if number >= _MOST_ROWS:
            raise InputError("it says that it has more rows than Excel can; save it again")
        cells = _stripped(row)
        if len(cells) > MAX_COLUMNS:
            raise InputError(
                f"there are more than {MAX_COLUMNS:,} columns in it; keep fewer, or save it as CSV"
            )
        if not cells:
            empty += 1 if width else 0
            continue
        for _ in range(empty):
            yield (None,) * width
        width, empty = width or len(cells), 0
        yield (*cells, *(None,) * (width - len(cells)))


def _stripped(row: tuple[Any, ...]) -> tuple[Any, ...]:
    end = len(row)
    while end and row[end - 1] is None:
        end -= 1
    return row[:end]


def _written(value: Any) -> str:
    """A cell as CSV has it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (datetime.datetime, datetime.date, datetime.time)):
        return value.isoformat()
    return repr(value) if isinstance(value, float) else str(value)
