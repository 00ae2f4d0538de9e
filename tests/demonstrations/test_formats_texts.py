"""Tables in other files than CSV and Parquet: JSON, TSV, Arrow, Excel, and any text under gzip."""

from __future__ import annotations

import builtins
import datetime
import gzip
import io
import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet
import pytest

from sarl_core.demonstrations.formats import read_demonstrations, table_columns
from sarl_core.errors import InputError
from sarl_core.limits import READ_LIMIT

N = 30
ROWS = [
    {"episode": i // 10, "obs_x": i / 8, "obs_y": -i / 4, "action": i % 2, "reward": 1}
    for i in range(N)
]


def text(separator: str) -> bytes:
    rows = [list(ROWS[0]), *(row.values() for row in ROWS)]
    return "\n".join(separator.join(map(str, row)) for row in rows).encode()


def lines(rows: list[Any]) -> bytes:
    return "".join(json.dumps(row) + "\n" for row in rows).encode()


def arrow(make: Callable[..., Any] = pa.ipc.new_file, compression: str | None = None) -> bytes:
    table = pa.Table.from_pylist(ROWS)
    out = io.BytesIO()
    options = pa.ipc.IpcWriteOptions(compression=compression)
    with make(out, table.schema, options=options) as writer:
        writer.write_table(table, max_chunksize=7)
    return out.getvalue()


def feather() -> bytes:
    out = io.BytesIO()
    pyarrow.feather.write_feather(pa.Table.from_pylist(ROWS), out)
    return out.getvalue()


def workbook(*rows: Any, empty_sheet: bool = False) -> bytes:
    book = openpyxl.Workbook()
    sheet = book.active
    if empty_sheet:
        sheet = book.create_sheet("data")
    for row in rows or (list(ROWS[0]), *(list(row.values()) for row in ROWS)):
        sheet.append(list(row))
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


FILES: dict[str, tuple[str, Callable[[], bytes]]] = {
    "TSV": ("demo.tsv", lambda: text("\t")),
    "CSV under gzip": ("demo.csv.gz", lambda: gzip.compress(text(","))),
    "TSV under gzip": ("demo.tsv.gz", lambda: gzip.compress(text("\t"))),
    "gzip in two members": (
        "demo.csv.gz",
        lambda: gzip.compress(text(",")[:100]) + gzip.compress(text(",")[100:]),
    ),
    "JSON lines": ("demo.jsonl", lambda: lines(ROWS)),
    "JSON lines of another ending": ("demo.ndjson", lambda: lines(ROWS)),
    "JSON lines with a mark and empty lines": (
        "demo.jsonl",
        lambda: b"\xef\xbb\xbf" + lines(ROWS).replace(b"\n", b"\r\n\r\n"),
    ),
    "JSON lines under gzip": ("demo.jsonl.gz", lambda: gzip.compress(lines(ROWS))),
    "JSON lines named JSON": ("demo.json", lambda: lines(ROWS)),
    "a JSON list": ("demo.json", lambda: json.dumps(ROWS, indent=1).encode()),
    "JSON by columns": (
        "demo.json",
        lambda: json.dumps({key: [row[key] for row in ROWS] for key in ROWS[0]}).encode(),
    ),
    "an Arrow file": ("demo.arrow", arrow),
    "an Arrow stream": ("demo.arrow", lambda: arrow(pa.ipc.new_stream)),
    "an Arrow file under zstd": ("demo.ipc", lambda: arrow(compression="zstd")),
    "an Arrow stream under lz4": (
        "demo.arrow",
        lambda: arrow(pa.ipc.new_stream, compression="lz4"),
    ),
    "Feather": ("demo.feather", feather),
    "Excel": ("demo.xlsx", workbook),
    "Excel with an empty sheet": ("demo.xlsx", lambda: workbook(empty_sheet=True)),
}


@pytest.mark.parametrize("name", FILES)
def test_the_same_rows_are_the_same_demonstrations(name: str) -> None:
    file_name, content = FILES[name]
    read = read_demonstrations(content(), file_name)
    assert read.digest == read_demonstrations(text(","), "demo.csv").digest
    assert table_columns(content(), file_name) == tuple(ROWS[0])


def test_objects_and_lists_in_json_are_columns() -> None:
    rows = [
        {"obs": {"pos": [i, i / 2], "speed": i / 4}, "action": i % 2, "info": {}, "log": [{"a": 1}]}
        for i in range(N)
    ]
    read = read_demonstrations(lines(rows), "demo.jsonl")
    assert read.feature_names == ("pos_0", "pos_1", "speed")
    assert read.observations[4].tolist() == [4, 2, 1]


def test_keys_that_come_later_are_empty_before() -> None:
    rows: list[dict[str, Any]] = [dict(row) for row in ROWS]
    rows[20]["obs_z"] = 1.5
    with pytest.raises(InputError, match=r"column 'obs_z' is empty .* in 29 of 30 rows"):
        read_demonstrations(lines(rows), "demo.jsonl")
    rows[20] = dict(ROWS[20], remark="late")
    assert len(read_demonstrations(lines(rows), "demo.jsonl")) == N


def test_whole_numbers_and_fractions_of_a_column_may_stand_far_apart() -> None:
    rows = [{"obs_x": 1 if i < 20_000 else 1.5, "action": i % 2} for i in range(20_010)]
    read = read_demonstrations(lines(rows), "demo.jsonl")
    assert read.observations[[0, -1], 0].tolist() == [1, 1.5]


def changed(row: int, **values: Any) -> bytes:
    rows: list[dict[str, Any]] = [dict(one) for one in ROWS]
    rows[row] |= values
    return lines(rows)


def bomb_of_entities() -> bytes:
    content = workbook()
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as before, zipfile.ZipFile(out, "w") as after:
        for info in before.infolist():
            part = before.read(info)
            if info.filename.endswith("sheet1.xml"):
                part = b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa">]>' + part
            after.writestr(info.filename, part)
    return out.getvalue()


def far_row() -> bytes:
    """A sheet whose only other row says that it is the one in a billion."""
    out = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(workbook((1, 2), (3, 4)))) as before,
        zipfile.ZipFile(out, "w") as after,
    ):
        for info in before.infolist():
            part = before.read(info)
            if info.filename.endswith("sheet1.xml"):
                part = part.replace(b'<row r="2"', b'<row r="999999999"')
            after.writestr(info.filename, part)
    return out.getvalue()


def compressed_arrow(size: int) -> bytes:
    """Zeros that take little room, and unpack to a lot."""
    table = pa.table({"obs_x": np.zeros(size), "action": np.zeros(size, np.int8)})
    out = io.BytesIO()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_file(out, table.schema, options=options) as writer:
        writer.write_table(table)
    return out.getvalue()


def dictionary_arrow() -> bytes:
    """A text of ten million signs that stands in each of a hundred thousand rows."""
    codes = pa.array(np.zeros(100_000, np.int32))
    column = pa.DictionaryArray.from_arrays(codes, pa.array(["x" * 10**7]))
    table = pa.table({"obs_x": column, "obs_y": np.arange(1e5), "action": np.zeros(100_000, int)})
    out = io.BytesIO()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_stream(out, table.schema, options=options) as writer:
        writer.write_table(table)
    return out.getvalue()


def no_values_arrow() -> bytes:
    """Rows without a value take no room at all."""
    table = pa.table({"obs_x": pa.nulls(10**8), "action": pa.nulls(10**8)})
    out = io.BytesIO()
    with pa.ipc.new_stream(out, table.schema) as writer:
        writer.write_table(table)
    return out.getvalue()


def torn_offsets() -> bytes:
    """A text that says that it ends beyond the file."""
    table = pa.table({"obs_x": ["a", "b"], "action": [0, 1]})
    out = io.BytesIO()
    with pa.ipc.new_stream(out, table.schema) as writer:
        writer.write_table(table)
    offsets = np.array([0, 1, 2], np.int32).tobytes()
    return out.getvalue().replace(offsets, np.array([0, 1, 2**30], np.int32).tobytes())


BAD: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "no object": ("demo.jsonl", lambda: lines(ROWS) + b"[1, 2]\n", "row 31 is a list and no obj"),
    "no JSON": ("demo.jsonl", lambda: lines(ROWS) + b"{\n", "row 31 is no JSON object"),
    "no text": ("demo.jsonl", lambda: b"\xff\xfe" * 9, "row 1 is no JSON object"),
    "NaN": ("demo.jsonl", lambda: changed(4, obs_x=float("nan")), "NaN.* the first of them row 5"),
    "two kinds": ("demo.jsonl", lambda: changed(4, obs_x="left"), "'obs_x' holds numbers and te"),
    "ragged lists": (
        "demo.jsonl",
        lambda: lines([{"obs": [1, 2], "action": 0}, {"obs": [1], "action": 1}]),
        "'obs' holds a list of 1 in row 2, and one of 2 in the first",
    ),
    "two of one name": (
        "demo.jsonl",
        lambda: lines([{"obs": {"x": 1}, "obs.x": 2, "action": 0}] * 2),
        "two values for the column 'obs.x'",
    ),
    "a name twice": (
        "demo.jsonl",
        lambda: lines(ROWS) + b'{"episode": 3, "obs_x": 1, "obs_x": 2, "action": 0}\n',
        "row 31 has two values for the column 'obs_x'; give each column its own name",
    ),
    "a name twice, far down and beside texts with colons": (
        "demo.jsonl",
        lambda: (
            lines([{"time": "12:00", "obs": {"x": 1}, "action": 0}] * 17_000)
            + b'{"time": ":\\":", "obs": {"x" : 1, "\\u0078"\t: 2}, "action": 0}\n'
        ),
        "row 17001 has two values for the column 'obs.x'",
    ),
    "a name twice beside a colon that is written as a number": (
        "demo.jsonl",
        lambda: b'{"obs_x": 1, "obs_x": 2, "time": "12\\u003A00", "action": 0}\n',
        "row 1 has two values for the column 'obs_x'",
    ),
    "a name twice beside a number without end": (
        "demo.jsonl",
        lambda: b'{"obs": {"x": 1, "x": 2}, "id": 1%s, "action": 0}\n' % (b"0" * 99),
        "row 1 has two values for the column 'obs.x'",
    ),
    "a name twice beside NaN": (
        "demo.jsonl",
        lambda: lines([{"obs_x": 1, "action": 0}]) + b'{"obs_x": 1, "obs_x": NaN, "action": 0}\n',
        "row 2 has two values for the column 'obs_x'",
    ),
    "a name twice in a JSON list": (
        "demo.json",
        lambda: b'[{"car": {"x": 1}, "action": 0}, {"car": {"x": 1, "x": 2}, "action": 1}]',
        "row 2 has two values for the column 'car.x'",
    ),
    "a name twice in JSON by columns": (
        "demo.json",
        lambda: b'{"obs_x": [1, 2], "obs_x": [3, 4], "action": [0, 1]}',
        "the column 'obs_x' stands twice; give each column its own name",
    ),
    "nested without end": (
        "demo.jsonl",
        lambda: b'{"obs": ' + b'{"a": ' * 900 + b"1" + b"}" * 901 + b"\n",
        "row 1 is nested too deeply|row 1 is no JSON object",
    ),
    "lists without end": (
        "demo.jsonl",
        lambda: b'{"episode": 0, "x": ' + 900 * b"[" + 900 * b"]" + b', "action": 0}\n',
        "row 1 is nested too deeply",
    ),
    "nested beyond all": (
        "demo.jsonl",
        lambda: b"[" * 10**6 + b"]" * 10**6,
        "row 1 is no JSON object|no object",
    ),
    "a column a row": (
        "demo.jsonl",
        lambda: lines([{f"obs_{i}": 1, "action": 0} for i in range(20_000)]),
        "more than 4,096 columns|unpacks to",
    ),
    "no list": ("demo.json", lambda: b'{"a": 1}', "it is no list of rows"),
    "columns of two lengths": (
        "demo.json",
        lambda: b'{"obs_x": [1, 2], "action": [1]}',
        "different lengths, from 1 to 2",
    ),
    "an empty list": ("demo.json", lambda: b"[]", "there are no rows"),
    "a bomb of gzip": ("demo.csv.gz", lambda: gzip.compress(bytes(2 * 10**8)), "it unpacks to"),
    "gzip cut off": ("demo.csv.gz", lambda: gzip.compress(text(","))[:-9], "damaged or cut off"),
    "gzip of Parquet": ("demo.csv.gz", lambda: gzip.compress(b"PAR1" * 9), "content is Parquet"),
    "gzip without an ending": ("demo.gz", lambda: gzip.compress(text(",")), "has no extension"),
    "text named gzip": ("demo.csv.gz", lambda: text(","), "not compressed with gzip"),
    "Arrow cut off": ("demo.arrow", lambda: arrow()[:-3], "damaged or cut off"),
    "a stream cut off": (
        "demo.arrow",
        lambda: arrow(pa.ipc.new_stream)[:-200],
        "damaged or cut off",
    ),
    "a bomb of Arrow": ("demo.arrow", lambda: compressed_arrow(10**8), "it unpacks to"),
    "a dictionary of Arrow": ("demo.arrow", dictionary_arrow, "it unpacks to|is no number|texts?"),
    "no values": ("demo.arrow", no_values_arrow, "it unpacks to"),
    "places beyond the file": ("demo.arrow", torn_offsets, "damaged or cut off"),
    "entities": ("demo.xlsx", bomb_of_entities, "defines entities"),
    "a row in a billion": ("demo.xlsx", far_row, "more rows than Excel can"),
    "no workbook": ("demo.xlsx", lambda: b"PK\x03\x04" + bytes(99), "damaged"),
    "an empty workbook": ("demo.xlsx", lambda: workbook(()), "nothing but white space"),
    "a long row": ("demo.xlsx", lambda: workbook(("obs_x", "action"), (1, 0), (1, 0, 7)), "row 2"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_is_one_sentence(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(READ_LIMIT, "0.125")
    file_name, content, reason = BAD[name]
    with pytest.raises(InputError, match=reason) as error:
        read_demonstrations(content(), file_name)
    assert str(error.value).startswith(f"{file_name}: ")
    assert "\n" not in str(error.value)


def test_colons_in_texts_are_no_names() -> None:
    texts = ["12:00", '":', ":", 'a "b" : c', "b"]
    rows = [{**row, "obs_note": texts[i % 5], "log": [{"a": ":"}]} for i, row in enumerate(ROWS)]
    read = read_demonstrations(lines(rows), "demo.jsonl")
    assert read.digest == read_demonstrations(json.dumps(rows).encode(), "demo.json").digest


def with_ids(base: int) -> list[dict[str, Any]]:
    return [{**row, "episode": base + row["episode"]} for row in ROWS]


def csv_of(rows: list[dict[str, Any]]) -> bytes:
    return "\n".join(
        ",".join(map(str, row)) for row in ([*rows[0]], *(row.values() for row in rows))
    ).encode()


def parquet_of(rows: list[dict[str, Any]]) -> bytes:
    ids = pa.array([row["episode"] for row in rows], pa.uint64())
    table = pa.Table.from_pylist([{**row, "episode": 0} for row in rows])
    out = io.BytesIO()
    pyarrow.parquet.write_table(table.set_column(0, "episode", ids), out)
    return out.getvalue()


@pytest.mark.parametrize("base", [2**53 - 1, 1234567890123456789, 2**63 - 1, 2**64 - 3])
@pytest.mark.parametrize(
    ("name", "content"),
    [("demo.csv", csv_of), ("demo.jsonl", lines), ("demo.parquet", parquet_of)],
)
def test_ids_longer_than_a_float_are_those_of_different_episodes(
    name: str, content: Callable[[list[Any]], bytes], base: int
) -> None:
    read = read_demonstrations(content(with_ids(base)), name)
    assert read.episodes.tolist() == [i // 10 for i in range(N)]
    assert any(f"are numbered from 0, {base}" in note.replace("'", "") for note in read.notes)


def test_ids_longer_than_any_number_are_texts() -> None:
    ids = with_ids(10**24)
    read = read_demonstrations(csv_of(ids), "demo.csv")
    assert read.episodes.tolist() == [i // 10 for i in range(N)]
    with pytest.raises(InputError, match="too large; write ids as texts"):
        read_demonstrations(lines(ids), "demo.jsonl")


def test_ids_that_a_spreadsheet_has_shortened_are_refused() -> None:
    content = csv_of([{**row, "episode": "1.23457E+18"} for row in ROWS])
    with pytest.raises(InputError, match="use whole numbers from 0"):
        read_demonstrations(content, "demo.csv")


SHEET = [("wind", "mode", "action"), (1.5, "manual", "lift"), (2.5, "auto", "hold")]
ODD_SHEET = [("wind", "mode", "decided"), *SHEET[1:]]
FACTS = [("Report", "March"), ("Operator", "Meier"), ("Version", 3)]
TITLE = [("Recordings of March",), ("see the next sheet",)]
COUNTS = [("decided", "count"), ("lift", 1), ("hold", 1)]


def workbook_of(sheets: Mapping[str, Sequence[Sequence[object]]]) -> bytes:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


@pytest.mark.parametrize(
    ("sheets", "note"),
    [
        ({"Info": FACTS, "Data": SHEET}, "the sheet 'Data' was read, and 'Info' beside it was not"),
        (
            {"Info": TITLE, "Data": SHEET, "Sums": COUNTS},
            "the sheet 'Data' was read, and 'Info', 'Sums' beside it were not",
        ),
        ({"Info": TITLE, "Data": ODD_SHEET}, "'Info' beside it was not"),
        ({"Info": FACTS[:2], "Data": ODD_SHEET}, "'Info' beside it was not"),
        ({"Info": FACTS, "Data": ODD_SHEET}, "'Info' beside it was not"),
        ({"Data": SHEET, "Empty": []}, ""),
    ],
)
def test_the_sheet_with_the_table_is_read_wherever_it_stands(
    sheets: dict[str, Sequence[Sequence[object]]], note: str
) -> None:
    columns = {"decided": "action"} if ODD_SHEET in sheets.values() else None
    read = read_demonstrations(workbook_of(sheets), "demo.xlsx", columns=columns)
    assert read.observations[:, 0].tolist() == [1.5, 2.5]
    assert read.action_dimensions[0].labels == ("hold", "lift")
    assert any("beside it" in one for one in read.notes) == bool(note)
    assert not note or any(note in one for one in read.notes)


def test_sheets_of_which_any_may_be_meant_are_named() -> None:
    content = workbook_of({"Info": FACTS, "March": SHEET, "April": SHEET})
    with pytest.raises(InputError, match=r"in 2 sheets, 'March', 'April', any of which"):
        read_demonstrations(content, "demo.xlsx")


def test_names_of_excel_may_have_several_lines() -> None:
    content = workbook(("wind\n(m/s)", "episode\nno", "decided"), (1.5, 0, "a"), (2.5, 1, "b"))
    assert table_columns(content, "demo.xlsx") == ("wind (m/s)", "episode no", "decided")


def test_cells_of_excel_are_what_they_show() -> None:
    day = datetime.datetime(2024, 5, 1, 12)
    content = workbook(
        (),
        ("time", "obs_x", "on", "action"),
        *((day, i / 10, i % 3 == 0, i % 2) for i in range(20)),
    )
    assert table_columns(content, "demo.xlsx") == ("time", "obs_x", "on", "action")
    read = read_demonstrations(content, "demo.xlsx")
    assert read.observations[:, 0].tolist() == [np.float32(i / 10) for i in range(20)]


def test_where_openpyxl_is_missing_one_sentence_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    content = workbook()
    real = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name == "openpyxl":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match=r"save it as CSV, or install 'sarl-explorer\[excel\]'"):
        read_demonstrations(content, "demo.xlsx")
