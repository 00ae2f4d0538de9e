"""Excel: the first sheet of a workbook that is not empty, read as if it had been saved as CSV."""

from __future__ import annotations

import csv
import datetime
import io
import warnings
import zipfile
from collections.abc import Iterator
from typing import Any

from sarl_core.archives import entry_content, opened
from sarl_core.demonstrations.formats.opened_table import MAX_COLUMNS
from sarl_core.demonstrations.formats.texts.csv_file import CsvTable, open_csv
from sarl_core.errors import InputError, quoted
from sarl_core.limits import require_memory

_MOST_ROWS = 1_048_576  # that a sheet of Excel can have
_COPIES = 4  # of what the parts of a workbook unpack to, as objects of Python
_BEGINNING = 4096  # bytes of a part in which a definition of entities would stand


def open_excel(data: memoryview) -> CsvTable:
    """Read the first sheet of a workbook that holds something.

    Args:
        data: The whole file.

    Returns:
        The table; formulas count as what they last came to.

    Raises:
        InputError: If openpyxl is not installed, or it is damaged, empty or unpacks to too much.
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
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and extensions that hold no values
            book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
            for sheet in book.worksheets:
                for row in _rows(sheet):
                    writer.writerow([_written(value) for value in row])
                if out.tell():
                    break
            book.close()
    except InputError:
        raise
    except Exception as error:  # whatever openpyxl meets in a damaged workbook
        raise InputError("it is damaged or no workbook; save it again, or save it as CSV") from (
            error
        )
    return open_csv(memoryview(out.getvalue().encode()))


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
