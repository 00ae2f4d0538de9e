"""Files to begin with in the formats that others have."""

from __future__ import annotations

import gzip
import io
import json
import zipfile
from typing import Any

import h5py
import numpy as np
import openpyxl
import pyarrow as pa

from tests.bad_inputs import ROWS, csv_bytes, good_columns, parquet_bytes

STATES = np.array([[0.5, 1.5], [0.25, 1.25], [0.125, 1.0], [0.75, 0.5], [0.0, 0.25]], np.float32)
ACTIONS = np.array([0, 1, 0, 1, 1])
BOX = {"type": "Box", "dtype": "float32", "shape": [2], "low": [0, 0], "high": [2, 2]}
DISCRETE = {"type": "Discrete", "n": 2, "start": 0}


def rows() -> list[dict[str, Any]]:
    columns = good_columns()
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def json_lines() -> list[bytes]:
    nested = [{"obs": {"x": 1, "y": [i, 2.5]}, "action": i % 2} for i in range(5)]
    return [b"\n".join(json.dumps(row).encode() for row in given) for given in (rows(), nested)]


def json_files() -> list[bytes]:
    return [json.dumps(given).encode() for given in (rows(), good_columns())]


def gzip_files() -> list[bytes]:
    return [gzip.compress(csv_bytes(*ROWS))]


def arrow(table: Any, *, stream: bool = True, compression: str | None = None) -> bytes:
    out = io.BytesIO()
    options = pa.ipc.IpcWriteOptions(compression=compression)
    make = pa.ipc.new_stream if stream else pa.ipc.new_file
    with make(out, table.schema, options=options) as writer:
        writer.write_table(table)
    return out.getvalue()


def arrow_files() -> list[bytes]:
    flat = pa.table(good_columns())
    words = pa.array(["left", "right", "left", "left", "right"]).dictionary_encode()
    lists = pa.table({"obs": STATES.tolist(), "action": ACTIONS, "word": words})
    return [
        arrow(flat),
        arrow(flat, stream=False),
        arrow(flat, compression="zstd"),
        arrow(lists),
        arrow(lists, stream=False, compression="lz4"),
    ]


def hdf5(*, packed: bool = False, groups: bool = False) -> bytes:
    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        places = ("data/demo_0/", "data/demo_1/") if groups else ("",)
        for place in places:
            for name, values in (
                ("observations", STATES),
                ("actions", ACTIONS),
                ("rewards", np.ones(5)),
                ("terminals", ACTIONS == 2),
            ):
                options = {"compression": "gzip", "shuffle": True} if packed else {}
                file.create_dataset(f"{place}{name}", data=values, **options)
    return out.getvalue()


def hdf5_files() -> list[bytes]:
    return [hdf5(), hdf5(packed=True), hdf5(groups=True)]


def excel_files() -> list[bytes]:
    book = openpyxl.Workbook()
    for row in (list(good_columns()), *(list(row.values()) for row in rows())):
        book.active.append(row)
    out = io.BytesIO()
    book.save(out)
    return [out.getvalue()]


def archive(entries: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as made:
        for name, content in entries.items():
            made.writestr(name, content)
    return out.getvalue()


def minari(data_format: str) -> bytes:
    metadata = {
        "data_format": data_format,
        "observation_space": json.dumps(BOX),
        "action_space": json.dumps(DISCRETE),
        "env_spec": json.dumps({"id": "Demo-v0"}),
    }
    entries = {"data/metadata.json": json.dumps(metadata).encode()}
    marks = np.zeros(5, bool)
    if data_format == "hdf5":
        out = io.BytesIO()
        with h5py.File(out, "w") as file:
            group = file.create_group("episode_0")
            group["observations"], group["actions"] = STATES, ACTIONS[:4]
            group["rewards"], group["terminations"] = np.ones(4), marks[:4]
            group["truncations"] = marks[:4]
        return archive(entries | {"data/main_data.hdf5": out.getvalue()})
    table = pa.table(
        {
            "observations": pa.FixedSizeListArray.from_arrays(STATES.ravel(), 2),
            "actions": ACTIONS,
            "rewards": np.ones(5),
            "terminations": marks,
            "truncations": marks,
        }
    )
    return archive(entries | {"data/0/part-0.arrow": arrow(table, stream=False)})


def lerobot() -> bytes:
    features = {
        "observation.state": {"dtype": "float32", "shape": [2], "names": ["x", "y"]},
        "action": {"dtype": "int64", "shape": [1], "names": None},
    }
    info = {"codebase_version": "v3.0", "features": features}
    columns = {
        "observation.state": STATES.tolist(),
        "action": ACTIONS.tolist(),
        "episode_index": [0, 0, 0, 1, 1],
    }
    return archive(
        {
            "meta/info.json": json.dumps(info).encode(),
            "data/chunk-000/file-000.parquet": parquet_bytes(columns),
        }
    )


def imitation() -> bytes:
    table = pa.table(
        {
            "obs": [STATES[:3].tolist(), STATES.tolist()],
            "acts": [[0, 1], [1, 0, 1, 0]],
            "terminal": [True, False],
            "rews": [[1.0, 1.0], [1.0, 1.0, 1.0, 1.0]],
        }
    )
    state = {"_data_files": [{"filename": "data.arrow"}]}
    return archive(
        {
            "state.json": json.dumps(state).encode(),
            "dataset_info.json": b"{}",
            "data.arrow": arrow(table),
        }
    )


def archives() -> list[bytes]:
    runs = {
        f"run_{number}.csv": csv_bytes("0.5,1", "0.25,0", header="x,action") for number in (1, 10)
    }
    return [minari("arrow"), minari("hdf5"), lerobot(), imitation(), archive(runs)]
