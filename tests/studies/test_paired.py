from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import false_discovery_control, permutation_test

from sarl_core.studies.paired_tests import holm, sign_flip_test


@pytest.mark.parametrize("seed", range(6))
def test_p_values_are_those_of_scipys_exact_test(seed: int) -> None:
    rng = np.random.default_rng(seed)
    differences = rng.exponential(10.0, size=(3, 9)) - rng.normal(4.0, 2.0, size=(3, 9))
    differences[1, :4] = 0.0
    found = sign_flip_test(differences)
    for row, p in zip(differences, found, strict=True):
        exact = permutation_test(
            (row,), np.sum, permutation_type="samples", n_resamples=np.inf, alternative="two-sided"
        ).pvalue
        assert p == pytest.approx(exact, abs=0.015)


def test_failures_are_tested_as_mcnemar_does() -> None:
    """Nine episodes of thirty fail without and not with, none the other way: 2 / 2 ** 9."""
    found = sign_flip_test([[1.0] * 9 + [0.0] * 21, [0.0] * 30])
    assert found[0] == pytest.approx(2 / 2**9, abs=0.002)
    assert found[1] == 1.0


def test_the_same_seed_gives_the_same_and_nothing_is_no_evidence() -> None:
    values = np.random.default_rng(1).normal(size=(2, 40))
    assert (sign_flip_test(values) == sign_flip_test(values)).all()
    assert sign_flip_test(np.zeros((0, 5))).tolist() == []
    assert sign_flip_test([[3.0]]).tolist() == [1.0]  # one pair alone says nothing


def test_without_a_difference_few_are_found() -> None:
    values = np.random.default_rng(2).exponential(size=(400, 30))
    values -= np.random.default_rng(3).exponential(size=(400, 30))
    assert (sign_flip_test(values) < 0.05).mean() == pytest.approx(0.05, abs=0.03)


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03, 0.5]) == pytest.approx([0.04, 0.09, 0.09, 0.5])
    assert holm([]).tolist() == []
    assert holm([0.9, 0.8]).tolist() == [1.0, 1.0]


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30))
def test_holm_is_no_stricter_than_bonferroni_and_stricter_than_none(values: list[float]) -> None:
    adjusted = holm(values)
    assert (adjusted >= np.array(values)).all()
    assert (adjusted <= np.minimum(np.array(values) * len(values), 1.0) + 1e-12).all()
    # And never less strict than the false discovery rate of Benjamini and Hochberg.
    assert (adjusted >= false_discovery_control(values) - 1e-12).all()
