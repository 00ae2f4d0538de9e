import numpy as np
import pytest

from sarl_core.errors import InputError
from sarl_core.rollouts.failures import bound_text, rate_text, safety_cells, safety_facts
from sarl_core.rollouts.statistics import (
    cost_interval,
    interquartile_mean,
    mean_interval,
    rate_of,
    rate_over_groups,
    summarise,
    summarise_groups,
    worst_tenth,
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


def test_of_many_values_a_formula_says_what_resampling_says() -> None:
    rng = np.random.default_rng(0)
    values = np.where(rng.random(10_001) < 0.1, -100.0, rng.gamma(1.5, 100.0, 10_001))
    by_formula, resampled = summarise(values), summarise(values[:-1])
    width = resampled.high - resampled.low
    assert by_formula.low == pytest.approx(resampled.low, abs=0.1 * width)
    assert by_formula.high == pytest.approx(resampled.high, abs=0.1 * width)
    # No resampling: another seed is no other interval.
    assert summarise(values, seed=1) == by_formula != summarise(values[:-1], seed=1)
    mostly = summarise(np.r_[np.arange(2_000.0) / 10, np.full(9_000, 500.0)])
    assert (mostly.low, mostly.iqm, mostly.high) == (500.0, 500.0, 500.0)


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


@pytest.mark.parametrize(("of", "words"), [(20, "14 %"), (300, "1 %"), (3_000, "0.1 %")])
def test_without_a_failure_the_rate_is_at_most_what_would_rarely_show_none(
    of: int, words: str
) -> None:
    """One-sided: at the bound, none in so many is seen once in twenty times."""
    rate = rate_of(np.zeros(of))
    assert (1 - rate.at_most) ** of == pytest.approx(0.05)
    assert rate_text(rate) == f"0 failures in {of:,}: at most {words} with 95 % certainty"
    assert float(bound_text(rate.at_most).removesuffix(" %")) / 100 >= rate.at_most


def test_failures_are_worded_with_what_is_not_known() -> None:
    assert rate_text(rate_of([True, *[False] * 9])).startswith("1 of 10 episodes, 10 % (95 %")
    happened, unknown = np.arange(10) < 1, np.arange(10) > 7
    text = rate_text(rate_of(happened, unknown))
    assert text.startswith("1 of the 8 that ended, at least 10 % of all (95 % interval 0.3 %")
    assert rate_text(rate_of([False], [True])) == "not known: no episode ran to its end"


def test_the_worst_tenth_counts_its_last_episode_in_part() -> None:
    values = np.arange(25.0)
    assert worst_tenth(values, worst="lowest") == pytest.approx((0 + 1 + 0.5 * 2) / 2.5)
    assert worst_tenth(values, worst="highest") == pytest.approx((24 + 23 + 0.5 * 22) / 2.5)
    assert worst_tenth([3.0, -7.0], worst="lowest") == -7.0


def test_a_cost_does_not_fall_below_what_it_can_be_and_claims_no_spread_unseen() -> None:
    cost = cost_interval([0.0, 0.0, 0.0, 9.0])
    assert cost is not None
    assert (cost.mean, cost.low) == (2.25, 0.0)
    assert cost.high == pytest.approx(mean_interval([0.0, 0.0, 0.0, 9.0]).high)
    alike = cost_interval([0.0] * 50)
    assert alike is not None
    assert np.isnan([alike.low, alike.high]).all()
    assert cost_interval([1.0, np.nan]) is None


def test_a_rate_over_learners_allows_for_how_they_differ() -> None:
    apart, alike = rate_over_groups([0, 50, 0], [50, 50, 50]), rate_over_groups([5, 5], [50, 50])
    assert apart.rate == pytest.approx(1 / 3)
    assert (apart.low, apart.high) == (0.0, 1.0)
    assert alike == rate_of(np.arange(100) < 10)


def test_facts_say_only_what_is_known() -> None:
    known = {"failures": 0, "failure_rate": 0.0, "failure_low": 0.0, "failure_high": 0.17}
    more = {"cost": 2.5, "cost_low": 1.0, "cost_high": 4.0, "worst_tenth": -3.0, "freedom": 0.5}
    facts = dict(safety_facts(known | more, 20, "my:Own-v0", shielded=True))
    assert facts["failures"].startswith("0 failures in 20")
    assert facts["cost"] == "2.50 an episode (95 % interval 1.00 to 4.00)"
    assert facts["freedom"] == "50 % of the choice is left to the agent"
    assert list(dict(safety_facts({}, 20, "my:Own-v0", shielded=False))) == ["failures"]
    assert set(safety_cells({}, 20).values()) == {"–"}
    assert safety_cells(known | more, 20)["Cost"] == "2.50 (1.00 to 4.00)"
