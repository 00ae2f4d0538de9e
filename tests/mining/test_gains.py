"""The gain of candidates: what counting in bins says, and what trying every query says."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor

from sarl_core.mining.combining import gains as gains_module
from sarl_core.mining.combining.gains import binned, gains

STATES = st.integers(1, 5).flatmap(
    lambda k: st.lists(
        st.tuples(st.integers(0, 3), *[st.integers(-9, 9)] * k), min_size=2, max_size=31
    )
)


def squares(labels: Sequence[int], *, ordered: bool) -> Fraction:
    """How unlike labels are, summed: their variance if they have an order, else Gini's."""
    n = len(labels)
    if not n:
        return Fraction(0)
    if ordered:
        return sum(label * label for label in labels) - Fraction(sum(labels) ** 2, n)
    return n - Fraction(sum(labels.count(label) ** 2 for label in set(labels)), n)


def best_gains(rows: Sequence[tuple[int, ...]], *, ordered: bool) -> list[Fraction]:
    """The largest gain of any query about each candidate, by trying all of them."""
    labels = [row[0] for row in rows]
    return [
        max(
            squares(labels, ordered=ordered)
            - squares([row[0] for row in rows if row[place] <= limit], ordered=ordered)
            - squares([row[0] for row in rows if row[place] > limit], ordered=ordered)
            for limit in {row[place] for row in rows}
        )
        for place in range(1, len(rows[0]))
    ]


def columns(rows: Sequence[tuple[int, ...]]) -> NDArray[np.float32]:
    return np.array([row[1:] for row in rows], dtype=np.float32).T


def targets(n: int, *, ordered: bool) -> NDArray[np.float64]:
    return np.arange(float(n))[None] if ordered else np.eye(n)


@settings(max_examples=200, deadline=None)
@given(rows=STATES, ordered=st.booleans())
def test_the_first_query_is_the_best_of_all(rows: list[tuple[int, ...]], ordered: bool) -> None:
    labels = np.array([row[0] for row in rows])
    helped = gains(binned(columns(rows)), labels, targets(4, ordered=ordered), leaves=2)
    expected = best_gains(rows, ordered=ordered)
    if max(expected) == 0:
        assert not helped.any()
    else:
        assert helped.max() == 1.0
        assert expected[int(helped.argmax())] == max(expected)


@pytest.mark.parametrize("ordered", [False, True])
def test_a_tree_in_few_values_is_that_of_scikit_learn(ordered: bool) -> None:
    generator = np.random.default_rng(0)
    states = generator.integers(0, 25, size=(500, 3)).astype(np.float32)
    labels = np.digitize(states @ [1.0, 0.5, 0.1] + generator.normal(size=500), [10.0, 20.0, 30.0])
    kind = DecisionTreeRegressor if ordered else DecisionTreeClassifier
    learner = kind(max_leaf_nodes=6, random_state=0).fit(states, labels)
    helped = gains(binned(states.T), labels, targets(4, ordered=ordered), leaves=6)
    assert helped == pytest.approx(learner.feature_importances_)


def test_many_candidates_are_as_few(monkeypatch: pytest.MonkeyPatch) -> None:
    generator = np.random.default_rng(1)
    states = generator.normal(size=(400, 23)).astype(np.float32)
    labels = (states[:, 20] + states[:, 3] > 0.3).astype(np.int64)
    together = gains(binned(states.T), labels, np.eye(2), leaves=8)
    monkeypatch.setattr(gains_module, "_TOGETHER", 5)
    blocks = binned(states.T)
    assert [block.shape for block in blocks] == [(400, 5)] * 4 + [(400, 3)]
    assert np.array_equal(gains(blocks, labels, np.eye(2), leaves=8), together)
    assert set(np.argsort(together)[-2:].tolist()) == {3, 20}


def test_of_equal_candidates_the_first_is_asked_about() -> None:
    values = np.arange(30, dtype=np.float32)
    labels = (values > 17).astype(np.int64)
    helped = gains(binned([np.zeros_like(values), values, -values]), labels, np.eye(2), leaves=9)
    assert helped.tolist() == [0.0, 1.0, 0.0]


def test_a_rare_value_and_an_infinite_one_are_told_from_the_others() -> None:
    values = np.ones(3_000, dtype=np.float32)
    values[::100], values[7] = -np.inf, np.inf
    (block,) = binned([values])
    assert [len(set(block[values == each, 0].tolist())) for each in (-np.inf, 1.0)] == [1, 1]
    assert block[0, 0] < block[1, 0]
