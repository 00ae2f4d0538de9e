import numpy as np
import pytest

from sarl_core.errors import InputError
from sarl_core.rollouts.statistics import (
    interquartile_mean,
    mean_interval,
    summarise,
    summarise_groups,
)


def test_known_values() -> None:
    # Eight values: the middle four are 3, 4, 5, 6.
    found = summarise([100.0, 1, 2, 3, 4, 5, 6, -50])
    assert found.mean == pytest.approx(71 / 8)
    assert found.std == pytest.approx(np.std([100, 1, 2, 3, 4, 5, 6, -50], ddof=1))
    assert found.iqm == pytest.approx((2 + 3 + 4 + 5) / 4)


def test_interquartile_mean_along_an_axis() -> None:
    values = np.arange(16, dtype=float).reshape(2, 8)
    assert interquartile_mean(values, axis=1).tolist() == [3.5, 11.5]
    assert interquartile_mean([7.0, 9.0]) == 8.0


@pytest.mark.parametrize("values", [[5.0], [500.0] * 100])
def test_without_spread_the_interval_is_the_value(values: list[float]) -> None:
    found = summarise(values)
    assert (found.mean, found.std, found.iqm, found.low, found.high) == (
        values[0],
        0.0,
        values[0],
        values[0],
        values[0],
    )


def test_nearly_equal_values_are_no_trouble() -> None:
    found = summarise([500.0] * 99 + [499.0])
    assert found.low == found.iqm == found.high == 500.0


def test_the_interval_covers_the_truth_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    hits = 0
    for _ in range(100):
        found = summarise(rng.normal(size=40))
        hits += found.low <= 0 <= found.high
        assert found.low < found.iqm < found.high
    assert 88 <= hits <= 99


def test_same_seed_same_interval() -> None:
    values = np.random.default_rng(0).normal(size=30)
    assert summarise(values, seed=1) == summarise(values, seed=1)
    assert summarise(values, seed=1) != summarise(values, seed=2)


def test_where_learners_differ_more_episodes_of_each_make_nothing_surer() -> None:
    rng = np.random.default_rng(3)
    levels = [0.0, 100.0, 200.0]

    def width(episodes: int) -> tuple[float, float]:
        groups = [level + rng.normal(size=episodes) for level in levels]
        apart, together = summarise_groups(groups), summarise(np.concatenate(groups))
        assert (apart.mean, apart.std, apart.iqm) == (together.mean, together.std, together.iqm)
        return apart.high - apart.low, together.high - together.low

    (few_apart, few_together), (many_apart, many_together) = width(20), width(500)
    assert many_together < few_together / 3  # taken for independent, they would say too much
    assert many_apart > 0.8 * few_apart


def test_learners_that_are_alike_are_as_good_as_one() -> None:
    values = np.random.default_rng(5).normal(size=300)
    apart, together = summarise_groups(values.reshape(3, 100)), summarise(values)
    # Drawn twice, they vary twice: by the root of two, give or take what three groups differ.
    assert 1.0 < (apart.high - apart.low) / (together.high - together.low) < 2.0
    assert summarise_groups([values]) == together
    assert summarise_groups([[4.0, 4.0], [4.0, 4.0]]).low == 4.0


@pytest.mark.parametrize("values", [[], [1.0, np.nan], [np.inf]])
def test_nothing_to_summarise_is_an_error(values: list[float]) -> None:
    with pytest.raises(InputError):
        summarise(values)


def test_the_interval_of_a_mean_is_students() -> None:
    found = mean_interval([1.0, 2.0, 3.0, 4.0, 5.0])
    # 2.776 is the 97.5 % point with four degrees of freedom, from any table.
    half = 2.776 * np.sqrt(2.5 / 5)
    assert found.mean == 3.0
    assert (found.low, found.high) == pytest.approx((3 - half, 3 + half), abs=1e-3)


def test_the_interval_of_a_mean_of_five_covers_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(1)
    inside = [
        found.low <= 7.0 <= found.high
        for sample in rng.normal(7.0, 3.0, (2000, 5))
        for found in [mean_interval(sample)]
    ]
    assert np.mean(inside) == pytest.approx(0.95, abs=0.015)


def test_the_interval_of_a_mean_without_spread_or_without_values() -> None:
    assert mean_interval([0.5]) == mean_interval([0.5, 0.5, np.nan])
    assert (mean_interval([0.5]).low, mean_interval([0.5]).high) == (0.5, 0.5)
    empty = mean_interval([np.nan])
    assert np.isnan([empty.mean, empty.low, empty.high]).all()
