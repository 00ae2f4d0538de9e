"""Formulas and conditions: what they mean, and that nothing else is read."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core.environments.formulas import MAX_DEPTH, MAX_LENGTH, Formula, StateCondition, parse
from sarl_core.errors import InputError

NAMES = ("gap", "own speed", "lead speed", "vehicle 2: x", "leg 1 contact", "min gap")
STATE = (4.0, 10.0, 8.0, 0.5, 1.0, 3.0)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("gap / (own speed - lead speed)", 2.0),
        ("own speed - lead speed - gap", -2.0),
        ("own speed / gap / 5", 0.5),
        ("-gap * 2 + 1e1", 2.0),
        ("min(gap, own speed, 3) + max(1, 2) + abs(-gap)", 9.0),
        ("min gap * .5", 1.5),
        ("'vehicle 2: x' + \"leg 1 contact\"", 1.5),
        ("own  speed", 10.0),
    ],
)
def test_a_formula_means_what_it_says(text: str, value: float) -> None:
    formula = Formula.parse(text, NAMES)
    assert formula.values(STATE) == value
    assert formula.values([STATE, STATE]).tolist() == [value, value]
    assert pickle.loads(pickle.dumps(formula)) == formula


@pytest.mark.parametrize(
    ("text", "truth"),
    [
        ("gap < 4 or own speed >= 10", True),
        ("not gap < 4 and not (own speed > 10)", True),
        ("gap < 4 or own speed > 1 and lead speed > 9", False),
        ("leg 1 contact >= 1", True),
    ],
)
def test_a_condition_means_what_it_says(text: str, truth: bool) -> None:
    assert StateCondition.parse(text, NAMES).values(STATE) == float(truth)


def test_what_has_no_value_is_neither_true_nor_false() -> None:
    states = np.array(
        [[0, 1, 1, 0, 0, 0], [3, 1, 1, 0, 0, 0], [-3, 1, 1, 0, 0, 0]], dtype=np.float32
    )
    text = "gap / (own speed - lead speed)"
    assert np.array_equal(
        Formula.parse(text, NAMES).values(states), [np.nan, np.inf, -np.inf], equal_nan=True
    )
    unknown, far, behind = StateCondition.parse(f"{text} > 5", NAMES).values(states)
    assert np.isnan(unknown)
    assert (far, behind) == (1.0, 0.0)
    assert np.isnan(StateCondition.parse(f"not {text} > 5", NAMES).values(states[0]))
    assert StateCondition.parse(f"{text} > 5 and gap > 1", NAMES).values(states[0]) == 0.0
    assert StateCondition.parse(f"{text} > 5 or gap < 1", NAMES).values(states[0]) == 1.0


@given(
    values=st.tuples(*[st.floats(width=32, allow_nan=False, allow_infinity=False)] * 2),
)
def test_it_is_worked_out_in_float64_from_float32(values: tuple[float, float]) -> None:
    # What is given in float64 is a float32 observation first.
    exact = np.float64(values[0]) * np.float64(3.3) - np.float64(values[1])
    got = Formula.parse("a * 3.3 - b", ("a", "b")).values(values)
    assert got.dtype == np.float64
    assert got == exact


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        ("gapp > 1", "'gapp' (sign 1) is no feature; did you mean 'gap'?"),
        ("__import__('os')", "is no feature"),
        ("gap.real", "'.' (sign 4)"),
        ("gap ** 2", "'*' (sign 6)"),
        ("gap == 1", "'=' (sign 5)"),
        ("(gap", "the end (sign 5)"),
        ("2 gap", "'gap' (sign 3)"),
        ("1 < gap < 3", "join two comparisons with and"),
        ("gap + (gap > 1)", "no numbers"),
        ("gap and own speed", "no conditions"),
        ("abs(gap, 2)", "give abs one"),
        ("1e999", "too large"),
        ("(" * (MAX_DEPTH + 1) + "gap" + ")" * (MAX_DEPTH + 1), "deep"),
        ("1" + "+1" * 240, "operations"),
        ("+".join(["gap"] * MAX_LENGTH), "shorten it"),
    ],
)
def test_what_is_no_formula_is_refused_with_its_place(text: str, says: str) -> None:
    with pytest.raises(InputError, match="formula") as raised:
        parse(text, NAMES)
    assert says in str(raised.value)


def test_a_number_is_no_condition_and_a_condition_no_number() -> None:
    with pytest.raises(InputError, match="no condition"):
        StateCondition.parse("gap", NAMES)
    with pytest.raises(InputError, match="no number"):
        Formula.parse("gap > 1", NAMES)
    with pytest.raises(InputError, match="6 features"):
        Formula.parse("gap", NAMES).values([1.0, 2.0])
