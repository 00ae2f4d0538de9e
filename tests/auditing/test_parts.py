"""Files in parts of whole episodes: what is read of them is what one memory would read."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, load_demonstrations
from sarl_core.auditing.parts import LogPart, parts_of, read_part, runs_of, segments_of
from sarl_core.mining.distributed import pieces
from sarl_core.mining.distributed.pieces import Reading, parquet_paths, pieces_of
from tests.auditing.conftest import in_files


def parts_in(folder: Path, column: str = "episode") -> list[LogPart]:
    files = parquet_paths([folder])
    segments = segments_of(pieces_of(files))
    return parts_of(segments, [runs_of(one, column) for one in segments], column, files)


def read_all(folder: Path) -> list[Demonstrations]:
    reading = Reading(missing="drop")
    read = [read_part(part, reading).steps for part in parts_in(folder)]
    return [steps for steps in read if steps is not None]


def same_steps(parts: list[Demonstrations], whole: Demonstrations) -> bool:
    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(part, name) for part in parts])

    return all(
        np.array_equal(joined(name), getattr(whole, name), equal_nan=True)
        for name in ("episodes", "steps", "times")
    )


def named(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(episode="trip " + (100 - table.episode).astype(str))


FORMS = {
    "numbers": lambda table: table,
    "names": named,
    "long numbers": lambda table: table.assign(episode=table.episode + 2**60),
    "floats": lambda table: table.assign(episode=table.episode.astype(float)),
    "no numbers of steps": lambda table: table.drop(columns="step"),
    "numbers that begin again": lambda table: table.assign(episode=table.episode % 7),
}


@settings(max_examples=12)
@given(
    cuts=st.lists(st.integers(1, 3_999), max_size=4, unique=True).map(sorted),
    group=st.integers(40, 900),
    rows=st.integers(50, 2_500),
    form=st.sampled_from(sorted({*FORMS} - {"numbers that begin again"})),
)
def test_parts_are_whole_episodes_with_their_numbers_and_steps(
    fleet: pd.DataFrame, cuts: list[int], group: int, rows: int, form: str
) -> None:
    with TemporaryDirectory() as place, pytest.MonkeyPatch.context() as patch:
        patch.setattr(pieces, "ROWS", rows)
        folder = in_files(FORMS[form](fleet), Path(place) / "logs", cuts, group)
        whole = load_demonstrations(folder, missing="drop")
        parts = read_all(folder)
        assert same_steps(parts, whole)
        starts = [set(part.episodes.tolist()) for part in parts]
        assert sum(map(len, starts)) == whole.n_episodes == 40


def test_numbers_that_begin_again_in_each_file(
    fleet: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pieces, "ROWS", 700)
    ends = [int((fleet.episode < number).sum()) for number in (7, 14, 21, 28, 35)]
    for place, form in enumerate((FORMS["numbers that begin again"], lambda table: table)):
        table = form(fleet)
        if place:  # names that are used again
            table = table.assign(episode="trip " + (table.episode % 7).astype(str))
        folder = in_files(table, tmp_path / f"logs-{place}", ends)
        whole = load_demonstrations(folder, missing="drop")
        assert whole.n_episodes == 40
        assert same_steps(read_all(folder), whole)


def test_named_episodes_go_on_in_the_next_file_in_one_memory(
    fleet: pd.DataFrame, tmp_path: Path
) -> None:
    one = load_demonstrations(in_files(named(fleet), tmp_path / "one", []), missing="drop")
    cut = load_demonstrations(
        in_files(named(fleet), tmp_path / "cut", [111, 2_222]), missing="drop"
    )
    assert np.array_equal(one.episodes, cut.episodes)
    assert cut.n_episodes == 40


def test_files_with_other_types_and_orders_of_columns(
    fleet: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pieces, "ROWS", 1_500)
    folder = in_files(fleet, tmp_path / "logs", [])
    first, second = fleet[:1_777], fleet[1_777:]
    second = second.assign(
        obs_road=second.obs_road.astype("category"),
        step=second.step.astype(np.int16),
        **{"obs_gap [m]": second["obs_gap [m]"].astype(float)},
    )[fleet.columns[::-1]]
    first.to_parquet(folder / "log-0.parquet", index=False)
    second.to_parquet(folder / "log-1.parquet", index=False)
    assert same_steps(read_all(folder), load_demonstrations(folder, missing="drop"))


def test_a_part_in_which_every_step_lacks_a_value_has_none(
    fleet: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pieces, "ROWS", 300)
    gap = fleet["obs_gap [m]"].where((fleet.index < 500) | (fleet.index > 2_500))
    folder = in_files(fleet.assign(**{"obs_gap [m]": gap}), tmp_path / "logs", [1_000])
    read = [read_part(part, Reading(missing="drop")) for part in parts_in(folder)]
    assert any(one.steps is None and one.gaps.lacking == one.gaps.rows for one in read)
    whole = load_demonstrations(folder, missing="drop")
    assert sum(0 if one.steps is None else len(one.steps) for one in read) == len(whole)
    assert same_steps([one.steps for one in read if one.steps is not None], whole)


FAULTS = {
    "scattered": (
        lambda table: table.assign(episode=table.episode.replace(5, 3)),
        "column 'episode' comes back to 3 in row",
    ),
    "empty": (
        lambda table: table.assign(episode=table.episode.where(table.index != 1_500)),
        r"log-1.parquet: column 'episode' is empty in row 501; mend or remove",
    ),
    "times": (
        lambda table: table.assign(episode=pd.to_datetime("2026-01-01")),
        "log-0.parquet: column 'episode' holds 'timestamp.*', which says no episode; number",
    ),
    "broken numbers": (
        lambda table: table.assign(episode=table.episode + 0.5),
        "column 'episode' is 0.5 in row 1; use whole numbers from 0",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_episodes_that_are_none(fault: str, fleet: pd.DataFrame, tmp_path: Path) -> None:
    change, sentence = FAULTS[fault]
    with pytest.raises(InputError, match=sentence):
        parts_in(in_files(change(fleet), tmp_path / "logs", [1_000]))


def test_an_episode_that_no_process_could_hold(
    fleet: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = in_files(fleet, tmp_path / "logs", [1_000], 50)
    monkeypatch.setenv("SARL_READ_LIMIT_GIB", str(9_000 / 2**30))
    with pytest.raises(InputError, match=r"episode \d+ has \d+ steps, and one process reads all"):
        parts_in(folder)


def test_files_that_change_while_work_goes_on(fleet: pd.DataFrame, tmp_path: Path) -> None:
    folder = in_files(fleet, tmp_path / "logs", [2_000])
    (part,) = parts_in(folder)
    fleet[2_000:2_900].to_parquet(folder / "log-1.parquet")
    with pytest.raises(InputError, match=r"^log-1\.parquet: it has changed since the work began"):
        read_part(part, Reading(missing="drop"))
    (folder / "log-1.parquet").unlink()
    with pytest.raises(
        InputError, match=r"^log-1\.parquet: it is gone since the work began; put it back"
    ):
        read_part(part, Reading(missing="drop"))
