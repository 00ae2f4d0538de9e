from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from sarl_core import Demonstrations
from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.figures.demonstrations import feature_figure
from sarl_core.explaining.figures.distributions import (
    episode_series,
    feature_rows,
    histogram_by_label,
    interval_histogram,
)
from sarl_core.mining.labels import LabelledDimension


@given(
    arrays(np.float32, st.integers(1, 300), elements=st.floats(-1e6, 1e6, width=32)),
    st.integers(1, 5),
    st.integers(1, 50),
)
def test_every_value_is_counted_once_under_its_label(
    values: np.ndarray, n_labels: int, bins: int
) -> None:
    labels = np.arange(len(values)) % n_labels
    histogram = histogram_by_label(values, labels, n_labels, bins=bins)
    assert histogram.counts.sum() == len(values)
    assert (histogram.counts.sum(axis=1) == np.bincount(labels, minlength=n_labels)).all()
    assert len(histogram.edges) == histogram.counts.shape[1] + 1
    assert (np.diff(histogram.edges) > 0).all()


def test_bins_agree_with_numpy() -> None:
    values = np.random.default_rng(0).normal(size=5000)
    histogram = histogram_by_label(values, np.zeros(5000, dtype=np.int64), 1, bins=40)
    expected, edges = np.histogram(values, bins=40)
    assert np.allclose(histogram.edges, edges)
    assert np.abs(histogram.counts[0] - expected).sum() <= 2  # a value on an edge may move


def test_a_few_values_have_a_bin_each() -> None:
    values = np.array([0.0, 1.0, 0.0, 5.0])
    histogram = histogram_by_label(values, np.array([0, 1, 1, 0]), 2)
    assert histogram.values is not None
    assert histogram.values.tolist() == [0.0, 1.0, 5.0]
    assert histogram.counts.tolist() == [[1, 0, 1], [1, 1, 0]]


def test_infinite_values_are_counted_beside_the_bins() -> None:
    values = np.array([*np.linspace(0, 1, 50), np.inf, -np.inf, np.inf], dtype=np.float32)
    histogram = histogram_by_label(values, np.arange(53) % 2, 2)
    assert np.isfinite(histogram.edges).all()
    assert (histogram.counts.sum(), histogram.infinite, histogram.total) == (50, 3, 53)
    nothing = histogram_by_label(np.full(4, np.inf), np.zeros(4, dtype=np.int64), 1)
    assert (nothing.counts.sum(), nothing.infinite) == (0, 4)
    figure = feature_figure(Feature("far"), nothing, LabelledDimension("action", ("go",)))
    assert len(figure.data) == 1


def test_no_bin_crosses_the_edge_of_an_interval() -> None:
    dimension = LabelledDimension.of_edges("torque", [-2.0, -0.5, 2.0])
    values = np.array([-2.0, -0.51, -0.5, 1.9, 7.0])
    histogram = interval_histogram(values, dimension)
    assert histogram.counts.sum(axis=1).tolist() == [2, 3]
    assert -0.5 in histogram.edges
    assert dimension.labels_of(values).tolist() == [0, 0, 1, 1, 1]


def test_a_feature_is_told_in_three_numbers() -> None:
    demonstrations = Demonstrations(
        np.array([[1.0, 5.0], [2.0, 5.0], [9.0, 5.0]]),
        np.array([0, 1, 0]),
        np.zeros(3),
        feature_names=("height", "mass"),
        feature_units=("m", "kg"),
    )
    height, mass = feature_rows(demonstrations)
    assert (height.name, height.unit, height.low, height.median, height.high) == (
        "height",
        "m",
        1.0,
        2.0,
        9.0,
    )
    assert (mass.low, mass.median, mass.high) == (5.0, 5.0, 5.0)


@pytest.mark.parametrize("count", [1, 2, 239, 240, 241, 5000])
def test_episodes_are_grouped_without_losing_one(count: int) -> None:
    values = np.random.default_rng(1).normal(size=count)
    series = episode_series(values, None, most=240)
    assert len(series.mean) == min(count, 240)
    assert series.first[0] == 1
    assert series.last[-1] == count
    assert (series.first[1:] == series.last[:-1] + 1).all()
    sizes = series.last - series.first + 1
    assert np.isclose((series.mean * sizes).sum(), values.sum())
    assert series.low.min() == values.min()
    assert series.high.max() == values.max()
    assert series.is_grouped == (count > 240)


def test_an_unfinished_episode_is_marked() -> None:
    series = episode_series(np.array([3, 4, 5]), np.array([True, True, False]))
    assert series.unfinished.tolist() == [False, False, True]
