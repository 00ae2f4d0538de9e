from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.demonstrations.warnings import find_warnings
from tests.bad_inputs import csv_bytes


def example(observations: Any, actions: Any, **fields: Any) -> Demonstrations:
    return Demonstrations(
        np.asarray(observations, float), np.asarray(actions), np.zeros(len(actions), int), **fields
    )


GOOD = [[0, 1], [1, 3], [2, 2]]


def test_nothing_odd_no_warning() -> None:
    assert find_warnings(example(GOOD, [0, 1, 0])) == ()
    assert find_warnings(example(GOOD, [0.0, 1.0, 0.5])) == ()


def test_constant_feature() -> None:
    warnings = find_warnings(example([[0, 1, 7], [1, 3, 7], [2, 2, 7]], [0, 1, 0]))
    assert len(warnings) == 1
    assert "'feature 2' has the same value in every step" in warnings[0]


def test_doubled_feature() -> None:
    warnings = find_warnings(example([[0, 1, 0], [1, 3, 1], [2, 2, 2]], [0, 1, 0]))
    assert warnings == ("feature 'feature 2' repeats feature 'feature 0' in every step",)


def test_constant_features_are_not_called_doubled_too() -> None:
    warnings = find_warnings(example([[0, 1, 1], [1, 1, 1], [2, 1, 1]], [0, 1, 0]))
    assert len(warnings) == 2
    assert not any("repeats" in warning for warning in warnings)


def test_label_that_never_occurs() -> None:
    names = (("left", "stay", "right"),)
    warnings = find_warnings(
        example(GOOD, [5, 7, 5], label_names=names, label_first=(5,), action_names=("push",))
    )
    assert warnings == ("label 'stay' of action 'push' never occurs",)


@pytest.mark.parametrize(("labels", "steps"), [(300, 300), (150, 300), (149, 300), (30, 30)])
def test_an_action_that_may_be_an_identifier(labels: int, steps: int) -> None:
    words = np.array([f"cmd {index % labels:03}" for index in range(steps)])
    rows = np.random.default_rng(0).random((steps, 2))
    warnings = find_warnings(Demonstrations(rows, words, np.zeros(steps, int)))
    assert warnings == (
        (
            f"action 'action' has {labels} different labels in 300 steps, as an identifier or a "
            "free text has, from which hardly any rule can be learned; take another column as the "
            "action, or write few labels",
        )
        if labels in (150, 300)
        else ()
    )


def test_labels_that_differ_only_in_capitals() -> None:
    names = (("STOP", "hoist", "stop"),)
    warnings = find_warnings(example(GOOD, [0, 2, 1], label_names=names, action_names=("crane",)))
    assert warnings == (
        "labels 'STOP' and 'stop' of action 'crane' differ only in capitals; if they are one "
        "action, write them alike",
    )


def test_many_labels_that_never_occur_are_counted() -> None:
    names = (tuple(map(str, range(1000))),)
    warnings = find_warnings(example(GOOD, [0, 999, 0], label_names=names))
    assert len(warnings) == 6
    assert "label '1' of action 'action' never occurs" in warnings
    assert warnings[-1] == "993 more labels of action 'action' never occur"


@pytest.mark.parametrize("actions", [[2, 2, 2], [2.0, 2.0, 2.0]])
def test_single_action(actions: list[float]) -> None:
    warnings = find_warnings(example(GOOD, actions))
    assert len(warnings) == 1
    assert "'action' is 2 in every step" in warnings[0]


def test_each_action_dimension_is_looked_at() -> None:
    warnings = find_warnings(example(GOOD, [[0, 1], [1, 1], [0, 1]]))
    assert len(warnings) == 1
    assert "'action 1' is 1 in every step" in warnings[0]


def test_notes_from_reading_come_first() -> None:
    demonstrations = read_demonstrations(
        csv_bytes("1,5,0", "2,5,1", header="obs_x,obs_y,action"), "demo.csv"
    )
    warnings = find_warnings(demonstrations)
    assert "no episode column" in warnings[0]
    assert "'y' has the same value" in warnings[1]


def test_words_that_begin_as_numbers_are_warned_of() -> None:
    rows = [f"{row / 8},{10 * (row % 3)} %,crane {row % 3},{row % 2}" for row in range(12)]
    content = csv_bytes(*rows, header="wind,throttle,crane,action")
    warnings = find_warnings(read_demonstrations(content, "demo.csv"))
    amounts = [warning for warning in warnings if "begin as numbers do" in warning]
    assert len(amounts) == 1
    assert amounts[0].startswith("the words of 'throttle' begin as numbers do, as '0 %'; if they")
