"""Continuous actions as they are written: told apart, and within their intervals."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sarl_core.mining.digits import amount_text
from sarl_core.mining.labels import LabelledDimension

_finite = st.floats(width=32, allow_nan=False, allow_infinity=False)
_near = st.integers(-3, 3)


def _moved(value: float, steps: int) -> float:
    """Some steps of float32 further."""
    moved = np.float32(value)
    for _ in range(abs(steps)):
        moved = np.nextafter(moved, np.float32(math.copysign(1.0, steps)) * np.float32(3e38))
    return float(moved)


@given(_finite, _finite | _near)
def test_two_amounts_read_in_the_order_they_have(amount: float, other: float | int) -> None:
    other = _moved(amount, other) if isinstance(other, int) else other
    read, beside = float(amount_text(amount, beside=(other,))), amount_text(other, beside=(amount,))
    assert np.sign(read - float(beside)) == np.sign(amount - other)


@given(st.integers(2, 12), st.floats(-1.0, 1.0, width=32), st.data())
def test_an_amount_reads_as_one_of_its_interval(
    divider: int, amount: float, data: st.DataObject
) -> None:
    edges = np.linspace(-1.0, 1.0, divider + 1)
    if data.draw(st.booleans()):  # as what a shield executes does
        on_edge = _moved(edges[data.draw(st.integers(0, divider))], data.draw(_near))
        amount = min(max(on_edge, -1.0), 1.0)
    dimension = LabelledDimension.of_edges("torque", edges.tolist())
    low, high = map(float, dimension.label_names[dimension.label_of(amount)].split(" to "))
    read = float(amount_text(amount, dimension))
    assert low <= read <= high or not low <= amount <= high
    assert math.isclose(read, amount, rel_tol=0.01, abs_tol=1e-3)


def test_an_amount_on_an_edge_reads_as_the_edge() -> None:
    torque = LabelledDimension.of_edges("torque", (-1.0, -1 / 3, 1 / 3, 1.0))
    executed = float(np.nextafter(np.float32(1 / 3), np.float32(0.0)))
    assert torque.label_names[1] == "-0.333 to 0.333"
    assert amount_text(executed, torque, beside=(0.8,)) == "0.333"
    assert amount_text(1e-7, torque) == "1e-07"


def test_amounts_that_are_none_are_said_to_be_none() -> None:
    assert amount_text(math.nan, beside=(1.0,)) == "not a number"
    assert amount_text(1.0, beside=(math.nan, math.inf)) == "1"
