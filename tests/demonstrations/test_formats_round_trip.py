from __future__ import annotations

import io
import itertools
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import (
    load_demonstrations,
    read_demonstrations,
    save_demonstrations,
)
from sarl_core.demonstrations.formats.arrow.parquet_file import open_parquet
from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.opened_table import Table
from sarl_core.demonstrations.formats.texts.csv_file import open_csv
from sarl_core.errors import InputError
from tests.bad_inputs import ROWS, csv_bytes, parquet_bytes
from tests.demonstrations.strategies import SPACES, demonstrations

ARRAYS = ("observations", "actions", "episodes", "steps", "rewards", "terminated", "truncated")


def assert_same_arrays(
    one: Demonstrations, other: Demonstrations, names: tuple[str, ...] = ARRAYS
) -> None:
    for name in names:
        value, same = getattr(one, name), getattr(other, name)
        assert (value is None) == (same is None), name
        if value is not None:
            assert value.dtype == same.dtype, name
            assert value.shape == same.shape, name
            assert value.tobytes() == same.tobytes(), name


def said(demonstrations: Demonstrations) -> list[list[str]]:
    """The actions by the names of their labels."""
    columns = demonstrations.action_columns
    return [
        [dimension.labels[label] for label in dimension.labels_of(column)]
        for dimension, column in zip(demonstrations.action_dimensions, columns.T, strict=True)
    ]


def saved(original: Demonstrations, name: str) -> Demonstrations:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        save_demonstrations(original, path)
        assert [entry.name for entry in Path(folder).iterdir()] == [name]
        loaded = load_demonstrations(path)
        uploaded = read_demonstrations(io.BytesIO(path.read_bytes()), name)
    assert loaded.digest == uploaded.digest
    return loaded


@pytest.mark.parametrize("extension", ["parquet", "npz"])
@pytest.mark.parametrize("space", SPACES)
@settings(max_examples=15)
@given(data=st.data())
def test_everything_survives(extension: str, space: str, data: st.DataObject) -> None:
    original = data.draw(demonstrations(space))
    loaded = saved(original, f"demo.{extension}")
    assert_same_arrays(original, loaded)
    assert loaded.metadata() == original.metadata()
    assert loaded.digest == original.digest


@pytest.mark.parametrize("space", SPACES)
@settings(max_examples=25)
@given(data=st.data())
def test_columns_survive_csv(space: str, data: st.DataObject) -> None:
    original = data.draw(demonstrations(space))
    try:
        loaded = saved(original, "demo.csv")
    except InputError:  # a label "NA" would be read as none
        reject()
    in_words = original.is_discrete and not original.env_id
    assert_same_arrays(original, loaded, ARRAYS[:1] + ARRAYS[2:] if in_words else ARRAYS)
    if in_words:
        assert said(loaded) == said(original)
    assert loaded.feature_names == original.feature_names
    if original.actions.ndim == 2:
        assert loaded.action_names == original.action_names


@pytest.mark.parametrize("extension", ["parquet", "npz"])
def test_names_that_are_numbers_keep_their_order(extension: str) -> None:
    original = Demonstrations(
        np.arange(6).reshape(2, 3),
        np.array([[0], [1]]),
        np.zeros(2, int),
        feature_names=("10", "9", "0"),
        action_names=("0",),
    )
    assert saved(original, f"demo.{extension}").digest == original.digest


def test_saving_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    original = Demonstrations(np.arange(6).reshape(3, 2), np.array([0, 1, 0]), np.zeros(3, int))
    for extension in ("parquet", "csv", "npz"):
        contents = []
        for name in ("one", "two"):
            save_demonstrations(original, tmp_path / f"{name}.{extension}")
            contents.append((tmp_path / f"{name}.{extension}").read_bytes())
        assert contents[0] == contents[1]


def test_saving_replaces_and_upper_case_extensions_are_known(tmp_path: Path) -> None:
    path = tmp_path / "demo.CSV"
    path.write_text("old")
    original = Demonstrations(np.arange(6).reshape(3, 2), np.array([0, 1, 0]), np.zeros(3, int))
    save_demonstrations(original, path)
    assert load_demonstrations(path).observations.tolist() == original.observations.tolist()


def test_parquet_layout_is_the_documented_one(tmp_path: Path) -> None:
    import json

    import pyarrow as pa
    import pyarrow.parquet as pq

    original = Demonstrations(
        np.eye(2, dtype=np.float32),
        np.array([0, 1]),
        np.zeros(2, int),
        np.zeros(2),
        terminated=np.zeros(2, bool),
        truncated=np.ones(2, bool),
        env_id="X-v0",
        feature_names=("pole angle", "speed"),
        feature_units=("rad", ""),
        agent="expert",
        seed=3,
    )
    save_demonstrations(original, tmp_path / "demo.parquet")
    schema = pq.read_schema(tmp_path / "demo.parquet")
    assert schema.names == [
        "episode",
        "step",
        "obs_pole angle",
        "obs_speed",
        "action",
        "reward",
        "terminated",
        "truncated",
    ]
    assert schema.field("obs_pole angle").type == pa.float32()
    metadata = json.loads(schema.metadata[b"sarl"])
    assert metadata["env_id"] == "X-v0"
    assert metadata["features"][0] == {"name": "pole angle", "unit": "rad"}
    assert (metadata["agent"], metadata["seed"]) == ("expert", 3)
    column = pq.ParquetFile(tmp_path / "demo.parquet").metadata.row_group(0).column(0)
    assert column.compression == "ZSTD"


@pytest.mark.parametrize(
    "table",
    [open_csv(memoryview(csv_bytes(*ROWS))), open_parquet(memoryview(parquet_bytes()))],
    ids=["csv", "parquet"],
)
def test_a_table_gives_the_columns_that_it_is_asked_for_and_no_others(table: Table) -> None:
    for count in range(len(table.names) + 1):
        for names in itertools.permutations(table.names, count):
            for columns in (ColumnMap(names, ()), ColumnMap((), names)):
                read = table.read(columns)
                assert tuple(read) == names
                assert all(len(column.values) == len(ROWS) for column in read.values())
