"""Files that must be refused with one sentence; the command line, pages and readers test them.

`BAD_INPUTS` maps a name to the file's name, its content, and fragments of the sentence.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tests.hostile_archives import (
    good_arrays,
    good_columns,
    npy,
    npy_header,
    npz_bytes,
    spoilt_npz,
    zip_bomb,
    zipped,
)

HEADER = "episode,step,obs_x,obs_y,action"
ROWS = ("0,0,0.5,1.5,0", "0,1,0.25,1.25,1", "0,2,0.125,1.0,0", "1,0,0.75,0.5,1", "1,1,0.0,0.25,1")


def csv_bytes(*rows: str, header: str | None = HEADER) -> bytes:
    lines = rows if header is None else (header, *rows)
    return ("\n".join(lines) + "\n").encode()


def changed(row: int, text: str) -> bytes:
    """The good CSV with one data row (from 1) replaced."""
    rows = list(ROWS)
    rows[row - 1] = text
    return csv_bytes(*rows)


def parquet_bytes(columns: dict[str, Any] | pa.Table | None = None, metadata: str = "") -> bytes:
    table = columns if isinstance(columns, pa.Table) else pa.table(columns or good_columns())
    if metadata:
        table = table.replace_schema_metadata({"sarl": metadata})
    out = io.BytesIO()
    pq.write_table(table, out)
    return out.getvalue()


def with_value(name: str, row: int, value: Any) -> dict[str, Any]:
    """The good columns with one value (row from 1) replaced."""
    columns = good_columns()
    columns[name] = [*columns[name][: row - 1], value, *columns[name][row:]]
    return columns


def _wide(count: int) -> bytes:
    header = ",".join([*(f"obs_{i}" for i in range(count - 1)), "action"])
    return csv_bytes(*[",".join(["0"] * count)] * 2, header=header)


_GOOD_METADATA = (
    '{"features": [{"name": "x", "unit": "m"}, {"name": "y"}], "action_names": ["push"], '
    '"label_names": [["left", "right"]], "label_first": [0]}'
)

BAD_INPUTS: dict[str, tuple[str, bytes, tuple[str, ...]]] = {
    # Nothing in it
    "empty csv": ("demo.csv", b"", ("empty",)),
    "empty parquet": ("demo.parquet", b"", ("empty",)),
    "empty npz": ("demo.npz", b"", ("empty",)),
    "white space csv": ("demo.csv", b" \n\n  \n", ("white space",)),
    "header only csv": ("demo.csv", csv_bytes(), ("no steps", "header")),
    "no rows parquet": (
        "demo.parquet",
        parquet_bytes(pa.table(good_columns()).slice(0, 0)),
        ("no steps",),
    ),
    "no rows npz": (
        "demo.npz",
        npz_bytes(observations=np.zeros((0, 2)), actions=np.zeros(0, int)),
        ("no steps",),
    ),
    "one row csv": ("demo.csv", csv_bytes(ROWS[0]), ("one observation only",)),
    "one row parquet": (
        "demo.parquet",
        parquet_bytes(pa.table(good_columns()).slice(0, 1)),
        ("one observation only",),
    ),
    "one row npz": (
        "demo.npz",
        npz_bytes(observations=np.zeros((1, 2)), actions=np.zeros(1, int)),
        ("one observation only",),
    ),
    # Columns
    "no action column csv": (
        "demo.csv",
        csv_bytes("1,2", "3,4", header="obs_x,obs_y"),
        ("no action", "'obs_x'"),
    ),
    "no action column parquet": (
        "demo.parquet",
        parquet_bytes({"obs_x": [1.0, 2.0]}),
        ("no action", "'obs_x'"),
    ),
    "no actions npz": ("demo.npz", npz_bytes(obs=np.zeros((5, 2))), ("no actions", "'obs'")),
    "no observation column csv": (
        "demo.csv",
        csv_bytes("0,1", "0,0", header="episode,action"),
        ("no observation",),
    ),
    "missing numbered column csv": (
        "demo.csv",
        csv_bytes("0,1,0", "0,1,1", header="obs_0,obs_2,action"),
        ("'obs_1'", "missing"),
    ),
    "missing column of the metadata parquet": (
        "demo.parquet",
        parquet_bytes({k: v for k, v in good_columns().items() if k != "obs_y"}, _GOOD_METADATA),
        ("'obs_y'", "missing"),
    ),
    "doubled column csv": (
        "demo.csv",
        csv_bytes("0,1,0", "0,1,1", header="obs_x,obs_x,action"),
        ("'obs_x'", "twice"),
    ),
    "doubled column parquet": (
        "demo.parquet",
        parquet_bytes(
            pa.Table.from_arrays(
                [pa.array([1.0, 2.0])] * 2 + [pa.array([0, 1])], names=["obs_x", "obs_x", "action"]
            )
        ),
        ("'obs_x'", "twice"),
    ),
    "unclear columns csv": (
        "demo.csv",
        csv_bytes("0,1,1,0", "1,2,1,1", header="x,seed,y,action"),
        ("unclear", "'x'"),
    ),
    "no header csv": ("demo.csv", csv_bytes(*ROWS, header=None), ("no header", "5 columns")),
    "ten thousand columns csv": ("demo.csv", _wide(10_000), ("10,000 columns",)),
    "ten thousand columns parquet": (
        "demo.parquet",
        parquet_bytes({**{f"obs_{i}": [0.0, 1.0] for i in range(9_999)}, "action": [0, 1]}),
        ("10,000 columns",),
    ),
    "ten thousand columns npz": (
        "demo.npz",
        npz_bytes(observations=np.zeros((2, 10_000)), actions=np.zeros(2, int)),
        ("10,000 features",),
    ),
    # Rows
    "short row csv": ("demo.csv", changed(3, "0,2,0.1,1.0"), ("row 3", "line 4", "4 fields")),
    "long row csv": ("demo.csv", changed(5, "1,1,0,0,1,9"), ("row 5", "line 6", "6 fields")),
    "text in a number csv": (
        "demo.csv",
        changed(2, "0,1,0.25,abc,1"),
        ("'obs_y'", "'abc'", "row 2", "line 3"),
    ),
    "text in an action csv": (
        "demo.csv",
        changed(4, "1,0,1,1,left"),
        ("'action'", "'left'", "row 4"),
    ),
    "date in a number csv": (
        "demo.csv",
        csv_bytes("2020-01-01,0", "2020-01-02,1", header="obs_x,action"),
        ("'obs_x'", "'2020-01-01'", "row 1"),
    ),
    "text in a number parquet": (
        "demo.parquet",
        parquet_bytes(good_columns() | {"reward": ["a", "b", "c", "d", "e"]}),
        ("'reward'", "'a'", "row 1"),
    ),
    "text in a number npz": (
        "demo.npz",
        npz_bytes(**good_arrays() | {"observations": np.array([["a", "b"]] * 5)}),
        ("'observations'", "no numbers"),
    ),
    "empty field csv": ("demo.csv", changed(3, "0,2,,1.0,0"), ("'obs_x'", "empty", "row 3")),
    "bytes in a number parquet": (
        "demo.parquet",
        parquet_bytes(good_columns() | {"obs_x": pa.array([b"\0\0\x80\x3f"] * 5, pa.binary(4))}),
        ("'obs_x' holds bytes that are no text in row 1", "no number"),
    ),
    "empty field parquet": (
        "demo.parquet",
        parquet_bytes(with_value("obs_x", 3, None)),
        ("'obs_x'", "empty", "row 3"),
    ),
    "empty quoted field csv": ("demo.csv", changed(3, '0,2,"",1.0,0'), ("'obs_x'", "row 3")),
    "empty action csv": ("demo.csv", changed(2, "0,1,1,1,"), ("'action'", "empty", "row 2")),
    "NaN csv": ("demo.csv", changed(4, "1,0,nan,1,0"), ("'obs_x'", "empty", "row 4")),
    "NaN parquet": (
        "demo.parquet",
        parquet_bytes(with_value("obs_x", 4, float("nan"))),
        ("'obs_x'", "not a number", "row 4"),
    ),
    "NaN npz": (
        "demo.npz",
        npz_bytes(**good_arrays() | {"observations": np.diag([1, 2, np.nan, 4, 5])}),
        ("column 2 of 'observations'", "not a number", "row 3"),
    ),
    "infinity csv": ("demo.csv", changed(1, "0,0,1,-inf,0"), ("'obs_y'", "infinite", "row 1")),
    "infinity parquet": (
        "demo.parquet",
        parquet_bytes(with_value("obs_y", 5, float("inf"))),
        ("'obs_y'", "infinite", "row 5"),
    ),
    "no reading csv": (
        "demo.csv",
        changed(2, "0,1,3.4028235e38,1,0"),
        ("'obs_x'", "row 2", "no reading"),
    ),
    "no reading parquet": (
        "demo.parquet",
        parquet_bytes(
            good_columns() | {"obs_x": [0.5, -3.4028234663852886e38, 0.1, 9.96921e36, 0]}
        ),
        ("'obs_x' is -3.40282e+38 in row 2", "first of 2", "no reading"),
    ),
    "too large to sum up csv": (
        "demo.csv",
        changed(2, "0,1,1.0000002e30,1,0"),
        ("'obs_x' is 1.00000017e+30 in row 2, beyond 1e+30", "larger unit"),
    ),
    "actions beyond measure npz": (
        "demo.npz",
        npz_bytes(**good_arrays() | {"actions": np.array([3e38, -3e38, 0.5, 1, 2], np.float32)}),
        ("'actions' is 3e+38 in row 1", "no reading"),
    ),
    "rewards beyond measure npz": (
        "demo.npz",
        npz_bytes(**good_arrays(), rewards=np.array([1, 2, 1.7e308, 0, 0])),
        ("'rewards' is 1.7e+308 in row 3", "no reading"),
    ),
    "infinite numbers that rise csv": (
        "demo.csv",
        csv_bytes(*(f"{i},1e400,0" for i in range(40)), header="x,y,action"),
        ("'y' is infinite in row 1",),
    ),
    "a name that nobody can read csv": (
        "demo.csv",
        csv_bytes("1,0", "2,1", header=f"obs_{'1' * 5000},action"),
        ("'obs_111", "name of 5,004 characters"),
    ),
    "hexadecimal csv": ("demo.csv", changed(4, "1,0,0x10,1,0"), ("'obs_x'", "'0x10'", "row 4")),
    "hexadecimal action csv": ("demo.csv", changed(2, "0,1,1,1,0X1"), ("'action'", "'0X1'")),
    "underscore csv": ("demo.csv", changed(1, "0,0,1_000,1,0"), ("'obs_x'", "'1_000'", "row 1")),
    "nan with a payload csv": ("demo.csv", changed(1, "0,0,nan(7),1,0"), ("'obs_x'", "'nan(7)'")),
    "Arabic digits csv": ("demo.csv", changed(1, "0,0,٣,1,0"), ("'obs_x'", "'٣'", "row 1")),
    "numbers and truth values csv": (
        "demo.csv",
        changed(3, "0,2,true,1.0,0"),
        ("'obs_x'", "true or false"),
    ),
    "beyond float32 csv": (
        "demo.csv",
        changed(2, "0,1,1e39,1,0"),
        ("'obs_x'", "infinite", "row 2"),
    ),
    "NaN reward csv": (
        "demo.csv",
        csv_bytes("0,1,0", "0,nan,1", header="obs_x,reward,action"),
        ("'reward'", "empty", "row 2"),
    ),
    "different lengths npz": (
        "demo.npz",
        npz_bytes(observations=np.zeros((9, 2)), actions=np.zeros(5, int)),
        ("5 actions", "9 observations"),
    ),
    # Actions
    "huge action csv": (
        "demo.csv",
        changed(3, "0,2,1,1,9223372036854775807"),
        ("'action'", "row 3"),
    ),
    "action beyond its labels parquet": (
        "demo.parquet",
        parquet_bytes(with_value("action", 4, 2), _GOOD_METADATA),
        ("'action'", "is 2", "row 4", "0 to 1"),
    ),
    "too many words csv": (
        "demo.csv",
        csv_bytes(*(f"word {i},{i % 2}" for i in range(40)), header="obs_x,action"),
        ("'x'", "40 different words", "30"),
    ),
    "words and numbers csv": (
        "demo.csv",
        csv_bytes("1,hold", "2,3", "3,hold", header="obs_x,action"),
        ("'action'", "'hold'", "row 1", "no number"),
    ),
    # Episodes and steps
    "steps out of order csv": ("demo.csv", changed(3, "0,1,0,1,0"), ("'step'", "row 3", "sort")),
    "steps out of order parquet": (
        "demo.parquet",
        parquet_bytes(with_value("step", 2, 7)),
        ("'step'", "row 3"),
    ),
    "episode comes back csv": ("demo.csv", changed(5, "0,3,0,1,0"), ("'episode'", "row 5")),
    "negative episode csv": ("demo.csv", changed(1, "-1,0,0,1,0"), ("'episode'", "-1", "row 1")),
    "half an episode csv": ("demo.csv", changed(1, "0.5,0,0,1,0"), ("'episode'", "0.5", "row 1")),
    "huge episode csv": (
        "demo.csv",
        changed(5, "1e300,1,0,1,0"),
        ("'episode'", "row 5"),
    ),
    "done is two csv": (
        "demo.csv",
        csv_bytes("1,0,0", "2,2,1", header="obs_x,done,action"),
        ("'done'", "row 2"),
    ),
    # Files that are something else
    "pickle npz": ("demo.npz", pickle.dumps([1, 2]), ("pickle", "never opened")),
    "object array npz": (
        "demo.npz",
        npz_bytes(**good_arrays() | {"actions": np.array([0, None, 1, 1, 1])}),
        ("'actions'", "pickle", "never opened"),
    ),
    "single array npz": ("demo.npz", npy(np.zeros((5, 2))), ("single NumPy array",)),
    "image npz": (
        "demo.npz",
        npz_bytes(observations=np.zeros((5, 8, 8, 3), np.uint8), actions=np.zeros(5, int)),
        ("8x8x3", "images"),
    ),
    "zip bomb npz": ("demo.npz", zip_bomb(says=2**32 - 2), ("unpacks to", "GiB")),
    "lying zip npz": ("demo.npz", zip_bomb(says=2**10), ("damaged",)),
    "indices with marks in two columns npz": (
        "demo.npz",
        npz_bytes(
            obs=np.zeros((5, 2)),
            acts=np.array([0, 1, 0, 1, 1]),
            indices=np.array([3]),
            terminals=np.zeros((2, 2), bool),
        ),
        ("'terminals'", "one number a step"),
    ),
    "encrypted npz": ("demo.npz", spoilt_npz(8, b"\x01\x00"), ("encrypted", "password")),
    "other compression npz": ("demo.npz", spoilt_npz(10, b"\x0e\x00"), ("compressed in a way",)),
    "archive of far too many files npz": (
        "demo.npz",
        b"PK\x03\x04" + b"PK\x05\x06" + bytes(8) + b"\xff\xff\xff\x7f" + bytes(6),
        ("far too many files",),
    ),
    "truncated npz": ("demo.npz", npz_bytes(**good_arrays())[:-40], ("damaged",)),
    "shape beyond its content npz": (
        "demo.npz",
        zipped(observations=npy_header((10**12, 10**5)) + bytes(80), actions=npy(np.zeros(5))),
        ("'observations'", "cut off"),
    ),
    "csv named parquet": ("demo.parquet", csv_bytes(*ROWS), ("not Parquet", ".csv")),
    "csv named npz": ("demo.npz", csv_bytes(*ROWS), ("not NPZ", ".csv")),
    "parquet named csv": ("demo.csv", parquet_bytes(), ("Parquet", ".parquet")),
    "npz named csv": ("demo.csv", npz_bytes(**good_arrays()), ("ZIP", ".npz")),
    "npz named parquet": ("demo.parquet", npz_bytes(**good_arrays()), ("ZIP", ".npz")),
    "parquet named npz": ("demo.npz", parquet_bytes(), ("Parquet", ".parquet")),
    "unknown extension": ("demo.mat", csv_bytes(*ROWS), ("'.mat'", ".parquet")),
    "csv named xlsx": ("demo.xlsx", csv_bytes(*ROWS), (".xlsx", "not Excel", ".csv")),
    "no extension": ("demo", csv_bytes(*ROWS), ("no extension",)),
    "latin-1 csv": (
        "demo.csv",
        csv_bytes(*ROWS, header=HEADER.replace("y", "ü")).replace(b"\xc3\xbc", b"\xfc"),
        ("not UTF-8", "line 1"),
    ),
    "UTF-32 csv": ("demo.csv", csv_bytes(*ROWS).decode().encode("utf-32"), ("UTF-32", "UTF-8")),
    "binary csv": ("demo.csv", bytes(range(1, 250)) + b"\0" * 9, ("no text",)),
    "open quotation mark csv": ("demo.csv", changed(2, '0,1,"0.25,1.25,1'), ("row 2",)),
    "truncated parquet": ("demo.parquet", parquet_bytes()[:-20], ("cut off",)),
    "damaged parquet": ("demo.parquet", b"PAR1" + b"\7" * 99 + b"PAR1", ("damaged",)),
    "ragged list column parquet": (
        "demo.parquet",
        parquet_bytes({"obs": [[1.0, 2.0], [3.0]], "action": [0, 1]}),
        ("'obs'", "list"),
    ),
    "list of structs column parquet": (
        "demo.parquet",
        parquet_bytes({"obs_x": [[{"a": 1.0}], [{"a": 2.0}]], "action": [0, 1]}),
        ("'obs_x'", "list", "taken apart"),
    ),
    # Metadata
    "metadata no JSON parquet": (
        "demo.parquet",
        parquet_bytes(metadata='{"features": '),
        ("'sarl'", "not JSON"),
    ),
    "metadata twice parquet": (
        "demo.parquet",
        parquet_bytes(metadata='{"agent": "a", "agent": "b"}'),
        ("'sarl'", "'agent' twice"),
    ),
    "metadata of another form parquet": (
        "demo.parquet",
        parquet_bytes(metadata='{"features": {"x": 1}}'),
        ("'sarl'", "'features'"),
    ),
    "metadata with infinity parquet": (
        "demo.parquet",
        parquet_bytes(metadata='{"action_low": [-Infinity]}'),
        ("'sarl'", "Infinity"),
    ),
    "metadata of a later version parquet": (
        "demo.parquet",
        parquet_bytes(metadata='{"version": 9}'),
        ("'sarl'", "version 9"),
    ),
    "metadata no text npz": ("demo.npz", npz_bytes(**good_arrays(), sarl=np.zeros(3)), ("'sarl'",)),
}
