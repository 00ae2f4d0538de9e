"""Steps that lack a value: refused with their number, or left out where that is asked for."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import feather

from sarl_core import Demonstrations
from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.errors import InputError
from tests.bad_inputs import npz_bytes, parquet_bytes

CSV = """episode,obs_wind,obs_mode,action,reward,terminated
0,1.5,heavy,brake,1,false
0,,light,brake,1,false
0,2.5,light,hoist,1,true
1,3.5,heavy,NA,1,false
1,4.5,NA,hoist,1,false
1,nan,light,hoist,,false
1,5.5,light,hoist,1,true
"""


def read(missing: Any = "refuse", text: str = CSV) -> Demonstrations:
    return read_demonstrations(text.encode(), "log.csv", missing=missing)


def test_steps_without_a_value_are_refused_with_all_that_lack_some() -> None:
    with pytest.raises(InputError) as error:
        read()
    said = str(error.value)
    assert "column 'obs_wind' is empty or not a number (NaN) in 2 of 7 rows" in said
    for name in ("obs_mode", "action", "reward"):
        assert f"{name}' in 1" in said
    assert "the first of them row 2" in said
    assert "--missing drop" in said


def test_dropped_steps_leave_episodes_and_numbers_as_they_are() -> None:
    log = read("drop")
    assert log.observations[:, 0].tolist() == [1.5, 2.5, 5.5]
    assert log.episodes.tolist() == [0, 0, 1]
    assert log.steps is not None
    assert log.steps.tolist() == [0, 2, 3]
    assert log.label_names == (("brake", "hoist"),)
    assert any(note.startswith("4 of 7 steps lack a value and were left out") for note in log.notes)


def test_episodes_are_told_apart_before_steps_are_dropped() -> None:
    text = "obs_x,action,done\n1,0,0\n2,,1\n3,1,0\n4,0,1\n"
    log = read("drop", text)
    assert log.episodes.tolist() == [0, 1, 1]


@pytest.mark.parametrize("kind", ["parquet", "npz"])
def test_not_a_number_is_missing_in_every_format(kind: str) -> None:
    x = np.array([0.0, np.nan, 2.0, 3.0])
    content, name = (
        (parquet_bytes({"obs_x": x, "action": [0, 1, None, 1]}), "log.parquet")
        if kind == "parquet"
        else (npz_bytes(observations=x[:, None], actions=[0, 1, 0, 1]), "log.npz")
    )
    with pytest.raises(InputError, match=r"in 1 of 4 rows.*row 2"):
        read_demonstrations(content, name)
    left = read_demonstrations(content, name, missing="drop").observations[:, 0].tolist()
    assert left == ([0, 3] if kind == "parquet" else [0, 2, 3])


def test_a_whole_number_that_is_missing_is_no_zero() -> None:
    table = pa.table({"obs_x": [1, None, 2, 3], "obs_y": [0.5] * 4, "action": [0, 1, 0, 1]})
    arrow = io.BytesIO()
    feather.write_feather(table, arrow)
    for content, name in ((parquet_bytes(table), "log.parquet"), (arrow.getvalue(), "log.feather")):
        with pytest.raises(InputError, match=r"'obs_x' is empty .* in 1 of 4 rows.*row 2"):
            read_demonstrations(content, name)
        left = read_demonstrations(content, name, missing="drop")
        assert left.observations[:, 0].tolist() == [1, 2, 3]


def test_what_would_leave_nothing_is_refused() -> None:
    with pytest.raises(InputError, match=r"'obs_x' is empty .* in 3 of 3 rows, so no step would"):
        read("drop", "obs_x,obs_y,action\n,1,0\n,2,1\n,3,1\n")
    with pytest.raises(InputError, match=r"missing is 'fill'; give 'refuse' or 'drop'"):
        read("fill")
    with pytest.raises(InputError, match=r"column 'episode' is empty in row 2"):
        read("drop", "episode,obs_x,action\n0,1,0\n,2,1\n1,3,1\n")


def test_an_infinite_value_is_left_out_and_counted_beside_what_is_missing() -> None:
    text = CSV.replace("3.5", "inf").replace("4.5", "-inf").replace("5.5", "1e39")
    log = read("drop", text)
    assert log.observations[:, 0].tolist() == [1.5, 2.5]
    note = next(note for note in log.notes if "left out" in note)
    assert note.startswith("5 of 7 steps lack a value or hold an infinite one and were left out")
    assert "column 'obs_wind' is empty or not a number (NaN) in 2 of 7 rows" in note
    assert "column 'obs_wind' is infinite in 3 of 7 rows" in note
    alone = read("drop", "obs_x,action\n1,0\ninf,1\n2,1\n")
    assert any(
        note.startswith("1 of 3 steps holds an infinite value and was left out")
        for note in alone.notes
    )
    with pytest.raises(InputError, match="'obs_x' is infinite in row 2"):
        read("refuse", "obs_x,action\n1,0\ninf,1\n2,1\n")


def test_a_column_without_any_value_is_no_feature() -> None:
    rows = "".join(f"{row / 8},,{row % 2}\n" for row in range(4))
    demonstrations = read(text=f"wind,comment,action\n{rows}")
    assert demonstrations.feature_names == ("wind",)
    assert "the column 'comment' was not used: it is empty" in demonstrations.notes
    with pytest.raises(InputError, match="in 4 of 4 rows"):  # it is said to be one
        read(text=f"obs_wind,obs_comment,action\n{rows}")
