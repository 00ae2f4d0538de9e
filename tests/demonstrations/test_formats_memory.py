"""Small files that stand for much: refused by what they say of themselves, within the limit."""

from __future__ import annotations

import contextlib
import gzip
import io
import json
import struct
import subprocess
import sys
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.demonstrations.formats.arrow.parquet_pages import largest_chunk
from sarl_core.errors import InputError
from sarl_core.limits import READ_LIMIT
from tests.bad_inputs import good_columns, npy, parquet_bytes

LIMIT = 0.125  # GiB
# A process of its own, because memory that was taken once counts for the whole of its life.
MEASURE = """
import json, resource, sys
from pathlib import Path
import pyarrow.compute, pyarrow.csv, pyarrow.parquet
from sarl_core.demonstrations.formats import load_demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.rule_set import load_rules
from sarl_core.agents.mlp_policy import MlpPolicy
read = {"json": load_rules, "policy": MlpPolicy.load}.get(sys.argv[2], load_demonstrations)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    said = str(len(read(Path(sys.argv[1]))))
except InputError as error:
    said = f"error: {error}"
after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps({"said": said, "peak": (after - before) * 1024}))
"""


def zstd(**columns: Any) -> bytes:
    out = io.BytesIO()
    pq.write_table(pa.table(columns), out, compression="zstd")
    return out.getvalue()


def labels(n: int) -> Any:
    return np.arange(n, dtype=np.int8) % 2


def texts_in_row_groups() -> bytes:
    table = pa.table({"obs_a": ["x" * 100_000] * 1000, "action": labels(1000)})
    out = io.BytesIO()
    with pq.ParquetWriter(out, table.schema, compression="zstd") as writer:
        for _ in range(10):
            writer.write_table(table)
    return out.getvalue()


def dictionary_of_one_text() -> bytes:
    codes = pa.array(np.zeros(60_000, np.int32))
    column = pa.DictionaryArray.from_arrays(codes, pa.array(["x" * 10**7]))
    return zstd(obs_a=column, action=labels(60_000))


def plain_texts() -> bytes:
    out = io.BytesIO()
    table = pa.table({"obs_a": [f"{'x' * 10**6}{i}" for i in range(300)], "action": labels(300)})
    pq.write_table(table, out, compression="zstd", use_dictionary=False)
    return out.getvalue()


def one_long_text() -> bytes:
    return zstd(obs_a=["x" * 10**8, "1"], action=labels(2))


def texts_in_objects() -> bytes:
    codes = pa.array(np.zeros(60_000, np.int32))
    texts = pa.DictionaryArray.from_arrays(codes, pa.array(["x" * 10**7]))
    return zstd(obs_a=pa.StructArray.from_arrays([texts], ["b"]), action=labels(60_000))


def long_lists() -> bytes:
    """Rows of two numbers, and one of a hundred million."""
    values = pa.array(np.zeros(10**8 + 2, np.int8))
    lists = pa.ListArray.from_arrays(pa.array([0, 2, 10**8 + 2], pa.int32()), values)
    return zstd(obs_a=lists, action=labels(2))


def zipped_zeros(size: int, says: int | None = None) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("run.csv", b"obs_a,action\n" + bytes(size))
    content = bytearray(out.getvalue())
    if says is not None:
        at = content.index(b"PK\x01\x02")
        content[at + 24 : at + 28] = struct.pack("<I", says)
    return bytes(content)


def packed_arrow(column: Any) -> bytes:
    table = pa.table({"obs_a": column, "action": labels(len(column))})
    out = io.BytesIO()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_stream(out, table.schema, options=options) as writer:
        writer.write_table(table)
    return out.getvalue()


def hdf5_zeros() -> bytes:
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        file.create_dataset("observations", (10**8, 4), "f4", chunks=(10**5, 4), compression="gzip")
        file["actions"] = labels(2)
    return out.getvalue()


def workbook_of_texts() -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/sharedStrings.xml", b"<si><t>x</t></si>" * 10**7)
    return out.getvalue()


def long_bytes() -> bytes:
    return zstd(obs_a=pa.array([b"\0" * 10**8] * 2, pa.binary(10**8)), action=labels(2))


def deflated(compression: int = zipfile.ZIP_DEFLATED, **entries: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as archive:
        for name, content in entries.items():
            archive.writestr(f"{name}.npy", content)
    return out.getvalue()


def compressed(**arrays: Any) -> bytes:
    out = io.BytesIO()
    np.savez_compressed(out, **arrays)
    return out.getvalue()


def bzip2_that_says_little() -> bytes:
    """Whoever unpacks it takes 300 MB, whatever size is asked for."""
    good = npy(np.zeros(5))
    content = bytearray(
        deflated(zipfile.ZIP_BZIP2, observations=good + bytes(3 * 10**8), actions=good)
    )
    at = content.index(b"PK\x01\x02")
    content[at + 24 : at + 28] = struct.pack("<I", len(good))
    return bytes(content)


def long_header() -> bytes:
    header = b"\x93NUMPY\x02\x00" + struct.pack("<I", 3 * 10**8)
    return deflated(observations=header + bytes(10**8), actions=npy(np.zeros(5)))


def wide_metadata() -> bytes:
    return parquet_bytes(metadata='{"notes": [' + "{}," * 1_100_000 + "{}]}")


N = 8_000_000
REFUSED: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "texts in row groups": ("parquet", texts_in_row_groups, "is no number"),
    "a dictionary of one text": ("parquet", dictionary_of_one_text, "is no number"),
    "plain texts": ("parquet", plain_texts, "0.3 GiB, more than the 0.125 GiB"),
    "one long text": ("parquet", one_long_text, "column 'obs_a' holds no numbers"),
    "long bytes": ("parquet", long_bytes, "column 'obs_a' holds no numbers"),
    "texts in objects": ("parquet", texts_in_objects, "column 'obs_a.b' holds"),
    "long lists": ("parquet", long_lists, "column 'obs_a' holds a list in each row"),
    "gzip": ("csv.gz", lambda: gzip.compress(b"obs_a,action\n" + bytes(3 * 10**8)), "unpacks to"),
    "an archive": ("zip", lambda: zipped_zeros(3 * 10**8), "unpacks to"),
    "an archive that says little": ("zip", lambda: zipped_zeros(10**8, says=1000), "damaged"),
    "Arrow": ("arrow", lambda: packed_arrow(pa.array(np.zeros(3 * 10**7))), "unpacks to"),
    "Arrow's texts": ("arrow", lambda: packed_arrow(pa.array(["x" * 5 * 10**7] * 5)), "unpacks to"),
    "rows without values": ("arrow", lambda: packed_arrow(pa.nulls(10**8)), "unpacks to"),
    "HDF5": ("hdf5", hdf5_zeros, "unpacks to"),
    "JSON lines": (
        "jsonl",
        lambda: b"".join(b'{"obs_%d": 0, "action": 1}\n' % n for n in range(4000)) * 40,
        "unpacks to",
    ),
    "a workbook": ("xlsx", workbook_of_texts, "unpacks to"),
    "zeros": ("parquet", lambda: zstd(obs_a=np.zeros(N), action=labels(N)), READ_LIMIT),
    "nothing": ("parquet", lambda: zstd(obs_a=pa.nulls(N), action=labels(N)), READ_LIMIT),
    "metadata": ("parquet", wide_metadata, "its metadata 'sarl' is too large: it unpacks to"),
    "bytes": (
        "npz",
        lambda: compressed(obs=np.zeros((N, 3), np.uint8), acts=labels(N)),
        READ_LIMIT,
    ),
    "wide": (
        "npz",
        lambda: compressed(obs=np.zeros((2, 10**7), np.int8), acts=labels(2)),
        "10,000,000 features",
    ),
    "wide actions": (
        "npz",
        lambda: compressed(obs=np.zeros((2, 2)), acts=np.zeros((2, 10**7), np.int8)),
        "10,000,000 action dimensions",
    ),
    "another compression": ("npz", bzip2_that_says_little, "compressed in a way"),
    "a long header": ("npz", long_header, "cannot be read as NumPy's"),
    "a policy": (
        "policy",
        lambda: compressed(format=np.array("sarl-policy"), label_counts=np.zeros(10**8, np.int8)),
        "unpacks to",
    ),
    "short rows": ("csv", lambda: b"obs_a,action\n" + b"0,1\n" * 6_000_000, READ_LIMIT),
    "empty lists": ("json", lambda: b"[" + b"[]," * 3_000_000 + b"[]]", "0.125 GiB"),
    "wide signs": (
        "json",
        lambda: '{"a": "\N{GRINNING FACE}'.encode() + b"x" * 3 * 10**7 + b'"}',
        "0.125 GiB",
    ),
}


def measured(path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> tuple[str, float]:
    """What was said, and the memory that it took, as a multiple of the limit."""
    monkeypatch.setenv(READ_LIMIT, str(LIMIT))
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, str(path), kind],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    return found["said"], found["peak"] / (LIMIT * 2**30)


@pytest.mark.parametrize("name", REFUSED)
def test_a_small_file_that_stands_for_much_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind, content, reason = REFUSED[name]
    path = tmp_path / f"demo.{'npz' if kind == 'policy' else kind}"
    path.write_bytes(content())
    said, peak = measured(path, kind, monkeypatch)
    assert said.startswith("error: ")
    assert reason in said
    assert len(said) < 500
    assert peak < 2


def rows_of(bytes_a_row: int) -> int:
    """As many as fit just within the limit."""
    return int(0.97 * LIMIT * 2**30 / bytes_a_row)


ACCEPTED: dict[str, tuple[str, int, Callable[[int], bytes]]] = {
    "one feature": (
        "parquet",
        4 + 8 + 40 + 1,
        lambda n: zstd(obs_a=np.zeros(n, np.int8), action=labels(n)),
    ),
    "flags": (
        "parquet",
        4 + 3 * 8 + 40 + 1,
        lambda n: zstd(obs_a=np.zeros(n), action=labels(n), done=labels(n), reward=labels(n)),
    ),
    "eight actions": (
        "parquet",
        4 + 8 * 8 + 40 + 8,
        lambda n: zstd(obs_a=np.zeros(n), **{f"action_{i}": np.zeros(n) for i in range(8)}),
    ),
    "float64": ("npz", 40 + 4 * 8 + 8, lambda n: compressed(obs=np.zeros((n, 4)), acts=labels(n))),
    "uint8": (
        "npz",
        40 + 4 * 4 + 8,
        lambda n: compressed(obs=np.zeros((n, 4), np.uint8), acts=labels(n)),
    ),
    "short rows": ("csv", 4 + 2 * 8 + 40, lambda n: b"obs_a,action\n" + b"0,1\n" * n),
    "fractions": (
        "csv",
        11 + 4 * 8 + 40,
        lambda n: b"obs_a,obs_b,obs_c,action\n" + b".5,.5,.5,1\n" * n,
    ),
    "truth values": ("csv", 8 + 2 * 8 + 40, lambda n: b"obs_a,action\n" + b"false,1\n" * n),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_a_file_that_just_fits_takes_less_than_twice_the_limit(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind, bytes_a_row, content = ACCEPTED[name]
    n = rows_of(bytes_a_row)
    path = tmp_path / f"demo.{kind}"
    path.write_bytes(content(n))
    said, peak = measured(path, kind, monkeypatch)
    assert said == str(n)
    assert peak < 2


def varint(number: int) -> bytes:
    """A whole number as Thrift writes it: zigzag, seven bits a byte."""
    rest, found = 2 * number, []
    while rest > 127:
        found.append(rest & 127 | 128)
        rest >>= 7
    return bytes([*found, rest])


def test_pages_count_by_their_own_headers_and_not_by_the_footer() -> None:
    content = zstd(obs_a=["x" * 10**6] * 3 + ["y" * 10**6] * 3, action=labels(6))
    chunk = pq.ParquetFile(io.BytesIO(content)).metadata.row_group(0).column(0)
    honest = chunk.total_uncompressed_size
    assert 2 * 10**6 < largest_chunk(memoryview(content), 6, [0, 1]) <= honest
    assert largest_chunk(memoryview(content), 6, [1]) < 200
    said = varint(honest)
    lying = content.replace(said, varint(2 ** (7 * (len(said) - 1) - 1)))
    assert lying != content
    assert pq.ParquetFile(io.BytesIO(lying)).metadata.row_group(0).column(0) != chunk
    assert largest_chunk(memoryview(lying), 6, [0]) > 2 * 10**6


@pytest.mark.parametrize("rows", [5, 7, 2**20, 2**40])
def test_a_footer_that_does_not_fit_the_pages_is_damage(rows: int) -> None:
    good = zstd(obs_a=np.arange(6.0), action=labels(6))
    start = len(good) - 8 - int.from_bytes(good[-8:-4], "little")
    with pytest.raises(InputError, match="damaged"):
        largest_chunk(memoryview(good), 7, [0])
    with pytest.raises(InputError, match="damaged"):
        largest_chunk(memoryview(good), 6, [2])
    before, after = (b"\x16" + varint(number) for number in (6, rows))
    footer = good[start:-8].replace(before, after, 1)
    assert footer != good[start:-8]
    ends = len(footer).to_bytes(4, "little") + b"PAR1"
    with pytest.raises(InputError, match=r"damaged|more than the"):
        read_demonstrations(good[:start] + footer + ends, "demo.parquet")


@pytest.mark.parametrize("place", range(4, 3000, 7))
def test_no_damage_of_a_footer_ends_the_process(place: int) -> None:
    content = bytearray(parquet_bytes())
    place = len(content) - 8 - place % int.from_bytes(content[-8:-4], "little") - 1
    for value in (0, 1, 0x19, 0x1C, 0x2C, 0x7F, 0xFF):
        content[place] = value
        with contextlib.suppress(InputError):
            read_demonstrations(bytes(content), "demo.parquet")


def test_headers_of_pages_that_go_ever_deeper_are_damage() -> None:
    good = zstd(obs_a=np.arange(6.0), action=labels(6))
    for header in (b"\x19" * 5000, b"\x1c" * 5000, b"\x19\xfc" + b"\xff" * 9 + b"\x01" * 99):
        content = header + len(header).to_bytes(4, "little") + b"PAR1"
        with pytest.raises(InputError, match="damaged"):
            largest_chunk(memoryview(content), 1, [0])
        content = good[:4] + header[:40] + good[44:]
        with pytest.raises(InputError, match="damaged"):
            largest_chunk(memoryview(content), 6, [0])


def test_pages_of_every_kind_are_counted() -> None:
    rng = np.random.default_rng(0)
    table = pa.table(
        {
            "obs_a": rng.normal(size=5000),
            "obs_b": pa.array([None, *rng.normal(size=4999)]),
            "action": labels(5000),
        }
    )
    for version in ("1.0", "2.0"):
        for compression in ("none", "snappy", "gzip", "zstd", "lz4", "brotli"):
            out = io.BytesIO()
            pq.write_table(
                table,
                out,
                data_page_version=version,
                compression=compression,
                data_page_size=2000,
                row_group_size=2500,
                write_page_checksum=True,
                write_page_index=True,
            )
            metadata = pq.ParquetFile(out).metadata
            said = max(
                metadata.row_group(i).column(j).total_uncompressed_size
                for i in range(2)
                for j in range(3)
            )
            found = largest_chunk(memoryview(out.getvalue()), 5000, [0, 1, 2])
            # The footer counts the pages' headers too.
            assert 0.8 * said < found <= said


def test_features_of_a_parquet_file_are_in_memory_once() -> None:
    steps, features = 100_000, 48
    states = np.random.default_rng(0).normal(size=(features, steps)).astype(np.float32)
    columns = {f"obs_{index}": values for index, values in enumerate(states)}
    content = zstd(**columns, action=labels(steps))
    read_demonstrations(parquet_bytes(), "demo.parquet")  # what is imported is not counted
    tracemalloc.start()
    try:
        read = read_demonstrations(content, "demo.parquet")
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert (read.observations == states.T).all()
    assert most < 1.8 * states.nbytes


def test_the_columns_that_are_not_used_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(READ_LIMIT, "0.001")
    columns = good_columns() | {"comment": [str(i) * 10**6 for i in range(5)]}
    assert len(read_demonstrations(zstd(**columns), "demo.parquet")) == 5
