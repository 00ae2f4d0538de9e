"""Thresholds, and the demonstrated values on either side of each."""

from __future__ import annotations

import numpy as np
import pytest

from sarl_core.demonstrations.splits import Splits
from sarl_core.mining import tree

LARGEST = float(np.finfo(np.float32).max)


def neighbours(values: np.ndarray, threshold: float) -> tuple[float, float]:
    """The largest value that is at most a threshold, and the smallest above it."""
    below = [float(one) for one in values if one <= np.float64(threshold)]
    above = [float(one) for one in values if one > np.float64(threshold)]
    return max(below, default=-np.inf), min(above, default=np.inf)


@pytest.mark.parametrize(
    "values",
    [
        [],
        [0.0, 1.0, 1.0],
        [-0.0, 0.5],
        [-LARGEST, -1.0, 1e-45, 0.1, LARGEST],
        [-np.inf, 0.1, 0.1, np.inf],
    ],
)
def test_neighbours_are_those_of_a_search_value_by_value(values: list[float]) -> None:
    of_32_bits = np.array(values, dtype=np.float32)
    between = np.nextafter(np.float64(np.float32(0.1)), [0.0, 1.0]).tolist()
    thresholds = np.array([0.0, 1.0, 0.1, *between, -LARGEST, LARGEST, -1e39, 1e39, 1e-46])
    splits = Splits.of(of_32_bits, thresholds)
    assert splits.thresholds.tolist() == sorted(set(thresholds.tolist()))
    found = list(zip(splits.below.tolist(), splits.above.tolist(), strict=True))
    assert found == [neighbours(of_32_bits, one) for one in splits.thresholds.tolist()]
    assert splits.binary == (len(values) > 0 and {*values} <= {0.0, 1.0})


def test_many_states_are_sorted_by_threads_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    states = rng.normal(size=(500, 4)).astype(np.float32)
    feature, threshold = np.array([2, -1, 0, 2]), rng.normal(size=4)
    few = tree.splits_of(feature, threshold, states)
    monkeypatch.setattr(tree, "_MANY_STATES", len(states))
    many = tree.splits_of(feature, threshold, states)
    assert [one is None for one in many] == [False, True, False, True]
    for one, other in zip(few, many, strict=True):
        if one is not None and other is not None:
            assert one.thresholds.tolist() == other.thresholds.tolist()
            assert one.below.tolist() == other.below.tolist()
            assert one.above.tolist() == other.above.tolist()
