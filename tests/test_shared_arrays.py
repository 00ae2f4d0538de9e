"""Large arrays for other processes go by a file, as long as nobody can change them."""

from __future__ import annotations

import gc
import importlib
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, grow_policy_trees, shared_arrays
from sarl_core.demonstrations.shared import in_shared_memory
from sarl_core.processes import Processes
from sarl_core.shared_arrays import handed_over, shared


def fixed() -> np.ndarray:
    array = np.arange(2**20, dtype=np.float64)
    array.flags.writeable = False
    return array


def test_a_large_array_is_there_once_and_gone_with_it() -> None:
    array = fixed()
    again, (path,) = handed_over(array)
    assert handed_over(array)[1] == (path,)
    assert (again(path) == array).all()
    del array
    gc.collect()
    assert not Path(path).exists()


def test_a_file_that_was_taken_away_is_written_again() -> None:
    array = fixed()
    _, (path,) = handed_over(array)
    Path(path).unlink()
    again, arguments = handed_over(array)
    assert (again(*arguments) == array).all()


def test_what_somebody_may_change_travels_as_it_is() -> None:
    array = np.zeros(2**20)
    view = array.view()
    view.flags.writeable = False
    for one in (array, view, np.zeros(3)):
        assert handed_over(one)[0] is not shared_arrays._opened


def test_a_process_sees_the_same_numbers() -> None:
    processes = Processes(1)
    try:
        assert processes.submit(np.sum, fixed()).result() == pytest.approx(fixed().sum())
    finally:
        processes.shutdown()


def grown_without_pandas() -> bool:
    with pytest.raises(ImportError):
        importlib.import_module("pandas")
    states = np.arange(8, dtype=np.float32)[:, None]
    labels = (states[:, 0] > 3).astype(np.int64)
    (tree,) = grow_policy_trees(Demonstrations(states, labels, np.zeros(8, dtype=np.int64)))
    return tree.n_nodes == 3


def test_a_process_grows_trees_without_a_package_that_they_have_no_use_for() -> None:
    processes = Processes(1, without=("pandas",))
    try:
        assert processes.submit(grown_without_pandas).result()
    finally:
        processes.shutdown()


def test_what_is_shared_stands_in_the_file_that_processes_are_given() -> None:
    array = shared(fixed())
    assert np.array_equal(array, fixed())
    assert not array.flags.writeable
    again, (path,) = handed_over(array)
    assert Path(path).exists()
    assert np.array_equal(again(path), array)
    del array
    gc.collect()
    assert not Path(path).exists()
    small = np.zeros(3)
    assert shared(small) is small


class SlowToRead:
    """What whoever reads it waits for."""

    def __reduce__(self) -> tuple[object, tuple[float]]:
        return time.sleep, (0.5,)


def slow_result() -> tuple[object, np.ndarray]:
    return SlowToRead(), fixed()


def test_what_a_process_gives_back_is_there_when_it_has_let_go_of_it() -> None:
    processes = Processes(1)
    try:
        assert np.array_equal(processes.submit(slow_result).result()[1], fixed())
    finally:
        processes.shutdown()


def test_demonstrations_are_the_same_in_shared_memory_and_are_not_copied_again() -> None:
    states = np.random.default_rng(0).normal(size=(2**17, 8)).astype(np.float32)
    before = Demonstrations(states, np.arange(2**17) % 2, np.zeros(2**17, dtype=np.int64))
    after = in_shared_memory(before)
    assert after.observations is not before.observations
    assert Demonstrations(states, before.actions, before.episodes).digest == after.digest
    renamed = replace(after, feature_names=tuple("abcdefgh"))
    assert renamed.observations is after.observations
    assert handed_over(renamed.observations)[1] == handed_over(after.observations)[1]
