"""Derived features: their values, their names, and that a file cannot disagree with them."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core.demonstrations.dataset import Demonstrations, Feature, formula_feature, with_formulas
from sarl_core.demonstrations.derived import (
    Combination,
    DerivedFeature,
    Extension,
    combination_name,
    extend,
)
from sarl_core.demonstrations.formats import load_demonstrations, save_demonstrations
from sarl_core.demonstrations.names import names_of, renamed
from sarl_core.demonstrations.recoding import recoded
from sarl_core.demonstrations.unit_algebra import quotient
from sarl_core.demonstrations.warnings import find_warnings
from sarl_core.environments.formulas import Formula, written
from sarl_core.errors import InputError

FEATURES = (Feature("gap", "m"), Feature("own speed", "m/s"), Feature("lead speed", "m/s"))
NAMES = tuple(feature.name for feature in FEATURES)
NUMBERS = st.floats(width=32, allow_nan=False, allow_infinity=False)
STATES = st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=5)
RATIOS = st.floats(min_value=-1e6, max_value=1e6).filter(bool)


def combination(first: int, second: int, ratio: float) -> Combination:
    return Combination(((first, 1.0), (second, ratio)))


def demonstrations(*derived: DerivedFeature) -> Demonstrations:
    rng = np.random.default_rng(0)
    observations = rng.normal(size=(40, 3)).astype(np.float32)
    return Demonstrations(
        observations,
        (observations[:, 0] > 0).astype(np.int64),
        np.repeat([0, 1], 20),
        feature_names=NAMES,
        feature_units=tuple(feature.unit for feature in FEATURES),
        derived=derived,
    )


@given(states=STATES, ratio=RATIOS)
def test_a_combination_is_worked_out_in_float64_and_rounded(
    states: list[tuple[float, float, float]], ratio: float
) -> None:
    array = np.array(states, dtype=np.float32)
    extension = Extension(3, [combination(2, 0, ratio), combination(0, 1, 0.5)])
    with np.errstate(over="ignore"):
        wanted = [np.float32(state[2] + ratio * state[0]) for state in states]
    many = extension.many(array)
    assert many[:, 3].tolist() == wanted
    assert many[:, :3].tolist() == array.tolist()
    assert [extension.one(list(state)) for state in array.tolist()] == many.tolist()


@given(states=STATES, data=st.data())
def test_one_state_and_many_are_worked_out_alike(
    states: list[tuple[float, float, float]], data: st.DataObject
) -> None:
    array = np.array(states, dtype=np.float32)
    extension = Extension(3, [data.draw(formulas()), combination(0, 1, -2.0)])
    one = [extension.one(state) for state in array.tolist()]
    assert np.array_equal(extension.many(array), one, equal_nan=True)


@st.composite
def formulas(draw: st.DrawFn) -> Formula:
    leaves = st.sampled_from([*NAMES, "0", "1.5", "3e5"])
    texts = st.recursive(
        leaves,
        lambda inner: st.one_of(
            st.tuples(inner, st.sampled_from("+-*/"), inner).map(" ".join).map("({})".format),
            st.tuples(st.sampled_from(["min", "max"]), inner, inner).map(
                lambda parts: f"{parts[0]}({parts[1]}, {parts[2]})"
            ),
            inner.map("abs({})".format),
            inner.map("-{}".format),
        ),
        max_leaves=8,
    )
    return Formula.parse(draw(texts), NAMES)


@given(formula=formulas())
def test_what_is_written_of_a_formula_is_read_as_the_same(formula: Formula) -> None:
    assert Formula.parse(written(formula.root, NAMES), NAMES).root == formula.root
    other = formula.over((1, 2, 0), ("one", "a min", "the 'gap'"))
    assert other.over((2, 0, 1), NAMES).root == formula.root


@given(text=st.text(max_size=60))
def test_any_text_is_a_feature_or_is_refused(text: str) -> None:
    for feature in (text, f"rate = {text}", f"{text} = gap"):
        with suppress(InputError):
            assert formula_feature(feature, FEATURES).name


@pytest.mark.parametrize(
    ("first", "second", "ratio", "name"),
    [
        (0, 1, 0.52, "gap plus 0.52 s of own speed"),
        (0, 1, -0.5, "gap minus 0.5 s of own speed"),
        (1, 2, 2.0, "own speed plus 2 times the lead speed"),
        (1, 2, -1.0, "own speed minus the lead speed"),
    ],
)
def test_a_combination_is_called_what_it_is(
    first: int, second: int, ratio: float, name: str
) -> None:
    assert combination_name(combination(first, second, ratio), FEATURES) == name


@pytest.mark.parametrize(
    ("one", "other", "unit"),
    [
        ("m", "m/s", "s"),
        ("rad", "rad/s", "s"),
        ("m/s", "m/s²", "s"),
        ("m", "m", ""),
        ("m", "rad", "m/rad"),
        ("m/s^2", "m", "1/s²"),
        ("km / h", "m", "km/h/m"),
        ("steps (1-5)", "m", None),
    ],
)
def test_units_are_divided(one: str, other: str, unit: str | None) -> None:
    assert quotient(one, other) == unit


@pytest.mark.parametrize(
    ("terms", "says"),
    [
        (((1, 1.0), (1, 0.5)), "combined with itself"),
        (((0, 1.0), (1, 0.0)), "ratio"),
        (((0, 1.0), (1, float("nan"))), "ratio"),
        (((0, 2.0), (1, 1.0)), "must be 1"),
    ],
)
def test_what_is_no_combination_is_refused(
    terms: tuple[tuple[int, float], tuple[int, float]], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        Combination(terms)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("rate = gap / nothing", "no feature"),
        ("rate = " + "+".join(["gap"] * 200), "500"),
        ("rate = " + "(" * 60 + "gap" + ")" * 60, "50 deep"),
        ("rate = gap ; gap", "sign 5"),
        ("rate = gap < 3", "condition"),
        ("gap / own speed", "is no feature; write its name"),
        (" = gap", "is no feature; write its name"),
        (f"{'n' * 101} = gap", "shorten"),
    ],
)
def test_what_is_no_formula_is_refused(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        formula_feature(text, FEATURES)


def test_names_with_underscores_and_capitals_are_known() -> None:
    derived = formula_feature("time to collision [s] = Gap / (own_speed - Lead speed)", FEATURES)
    assert (derived.name, derived.unit) == ("time to collision", "s")
    assert derived.definition.values(np.float32([[6, 5, 2]])) == [2.0]


def test_demonstrations_work_out_what_is_derived_whatever_they_are_given() -> None:
    derived = DerivedFeature(combination(0, 1, 2.0))
    plain, made = demonstrations(), demonstrations(derived)
    assert made.observations.shape == (40, 4)
    assert np.array_equal(made.raw_observations, plain.observations)
    assert np.array_equal(made.observations, extend(plain.observations, made.features))
    wrong = made.observations.copy()
    wrong[:, 3] = 7.0
    again = Demonstrations(
        wrong,
        made.actions,
        made.episodes,
        feature_names=NAMES,
        feature_units=made.feature_units,
        derived=made.derived,
    )
    assert np.array_equal(again.observations, made.observations)
    assert again.digest == made.digest != plain.digest
    assert made.select([1]).observations.shape == (20, 4)
    assert [feature.name for feature in made.features] == [*NAMES, "gap plus 2 s of own speed"]


def test_a_formula_without_a_value_in_a_demonstrated_state_is_refused() -> None:
    plain = demonstrations()
    formula = formula_feature("none = (gap - gap) / (gap - gap)", plain.observed)
    with pytest.raises(InputError, match="no value in 40 steps, first in row 1"):
        plain.deriving([formula])
    infinite = plain.deriving([formula_feature("far = 1 / (gap - gap)", plain.observed)])
    assert np.isinf(infinite.observations[:, 3]).all()


def test_two_features_of_one_name_are_refused() -> None:
    plain = demonstrations()
    with pytest.raises(InputError, match="stands twice"):
        plain.deriving([formula_feature("gap = own speed", plain.observed)])


def test_a_formula_takes_the_place_of_one_with_its_name() -> None:
    first = with_formulas(demonstrations(), ["a = 1 * gap", "b = 2 * gap"])
    (_, b), (a, c) = (
        first.derived,
        with_formulas(demonstrations(), ["a = 3 * gap", "c = 4 * gap"]).derived,
    )
    assert with_formulas(first, ["c = 4 * gap", "a = 3 * gap"]).derived == (a, b, c)
    assert with_formulas(first, ["b = 2 * gap"]).derived == first.derived
    for new in ("a", "c"):  # of two, neither is meant
        with pytest.raises(InputError, match="stands twice"):
            with_formulas(first, [f"{new} = 3 * gap", f"{new} = 4 * gap"])


@pytest.mark.parametrize("suffix", [".parquet", ".npz"])
def test_a_file_keeps_what_was_observed_and_how_the_rest_is_derived(
    tmp_path: Path, suffix: str
) -> None:
    made = demonstrations().deriving(
        [
            DerivedFeature(combination(0, 2, -0.25)),
            formula_feature("ratio = gap / own speed", FEATURES),
        ]
    )
    path = tmp_path / f"made{suffix}"
    save_demonstrations(made, path)
    read = load_demonstrations(path)
    assert read.derived == made.derived
    assert read.features == made.features
    assert np.array_equal(read.observations, made.observations)
    assert read.digest == made.digest


def test_other_names_are_names_of_what_is_derived_too() -> None:
    made = demonstrations().deriving(
        [
            DerivedFeature(combination(0, 1, 2.0)),
            formula_feature("ratio = gap / own speed", FEATURES),
        ]
    )
    other = renamed(made, names_of(made)._replace(features=("room", "my speed", "gap")))
    assert other.features[3].name == "room plus 2 s of my speed"
    assert str(other.features[4].derived) == "room / my speed"
    assert np.array_equal(other.observations, made.observations)


def test_rules_see_what_they_derive_in_demonstrations_of_another_order() -> None:
    made = demonstrations().deriving([DerivedFeature(combination(0, 1, 2.0))])
    order = [2, 0, 1]
    log = Demonstrations(
        made.raw_observations[:, order],
        made.actions,
        made.episodes,
        feature_names=tuple(NAMES[place] for place in order),
    )
    seen = recoded(log, made.features, called="the log")
    assert np.array_equal(seen.observations[:, 3], made.observations[:, 3])
    assert recoded(seen, made.features, called="the log") is seen


def test_units_that_do_not_fit_are_warned_of() -> None:
    plain = demonstrations()
    made = plain.deriving(
        [
            formula_feature("odd = gap + own speed", plain.observed),
            formula_feature("time [m] = gap / (own speed - lead speed + 1)", plain.observed),
            formula_feature("fine [s] = max(gap, 2) / own speed * 3", plain.observed),
        ]
    )
    said = [text for text in find_warnings(made) if "formula" in text]
    assert len(said) == 2
    assert "'odd' adds m and m/s" in said[0]
    assert "'time' is in s" in said[1]
