"""Changes to files that leave their form alone, so that more than the first check is reached."""

from __future__ import annotations

import gzip
import io
import json
import re
import struct
import zipfile
from collections.abc import Callable
from random import Random
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

Bytes = Callable[[bytes], bytes]

NUMBERS = (
    *(0, 1, -1, 2, 255, 2**15, 2**31 - 1, 2**31, 2**53, 2**63 - 1, 2**63, 2**64, 10**40),
    *(0.5, -0.5, 1e-45, 1e30, 1e36, 3.4e38, 1e39, 1.7e308, float("inf"), float("nan")),
)
TEXTS = (
    "",
    "x",
    "obs_0",
    "action",
    "nan",
    "1e999",
    "\x00",
    "\x1b[2J",
    "é" * 50,
    "9" * 5000,
    "⅓",
    "٣",
)
FIELDS = (
    *("0x10", "1_000", "+1", "-", ".", "1e", "1e400", "nan(1)", "inf", "true", "", " ", '"', '""'),
    *("'", "1,5", "\x00", "\r", "\ufeff", "2020-01-01", "9" * 400, "left"),
)
CODES = (
    "<f8",
    ">f8",
    "<f2",
    "|b1",
    "|u1",
    "<i8",
    "<u8",
    "<c16",
    "|O",
    "<U3",
    "<M8[s]",
    "|S4",
    "<f16",
)


def of_bytes(data: bytes, random: Random, mutate: Bytes) -> bytes:
    """Anything anywhere."""
    return mutate(data)


def of_table(data: bytes, random: Random, mutate: Bytes) -> bytes:
    """CSV: a field, a row, a sign, or anything."""
    choice = random.randrange(4)
    rows = data.split(b"\n")
    at = random.randrange(len(rows))
    if choice == 0:
        fields = re.split(rb"([,;\t|])", rows[at])
        place = random.randrange(len(fields))
        fields[place] = random.choice(FIELDS).encode()
        rows[at] = b"".join(fields)
    elif choice == 1:
        rows[at:at] = [rows[random.randrange(len(rows))]] * random.choice((1, 1, 1000))
    elif choice == 2:
        return data.replace(b",", random.choice((b";", b"\t", b"|", b", ")))
    else:
        return mutate(data)
    return b"\n".join(rows)


def of_json(data: bytes, random: Random, mutate: Bytes) -> bytes:
    """JSON: one value replaced, taken out, doubled or renamed."""
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        return mutate(data)
    if random.randrange(10) == 0:
        return mutate(data)
    places = _places(document)
    if not places:
        return mutate(data)
    holder, key = random.choice(places)
    choice = random.randrange(6)
    if choice == 0 and isinstance(holder, dict):
        holder[random.choice(TEXTS)] = holder.pop(key)
    elif choice == 1:
        del holder[key]
    elif choice == 2 and isinstance(holder, list):
        holder[key:key] = [holder[key]] * random.choice((1, 3, 100))
    elif choice == 3:
        other, place = random.choice(places)
        holder[key] = json.loads(json.dumps(other[place]))
    else:
        holder[key] = random.choice((*NUMBERS, *TEXTS, None, True, [], {}, [[]], [None]))
    return json.dumps(document).encode()


def _places(document: Any) -> list[tuple[Any, Any]]:
    found: list[tuple[Any, Any]] = []
    waiting = [document] if isinstance(document, (dict, list)) else []
    while waiting:
        holder = waiting.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        for key in keys:
            found.append((holder, key))
            if isinstance(holder[key], (dict, list)):
                waiting.append(holder[key])
    return found


def of_archive(data: bytes, random: Random, mutate: Bytes) -> bytes:
    """ZIP: an entry changed and packed again, its name, its flags, or anything."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = {info.filename: archive.read(info) for info in archive.infolist()}
    except Exception:
        return mutate(data)
    if not entries or random.randrange(8) == 0:
        return mutate(data)
    name = random.choice(list(entries))
    content = entries[name]
    choice = random.randrange(8)
    if choice == 0:
        del entries[name]
    elif choice == 1:
        entries[random.choice(list(entries))] = content
    elif content[:2] == b"PK":
        entries[name] = of_archive(content, random, mutate)
    elif content[:6] == b"\x93NUMPY":
        entries[name] = of_array(content, random, mutate)
    elif content[:1] == b"{":
        entries[name] = of_json(content, random, mutate)
    elif content[:4] == b"PAR1":
        entries[name] = of_parquet(content, random, mutate)
    elif content[:4] in (b"ARRO", b"\x89HDF", b"\xff\xff\xff\xff"):
        entries[name] = of_numbers(content, random, mutate)
    else:
        entries[name] = mutate(content)
    out = io.BytesIO()
    compression = random.choice((0, 8, 8, 8, 12, 14)) if random.randrange(8) == 0 else 0
    with zipfile.ZipFile(out, "w", compression) as archive:
        for key, value in entries.items():
            archive.writestr(key, value)
    packed = bytearray(out.getvalue())
    if random.randrange(8) == 0:
        start = max(packed.find(b"PK\x01\x02"), 0)
        packed[start + random.randrange(min(46, len(packed) - start))] = random.randrange(256)
    return bytes(packed)


def of_gzip(data: bytes, random: Random, mutate: Bytes) -> bytes:
    """Gzip: the text within, packed again, or anything."""
    try:
        content = gzip.decompress(data)
    except Exception:
        return mutate(data)
    if random.randrange(6) == 0:
        return mutate(data)
    return gzip.compress(of_table(content, random, mutate))


def of_numbers(data: bytes, random: Random, mutate: Bytes) -> bytes:
    """A binary file with its beginning and end: a number in it, a byte, or anything between."""
    choice = random.randrange(4)
    changed = bytearray(data)
    if choice == 0 or len(data) < 64:
        return data[:8] + mutate(data[8:-8]) + data[-8:]
    if choice == 1:
        changed[random.randrange(8, len(data))] = random.randrange(256)
    else:
        width, sign = random.choice(((2, "<h"), (4, "<i"), (8, "<q")))
        at = random.randrange(8, len(data) - width)
        at -= at % width
        value = random.choice((0, 1, -1, 2, 255, 2**15 - 1, 2**31 - 1, 2**40, 2**62, len(data)))
        most = 2 ** (8 * width - 1)
        changed[at : at + width] = struct.pack(sign, (value + most) % (2 * most) - most)
    return bytes(changed)


def of_array(content: bytes, random: Random, mutate: Bytes) -> bytes:
    """NPY: the type, the shape or the numbers, the header's length kept right."""
    size = struct.unpack("<H", content[8:10])[0]
    header, numbers = content[10 : 10 + size], content[10 + size :]
    choice = random.randrange(5)
    if choice == 0:
        code = random.choice(CODES)
        header = re.sub(rb"'descr': '[^']*'", f"'descr': '{code}'".encode(), header)
    elif choice == 1:
        sizes = [
            str(random.choice((0, 1, 2, 5, 5, 5, -1, 2**40))) for _ in range(random.randrange(4))
        ]
        shape = f"({', '.join(sizes)}{',' if len(sizes) == 1 else ''})"
        header = re.sub(rb"\([^)]*\)", shape.encode(), header)
    elif choice == 2:
        header = mutate(header)
    elif choice == 3 and len(numbers) >= 8:
        at = random.randrange(0, len(numbers) - 7, 8)
        value = random.choice([one for one in NUMBERS if isinstance(one, float)])
        numbers = numbers[:at] + struct.pack("<d", value) + numbers[at + 8 :]
    else:
        numbers = mutate(numbers)
    return content[:8] + struct.pack("<H", len(header) % 2**16) + header + numbers


def of_parquet(data: bytes, random: Random, mutate: Bytes) -> bytes:
    """Parquet: a column, the metadata or the way it is written; else bytes between the signs."""
    try:
        table = pq.read_table(io.BytesIO(data))
        if table.num_rows and table.num_columns and random.randrange(3):
            return _rewritten(table, random, mutate)
    except Exception:  # damaged by an earlier change
        pass
    return b"PAR1" + mutate(data[4:-4]) + b"PAR1"


def _rewritten(table: Any, random: Random, mutate: Bytes) -> bytes:
    choice = random.randrange(5)
    place = random.randrange(table.num_columns)
    if choice == 0:
        table = table.set_column(place, table.column_names[place], _column(table.num_rows, random))
    elif choice == 1:
        table = table.append_column(random.choice(TEXTS) + "_1", _column(table.num_rows, random))
    elif choice == 2 and table.num_columns > 1:
        table = table.remove_column(place)
    elif choice == 3:
        metadata = dict(table.schema.metadata or {})
        metadata[b"sarl"] = of_json(metadata.get(b"sarl", b"{}"), random, mutate)
        table = table.replace_schema_metadata(metadata)
    else:
        table = table.take(
            [random.randrange(table.num_rows) for _ in range(random.randrange(1, 9))]
        )
    out = io.BytesIO()
    pq.write_table(
        table,
        out,
        compression=random.choice(("none", "snappy", "zstd", "gzip")),
        use_dictionary=random.random() < 0.5,
        row_group_size=random.choice((1, 2, 1000)),
        data_page_version=random.choice(("1.0", "2.0")),
    )
    return out.getvalue()


def _column(n: int, random: Random) -> Any:
    kinds: tuple[tuple[Any, Callable[[], Any]], ...] = (
        (pa.float64(), lambda: random.choice((*NUMBERS[-10:], None, 0.5))),
        (pa.float32(), lambda: random.choice((0.25, 3e38, None))),
        (pa.float16(), lambda: 0.5),
        (pa.int64(), lambda: random.choice((0, 1, 2, -1, 2**62, None))),
        (pa.uint64(), lambda: random.choice((0, 1, 2**64 - 1))),
        (pa.bool_(), lambda: random.choice((True, False, None))),
        (pa.string(), lambda: random.choice(TEXTS)),
        (pa.binary(), lambda: b"\xff\x00"),
        (pa.null(), lambda: None),
        (pa.timestamp("ns"), lambda: random.choice((0, 2**62))),
        (pa.date32(), lambda: random.choice((0, 2**31 - 1))),
        (pa.duration("s"), lambda: 2**62),
        (pa.decimal128(38, 2), lambda: random.choice((1, None))),
        (pa.list_(pa.int8()), lambda: [1, 2]),
        (pa.struct([("a", pa.int8())]), lambda: {"a": 1}),
        (pa.dictionary(pa.int8(), pa.string()), lambda: random.choice(("l", "r", None))),
    )
    kind, value = random.choice(kinds)
    return pa.array([value() for _ in range(n)], kind)
