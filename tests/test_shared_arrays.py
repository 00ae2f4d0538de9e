"""Large arrays reach processes by a file, once, and leave nothing behind."""

from __future__ import annotations

import gc
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from sarl_core import Demonstrations
from sarl_core.processes import Processes


@pytest.fixture
def put_aside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.fixture
def pool() -> Iterator[Processes]:
    with Processes(1) as processes:
        yield processes


def files(folder: Path) -> set[str]:
    return {path.name for path in folder.glob("*.npy")}


def large(order: str = "C") -> NDArray[np.float64]:
    values = np.asarray(np.random.default_rng(0).normal(size=(700, 1_000)), order=order)  # type: ignore[call-overload]
    values.flags.writeable = False
    return values


def seen(values: NDArray[np.generic]) -> tuple[bytes, bool]:
    return values.tobytes(), values.flags.writeable


@pytest.mark.parametrize("order", ["C", "F"])
def test_a_large_array_is_written_once_and_goes_with_the_array(
    order: str, put_aside: Path, pool: Processes
) -> None:
    values = large(order)
    assert pool.submit(seen, values).result() == (values.tobytes(), False)
    first = files(put_aside)
    assert len(first) == 1
    assert pool.submit(seen, values).result() == (values.tobytes(), False)
    assert files(put_aside) == first
    del values
    gc.collect()
    assert not files(put_aside)


def test_what_may_change_or_is_small_is_sent_as_it_is_now(put_aside: Path, pool: Processes) -> None:
    changing = large().copy()
    for _ in range(2):
        changing += 1.0
        assert pool.submit(seen, changing).result()[0] == changing.tobytes()
    small = large()[:5]
    assert pool.submit(seen, small).result()[0] == small.tobytes()
    assert not files(put_aside)


def test_without_a_place_for_files_arrays_are_sent_all_the_same(
    put_aside: Path, pool: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    pool.submit(seen, np.zeros(1)).result()  # what starts a process may need the place
    monkeypatch.setattr(tempfile, "tempdir", str(put_aside / "nowhere"))
    assert pool.submit(seen, large()).result() == (large().tobytes(), False)


def digest_of(demonstrations: Demonstrations) -> str:
    return Demonstrations(
        demonstrations.observations, demonstrations.actions, demonstrations.episodes
    ).digest


def test_demonstrations_are_the_same_there(put_aside: Path, pool: Processes) -> None:
    states = np.random.default_rng(1).normal(size=(60_000, 20)).astype(np.float32)
    given = Demonstrations(states, (states[:, 0] > 0).astype(np.int64), np.arange(60_000) // 100)
    assert pool.submit(digest_of, given).result() == given.digest
    assert len(files(put_aside)) == 1
