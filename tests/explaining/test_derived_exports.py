"""What is exported works out derived features as the shield does, to the last bit."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from sarl_core import Demonstrations, RuleSet, mine_rules
from sarl_core.demonstrations.dataset import formula_feature
from sarl_core.demonstrations.derived import Combination, DerivedFeature, extend
from sarl_core.explaining.exports.code_c import rules_to_c
from sarl_core.explaining.exports.code_python import rules_to_python
from sarl_core.explaining.exports.markdown import rules_to_markdown
from sarl_core.explaining.exports.onnx_model import rules_to_onnx
from sarl_core.explaining.exports.program import largest_float32, program_of
from sarl_core.explaining.exports.vectors import make_vectors, proposed_actions
from sarl_core.explaining.words.markdown import markdown_text
from sarl_core.mining.rules import Condition
from sarl_core.shielding.projection import Projection
from tests.explaining.exported import agree, expected, run_c, run_onnx, run_python

NAMES = ("gap", "own speed", "lead speed", "lane")
FORMULAS = (
    "time to collision [s] = gap / (own speed - lead speed)",
    "nearest = min(gap, max(own speed, -lead speed), 2) - abs(lane)",
    "twice = -gap * gap / 0.1 + lane",
)


def demonstrations(
    *, continuous: bool, ratios: tuple[float, ...], formulas: bool
) -> Demonstrations:
    rng = np.random.default_rng(1)
    states = rng.normal(size=(900, 4)).astype(np.float32)
    plain = Demonstrations(
        states, np.zeros(900, dtype=np.int64), np.repeat(np.arange(9), 100), feature_names=NAMES
    )
    derived = [
        DerivedFeature(Combination(((place % 3, 1.0), (place % 3 + 1, ratio))))
        for place, ratio in enumerate(ratios)
    ]
    if formulas:
        derived += [formula_feature(text, plain.observed) for text in FORMULAS]
    seen = plain.deriving(derived).observations
    score = seen[:, 4:].clip(-3, 3).sum(axis=1) + 0.2 * states[:, 3]
    if continuous:
        actions = np.stack([np.tanh(score), np.tanh(states[:, 0] - seen[:, 4])], axis=1)
        return replace(
            plain,
            actions=actions.astype(np.float32),
            derived=tuple(derived),
            label_names=None,
            label_first=None,
            action_names=("steer", "push"),
        )
    return replace(
        plain,
        actions=np.digitize(score, [-1.0, 0.5]).astype(np.int64),
        derived=tuple(derived),
        label_names=None,
        label_first=None,
    )


@cache
def mined(*, continuous: bool, formulas: bool, ratios: tuple[float, ...] = (0.52, -3.3)) -> RuleSet:
    made = demonstrations(continuous=continuous, ratios=ratios, formulas=formulas)
    return mine_rules(made, supp_min=0.002, conf_min=0.9, divider=3 if continuous else 2)


def scattered(rule_set: RuleSet) -> tuple[NDArray[np.float32], NDArray[Any]]:
    """States far and wide, some without a value of a formula, and actions for them."""
    rng = np.random.default_rng(5)
    states = rng.normal(size=(3_000, 4)) * 10.0 ** rng.integers(-4, 5, size=(3_000, 1))
    states = states.astype(np.float32)
    states[::7, 2] = states[::7, 1]  # division by zero
    states[::14, 0] = 0.0  # of zero
    states[::50] *= 1e30
    states[::101, 3] = np.nan
    return states, proposed_actions(rule_set, len(states), rng)


@pytest.mark.parametrize("formulas", [False, True])
@pytest.mark.parametrize("continuous", [False, True])
@pytest.mark.parametrize("placed", [False, True])
def test_what_is_exported_decides_as_the_shield_does(
    tmp_path: Path, continuous: bool, formulas: bool, placed: bool
) -> None:
    rule_set = mined(continuous=continuous, formulas=formulas)
    if placed:  # rules that are tried one by one
        rules = [replace(rule, pinned=place % 2 == 0) for place, rule in enumerate(rule_set)]
        rule_set = replace(rule_set, rules=tuple(rules))
    assert any(one.feature >= 4 for rule in rule_set for one in rule.conditions)
    projection: Projection = "clip" if continuous else "centre"
    vectors = make_vectors(rule_set, projection)
    states, proposed = scattered(rule_set)
    states = np.concatenate([states, vectors.states])
    proposed = np.concatenate([proposed, vectors.proposed])
    wanted = expected(rule_set, projection, states, proposed)
    assert 0 < np.count_nonzero(wanted.rules >= 0) < wanted.rules.size
    agree(run_c(rule_set, projection, states, proposed, tmp_path), wanted)
    agree(run_onnx(rule_set, projection, states, proposed), wanted)
    agree(run_python(rule_set, projection, states, proposed), wanted)


def test_the_vectors_lie_at_the_thresholds_of_combinations_and_a_step_beside_them() -> None:
    rule_set = program_of(mined(continuous=False, formulas=False)).rule_set
    vectors = make_vectors(rule_set)
    valid = vectors.states[~vectors.invalid]
    values = extend(valid, rule_set.source.features)
    queried = {
        (one.feature, one.threshold)
        for rule in rule_set
        for one in rule.conditions
        if one.feature >= 4
    }
    assert len(queried) > 5
    for feature, threshold in queried:
        at = largest_float32(threshold)
        column = values[:, feature]
        for number in (at, *(np.nextafter(at, np.float32(side)) for side in (-np.inf, np.inf))):
            assert number in column, (feature, threshold)
    # Where it is a rule that ends there, states lie on its side.
    assert len(np.unique(vectors.rules)) > len(rule_set) // 2


def test_a_state_without_a_value_has_no_rule_that_asks_for_it() -> None:
    rule_set = mined(continuous=False, formulas=True)
    states = np.zeros((1, 4), dtype=np.float32)
    assert np.isnan(extend(states, rule_set.source.features)).any()
    wanted = expected(rule_set, "centre", states, np.zeros((1, 1), dtype=np.int64))
    for place in wanted.rules[wanted.rules >= 0].tolist():
        queried = [one.feature for one in rule_set[place].conditions]
        assert not np.isnan(extend(states, rule_set.source.features)[0, queried]).any()


@settings(max_examples=8, deadline=None)
@given(
    ratios=st.lists(
        st.floats(min_value=-100, max_value=100).filter(lambda ratio: abs(ratio) > 1e-3),
        min_size=1,
        max_size=4,
    ),
    formulas=st.booleans(),
)
def test_exports_agree_on_any_derived_features(ratios: list[float], formulas: bool) -> None:
    rule_set = mined(continuous=False, formulas=formulas, ratios=tuple(ratios))
    vectors = make_vectors(rule_set)
    wanted = expected(rule_set, "centre", vectors.states, vectors.proposed)
    agree(run_onnx(rule_set, "centre", vectors.states, vectors.proposed), wanted)
    agree(run_python(rule_set, "centre", vectors.states, vectors.proposed), wanted)


def test_exports_say_what_is_derived_and_how_to_compile() -> None:
    import onnx

    rule_set = mined(continuous=False, formulas=True)
    c, python = rules_to_c(rule_set), rules_to_python(rule_set)
    assert "-ffp-contract=off" in c
    assert "time to collision (s) = gap / (own speed - lead speed)" in c
    assert "own speed minus 3.3 times the lead speed" in python
    model = onnx.load_from_string(rules_to_onnx(rule_set))
    properties = {
        one.key: json.loads(one.value) for one in model.metadata_props if one.key == "derived"
    }
    assert {"terms", "formula"} <= {key for one in properties["derived"] for key in one}


def test_what_is_read_says_what_formulas_are() -> None:
    rule_set = mined(continuous=False, formulas=True)
    assert "  time to collision (s) = gap / (own speed - lead speed)\n" in rule_set.to_text()
    markdown = rules_to_markdown(rule_set)
    formula = markdown_text("time to collision (s) = gap / (own speed - lead speed)")
    assert f"\n- {formula}\n" in markdown
    plain = mined(continuous=False, formulas=False)
    assert "Formulas" not in plain.to_text() + rules_to_markdown(plain)


def test_what_no_rule_asks_about_is_not_worked_out() -> None:
    rule_set = mined(continuous=False, formulas=False)
    alone = replace(rule_set[0], conditions=(Condition(5, ">", 0.25), Condition(0, "<=", 0.5)))
    c = rules_to_c(replace(rule_set, rules=(alone,)))
    assert "x[4] = (float)t1;" in c
    assert "x[5]" not in c
    plain = replace(alone, conditions=alone.conditions[1:])
    assert "derive" not in rules_to_python(replace(rule_set, rules=(plain,)))


def test_rules_without_derived_features_are_exported_as_before() -> None:
    made = demonstrations(continuous=False, ratios=(0.5,), formulas=False)
    plain = mine_rules(made.deriving(()), supp_min=0.01, conf_min=0.9)
    assert "contract" not in rules_to_c(plain)
    assert "derive" not in rules_to_python(plain)


@pytest.mark.parametrize("formulas", [False, True])
def test_the_vectors_tell_a_comparison_that_is_turned_round_or_misses_its_threshold(
    formulas: bool,
) -> None:
    rule_set = mined(continuous=False, formulas=formulas)
    vectors = make_vectors(rule_set)
    valid = ~vectors.invalid
    code = rules_to_python(rule_set)
    queries = list(re.finditer(r"if x\[(\d+)\] <= (-?[\d.e+-]+):", code))
    assert len(queries) > 10

    def is_seen(query: re.Match[str], comparison: str, threshold: float) -> bool:
        other = f"if x[{query[1]}] {comparison} {threshold!r}:"
        names: dict[str, Any] = {}
        exec(code[: query.start()] + other + code[query.end() :], names)
        rows = zip(vectors.states[valid], vectors.proposed[valid], strict=True)
        rules = [names["shield"](state.tolist(), int(action[0]))[1] for state, action in rows]
        return bool((np.array(rules) != vectors.rules[valid]).any())

    turned = [is_seen(query, ">", float(query[2])) for query in queries]
    moved = [is_seen(query, "<=", float(query[2]) * 1.1) for query in queries]
    assert all(turned)
    # Some rules lie nowhere at the threshold of a query on the way to them.
    assert np.mean(moved) > 0.7
