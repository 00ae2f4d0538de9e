"""When each step was: times in any form, as seconds beside the demonstrations."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sarl_core import Demonstrations, InputError, load_demonstrations, save_demonstrations
from sarl_core.demonstrations.formats import preview_columns, read_demonstrations

N = 24
STEP = 0.5
SINCE = np.arange(N) * STEP
DATES = pd.Timestamp("2026-03-01 23:59:55") + pd.to_timedelta(SINCE, unit="s")
OTHERS = {"x": np.sin(SINCE).round(3), "action": np.arange(N) // 5 % 2, "run": np.arange(N) // 8}


def content(name: str, values: object) -> bytes:
    return pd.DataFrame({name: values} | OTHERS).to_csv(index=False).encode()


@pytest.mark.parametrize(
    ("name", "values", "role"),
    [
        ("time", DATES.strftime("%Y-%m-%d %H:%M:%S.%f"), None),
        ("timestamp", DATES.strftime("%Y-%m-%dT%H:%M:%S.%fZ"), None),
        ("when", DATES.strftime("%Y-%m-%dT%H:%M:%S.%f+0100"), None),
        ("time", DATES.strftime("%d.%m.%Y %H:%M:%S.%f"), None),
        (
            "time",
            (pd.Timestamp("2026-03-01 10:00") + (DATES - DATES[0])).strftime("%H:%M:%S.%f"),
            None,
        ),
        ("time", SINCE, None),
        ("elapsed_ms", SINCE * 1000, None),
        ("time (min)", SINCE / 60, None),
        ("unix", 1.7e9 + SINCE, None),
        ("unix", (1_700_000_000_000 + SINCE * 1000).astype(np.int64), None),
        ("t", SINCE, None),
        ("z", SINCE, "time"),
        ("z", SINCE * 1e6, "time:us"),
    ],
)
def test_a_column_of_times_is_read_in_seconds(name: str, values: object, role: str | None) -> None:
    columns = None if role is None else {name: role}
    demonstrations = read_demonstrations(content(name, values), "log.csv", columns=columns)
    assert demonstrations.feature_names == ("x",)
    assert demonstrations.times is not None
    assert np.diff(demonstrations.times) == pytest.approx(STEP, abs=1e-5)


def test_a_name_that_promises_times_and_holds_something_else_is_not_used() -> None:
    words = ["soon", "late", "never"] * (N // 3)
    demonstrations = read_demonstrations(content("time", words), "log.csv")
    assert demonstrations.times is None
    assert any(
        "'time' was not used" in note and "is no time" in note for note in demonstrations.notes
    )
    with pytest.raises(InputError, match="'soon' in row 1, which is no time; write seconds"):
        read_demonstrations(content("time", words), "log.csv", columns={"time": "time"})
    with pytest.raises(InputError, match="'weeks' is no unit of a time"):
        read_demonstrations(content("time", SINCE), "log.csv", columns={"time": "time:weeks"})


def test_a_step_without_a_time_has_none() -> None:
    values = pd.Series(DATES.strftime("%Y-%m-%d %H:%M:%S.%f")).where(SINCE != 3)
    times = read_demonstrations(content("time", values), "log.csv").times
    assert times is not None
    assert np.flatnonzero(np.isnan(times)).tolist() == [6]


@pytest.mark.parametrize("ending", [".parquet", ".feather", ".jsonl"])
def test_other_tables_hold_times_too(ending: str, tmp_path: Path) -> None:
    table = pd.DataFrame({"time": DATES} | OTHERS)
    path = tmp_path / f"log{ending}"
    if ending == ".jsonl":
        table.to_json(path, orient="records", lines=True, date_format="iso", date_unit="us")
    else:
        getattr(table, f"to_{ending[1:]}")(path)
    times = load_demonstrations(path).times
    assert times is not None
    assert np.diff(times) == pytest.approx(STEP, abs=1e-5)


@pytest.mark.parametrize("ending", [".parquet", ".csv", ".npz"])
def test_times_are_saved_and_are_part_of_what_demonstrations_are(
    ending: str, tmp_path: Path
) -> None:
    with_times = Demonstrations(
        np.sin(np.stack([SINCE, SINCE + 1], axis=1)),
        OTHERS["action"],
        OTHERS["run"],
        times=1.7e9 + SINCE,
    )
    path = tmp_path / f"log{ending}"
    save_demonstrations(with_times, path)
    times = load_demonstrations(path).times
    assert times is not None
    assert times.tolist() == (1.7e9 + SINCE).tolist()
    without = Demonstrations(with_times.observations, with_times.actions, with_times.episodes)
    assert without.digest != with_times.digest
    assert with_times.select([1]).times is not None


def test_times_that_are_not_one_a_step_are_refused() -> None:
    with pytest.raises(InputError, match="times must be one number a step"):
        Demonstrations(np.zeros((3, 1)), np.array([0, 1, 0]), np.zeros(3, int), times=np.zeros(2))


def test_the_first_rows_are_shown_with_the_role(tmp_path: Path) -> None:
    table = pd.DataFrame({"time": SINCE, "date": "2026-03-01"} | OTHERS)
    roles = {
        one.name: str(one.role)
        for one in preview_columns(io.BytesIO(table.to_csv(index=False).encode()), "log.csv")
    }
    assert (roles["time"], roles["date"]) == ("time", "ignore")


def test_durations_are_amounts_of_seconds():
    table = {"wait": pd.to_timedelta([1.5, 60, 0.25, 3], unit="s"), "action": [0, 1, 0, 1]}
    out = io.BytesIO()
    pd.DataFrame(table).to_parquet(out)
    read = read_demonstrations(out.getvalue(), "rig.parquet")
    assert read.observations[:, 0].tolist() == [1.5, 60, 0.25, 3]
