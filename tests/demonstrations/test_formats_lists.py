"""Columns that hold a list or an object in each row."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sarl_core.demonstrations.formats import ColumnMap, read_demonstrations, table_columns
from sarl_core.errors import InputError

N = 60
STATES = np.random.default_rng(0).normal(size=(N, 3)).astype(np.float32)
ACTIONS = np.arange(N) % 2


def parquet(**columns: Any) -> bytes:
    out = io.BytesIO()
    pq.write_table(pa.table(columns), out)
    return out.getvalue()


@pytest.mark.parametrize(
    "states",
    [
        pa.array(STATES.tolist()),
        pa.array(STATES.tolist(), pa.large_list(pa.float64())),
        pa.FixedSizeListArray.from_arrays(STATES.ravel(), 3),
    ],
    ids=["list", "large list", "fixed-size list"],
)
def test_each_number_of_a_list_is_a_column(states: Any) -> None:
    content = parquet(obs=states, action=ACTIONS, episode=np.arange(N) // 20)
    assert table_columns(content, "demo.parquet")[:3] == ("obs_0", "obs_1", "obs_2")
    demonstrations = read_demonstrations(content, "demo.parquet")
    assert demonstrations.observations.tolist() == STATES.tolist()
    assert demonstrations.n_episodes == 3


def test_each_entry_of_an_object_is_a_column_by_its_name() -> None:
    cars = [{"speed": float(a), "gap": {"ahead": float(b)}} for a, b, _ in STATES]
    # Older versions of pyarrow would put what they make of objects into the order of the alphabet.
    gap = pa.struct({"ahead": pa.float64()})
    states = pa.array(cars, pa.struct({"speed": pa.float64(), "gap": gap}))
    demonstrations = read_demonstrations(parquet(obs=states, action=ACTIONS), "demo.parquet")
    assert demonstrations.feature_names == ("speed", "gap.ahead")
    assert demonstrations.observations.tolist() == STATES[:, :2].tolist()


def test_tables_in_a_row_are_taken_apart_row_by_row() -> None:
    tables = [[[a, b], [c, a]] for a, b, c in STATES.tolist()]
    content = parquet(obs=tables, action=ACTIONS)
    columns = ColumnMap(("obs_1_0", "obs_0_1"), ("action",))
    demonstrations = read_demonstrations(content, "demo.parquet", columns=columns)
    assert demonstrations.observations.tolist() == STATES[:, [2, 1]].tolist()


def test_lists_of_several_lengths_are_refused_with_the_row() -> None:
    states = [*STATES.tolist(), [0.5]]
    content = parquet(obs=states, action=np.arange(N + 1) % 2)
    with pytest.raises(InputError, match=r"'obs' holds a list of 1 in row 61, and one of 3"):
        read_demonstrations(content, "demo.parquet")


def test_a_time_is_no_feature_and_refused_where_it_is_called_one() -> None:
    times = pa.array(np.arange(N), pa.timestamp("s"))
    content = parquet(a=times, b=STATES[:, 0], action=ACTIONS)
    assert read_demonstrations(content, "demo.parquet").feature_names == ("b",)
    columns = ColumnMap(("a", "b"), ("action",), feature_names=("clock", "gap"))
    with pytest.raises(InputError, match=r"'a' holds '1970-01-01 .*' in row 1, which is a time"):
        read_demonstrations(content, "demo.parquet", columns=columns)
    with pytest.raises(InputError, match="no feature beside 'a', which hold times"):
        read_demonstrations(parquet(a=times, action=ACTIONS), "demo.parquet")


def test_a_list_that_is_missing_is_an_empty_field_of_that_row() -> None:
    content = parquet(obs=[*STATES.tolist(), None], action=np.arange(N + 1) % 2)
    with pytest.raises(InputError, match=r"'obs_0' is empty .* in 1 of 61 rows"):
        read_demonstrations(content, "demo.parquet")
