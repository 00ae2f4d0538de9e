"""The difference that a shield makes, seed by seed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.statistics import rate_of
from sarl_core.studies.paired_tests import sign_flip_interval, sign_flip_test
from sarl_core.studies.shield_effect import shield_effect

EPISODES = rollout("CartPole-v1", "novice", episodes=40, keep_steps=False)


def changed(returns, failures):
    return replace(EPISODES, returns=np.array(returns, float), terminated=np.array(failures, bool))


def test_a_shield_that_does_nothing_makes_no_difference():
    rng = np.random.default_rng(1)
    wrong = 0
    for _ in range(100):
        values, falls = rng.normal(size=(2, 40)) * 50, rng.random((2, 40)) < 0.3
        found = shield_effect(changed(values[0], falls[0]), changed(values[1], falls[1]))
        wrong += found.effect != "no difference seen"
    assert wrong <= 12  # 5 % of 100 are to be expected


def test_what_pairs_show_is_found_where_the_spread_hides_it():
    values = np.random.default_rng(2).normal(size=40) * 100
    found = shield_effect(
        changed(values, [0] * 40), changed(values - 5 - np.arange(40) % 2, [0] * 40)
    )
    assert found.effect == "harms"
    assert found.returns.low < -5.5 < found.returns.high < -5
    assert found.failures is not None
    assert (found.fell, found.spared, found.failure_p) == (0, 0, 1.0)


def test_failures_decide_against_the_return():
    falls = np.arange(40) < 12
    found = shield_effect(changed([0.0] * 40, [0] * 40), changed([10.0] * 40, falls))
    assert found.effect == "harms"
    assert (found.fell, found.spared) == (12, 0)
    exact = binomtest(12, 12).pvalue
    assert found.failure_p == pytest.approx(exact, abs=1e-3)


def test_other_seeds_are_refused():
    with pytest.raises(InputError, match="same seeds"):
        shield_effect(EPISODES.part(0, 5), EPISODES.part(1, 6))


@pytest.mark.parametrize(("count", "of"), [(0, 20), (20, 20), (27, 300), (1, 1), (5, 20)])
def test_the_interval_of_a_rate_is_clopper_and_pearsons(count, of):
    found = rate_of(np.arange(of) < count)
    exact = binomtest(count, of).proportion_ci(method="exact")
    assert (found.count, found.of, found.rate) == (count, of, count / of)
    assert (found.low, found.high) == pytest.approx((exact.low, exact.high))


def test_the_interval_leaves_out_zero_exactly_where_the_test_finds_a_difference():
    rng = np.random.default_rng(4)
    for shift in np.linspace(-1.2, 1.2, 13):
        values = rng.exponential(size=25) - 1.0 + shift
        found = sign_flip_interval(values)
        assert found.low < found.mean == pytest.approx(values.mean())
        assert found.mean < found.high
        p_value = float(sign_flip_test(values[None])[0])
        if abs(p_value - 0.05) > 0.01:
            assert (found.low <= 0 <= found.high) == (p_value >= 0.05)


def test_the_interval_covers_a_mean_that_is_known():
    rng = np.random.default_rng(5)
    draws = [sign_flip_interval(rng.normal(3.0, 2.0, size=15)) for _ in range(150)]
    covered = sum(one.low <= 3.0 <= one.high for one in draws)
    assert 134 <= covered <= 149
