"""What is exported decides as the shield does: C, Python and ONNX."""

from __future__ import annotations

import ast
import csv
import io
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import (
    Demonstrations,
    InputError,
    RuleSet,
    Shield,
    load_demonstrations,
    mine_rules,
)
from sarl_core.demonstrations.fields import Indicator
from sarl_core.explaining.exports.code_c import rules_to_c
from sarl_core.explaining.exports.code_python import rules_to_python
from sarl_core.explaining.exports.onnx_model import rules_to_onnx
from sarl_core.explaining.exports.program import largest_float32
from sarl_core.explaining.exports.vectors import make_vectors, proposed_actions, vectors_to_csv
from sarl_core.mining.editing.rounding import merged_rules
from sarl_core.mining.rules import Condition, Rule
from sarl_core.mining.tree import LEAF
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import OnInvalid
from tests.explaining.exported import (
    Said,
    agree,
    expected,
    random_states,
    run_c,
    run_onnx,
    run_python,
    same,
)

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


@cache
def mined(name: str, support: float, confidence: float, divider: int = 2) -> RuleSet:
    demonstrations = load_demonstrations(DATA / f"{name}.parquet")
    return mine_rules(demonstrations, supp_min=support, conf_min=confidence, divider=divider)


@cache
def several_discrete() -> RuleSet:
    """Two discrete dimensions, whose actions begin elsewhere than at 0."""
    rng = np.random.default_rng(2)
    states = rng.normal(size=(800, 3)).astype(np.float32)
    actions = np.stack([-3 + (states[:, 0] > 0), 7 + 2 * (states[:, 1] > 0.3)], axis=1)
    demonstrations = Demonstrations(
        states,
        actions.astype(np.int64),
        np.repeat(np.arange(8), 100),
        label_first=(-3, 7),
        label_names=(("back", "on"), ("low", "middle", "high")),
    )
    return mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)


@cache
def words_and_codes() -> RuleSet:
    """A feature that says which word a column holds, and labels that do not count."""
    rng = np.random.default_rng(3)
    states = rng.normal(size=(800, 3)).astype(np.float32)
    states[:, 0] = states[:, 0] > 0
    codes = np.array([100, 205, 90000])[(states[:, 0] + (states[:, 1] > 0.3)).astype(int)]
    demonstrations = Demonstrations(
        states,
        np.stack([codes, np.where(states[:, 2] > 0, 1, -1)], axis=1),
        np.repeat(np.arange(8), 100),
        feature_names=("mode is heavy", "x", "y"),
        indicators=(Indicator("mode", "heavy", "light"), None, None),
    )
    return mine_rules(demonstrations, supp_min=0.0, conf_min=1.0)


def edited(rules: RuleSet) -> RuleSet:
    """With a rule switched off, one pinned, one by hand that overlaps others, and one wider."""
    first, second, *others = rules.rules
    by_hand = Rule(
        "by hand",
        0,
        (Condition(1, ">", 0.0123), Condition(0, "<=", 0.3), Condition(1, "<=", 2.5)),
        rules.actions[0].n_labels - 1,
        0,
        0,
        0,
        0,
        origin="manual",
        demonstrated_value=0.1 if rules.actions[0].is_interval else None,
    )
    return replace(
        rules,
        rules=(
            replace(first, enabled=False),
            by_hand,
            *others,
            replace(second, pinned=True),
            replace(by_hand, id="wider", conditions=(Condition(2, ">", 0.5),), action=0),
        ),
    )


def always(rules: RuleSet) -> RuleSet:
    """With a rule by hand that applies always."""
    rule = replace(rules.rules[0], id="always", conditions=(), origin="manual")
    return replace(rules, rules=(*rules.rules, rule))


SETS = {
    "one discrete action": lambda: mined("cartpole", 0.001, 0.97),
    "merged": lambda: merged_rules(mined("lunar_lander", 0.002, 0.9)),
    "several discrete actions": several_discrete,
    "words and codes": words_and_codes,
    "edited": lambda: edited(mined("cartpole", 0.002, 0.95)),
    "one continuous action": lambda: mined("pendulum", 0.002, 0.95, 3),
    "several continuous actions": lambda: mined("bipedal_walker", 0.02, 0.9, 3),
    "edited, continuous": lambda: edited(mined("pendulum", 0.005, 0.95, 5)),
    "always": lambda: always(mined("pendulum", 0.005, 0.95)),
}
CASES: list[tuple[str, Projection]] = [
    (name, projection)
    for name in SETS
    for projection in (("centre", "clip", "expert") if "continuous" in name else ("centre",))
]


@pytest.mark.parametrize("on_invalid", ["raise", "pass"])
@pytest.mark.parametrize(("name", "projection"), CASES)
def test_every_vector_and_fifty_thousand_states(
    name: str, projection: Projection, on_invalid: OnInvalid, tmp_path: Path
) -> None:
    rules = SETS[name]()
    vectors = make_vectors(rules, projection, on_invalid)
    rng = np.random.default_rng(5)
    states = np.concatenate([vectors.states, random_states(rules, 50_000, rng)])
    proposed = np.concatenate([vectors.proposed, proposed_actions(rules, 50_000, rng)])
    wanted = expected(rules, projection, states, proposed)
    assert 0 < np.count_nonzero(wanted.changed) < len(wanted.changed)
    assert 0 < np.count_nonzero(wanted.invalid) < len(wanted.invalid) / 2
    few = Said(*(column[: len(vectors)] for column in wanted))
    assert same(vectors.rules, few.rules)
    assert same(vectors.executed, few.executed)
    assert same(vectors.invalid, few.invalid)

    passing = on_invalid == "pass"
    in_c = run_c(rules, projection, states, proposed, tmp_path, on_invalid)
    agree(in_c, wanted, passing=passing)
    assert same(in_c.changed, wanted.changed)
    as_model = run_onnx(rules, projection, states, proposed, on_invalid)
    agree(as_model, wanted, passing=passing)
    count = len(vectors) + 3_000
    in_python = run_python(rules, projection, states[:count], proposed[:count], on_invalid)
    few = Said(*(column[:count] for column in wanted))
    agree(in_python, few, passing=passing, told=not passing)


@given(st.integers(0, 10_000), st.integers(1, 25), st.booleans())
@settings(max_examples=10)
def test_any_rules_in_any_order(seed: int, count: int, by_hand: bool) -> None:
    rng = np.random.default_rng(seed)
    rules = tuple(
        Rule(
            str(index),
            0,
            tuple(
                Condition(
                    int(rng.integers(2)),
                    "<=" if rng.random() < 0.5 else ">",
                    float(rng.choice([rng.normal(), 1e300, -1e300, 0.1, 0.0, 1e-50])),
                )
                for _ in range(rng.integers(0, 5))
            ),
            int(rng.integers(4)),
            0.1,
            1.0,
            1.0,
            1,
            enabled=bool(index == 0 or rng.random() < 0.8),
            origin="manual" if by_hand and rng.random() < 0.5 else "mined",
        )
        for index in range(count)
    )
    base = mined("lunar_lander", 0.005, 0.95)
    rule_set = replace(base, rules=rules)
    vectors = make_vectors(rule_set)
    states = np.concatenate([vectors.states, random_states(rule_set, 100, rng)])
    proposed = proposed_actions(rule_set, len(states), rng)
    wanted = expected(rule_set, "centre", states, proposed)
    agree(run_python(rule_set, "centre", states, proposed), wanted)
    agree(run_onnx(rule_set, "centre", states, proposed), wanted)


def test_a_path_deeper_than_python_can_nest(tmp_path: Path) -> None:
    base = mined("cartpole", 0.005, 0.95)
    deep = tuple(Condition(index % 4, ">", float(index // 4)) for index in range(300))
    rules = tuple(
        replace(
            base.rules[0],
            id=str(length),
            conditions=(*deep[:length], Condition(length % 4, "<=", float(length // 4))),
        )
        for length in range(300)
    )
    rule_set = replace(base, rules=rules)
    rng = np.random.default_rng(0)
    states = (rng.random((500, 4)) * 80).astype(np.float32)
    proposed = proposed_actions(rule_set, len(states), rng)
    wanted = expected(rule_set, "centre", states, proposed)
    assert len(np.unique(wanted.rules)) > 50
    agree(run_c(rule_set, "centre", states, proposed, tmp_path), wanted)
    agree(run_python(rule_set, "centre", states, proposed), wanted)
    agree(run_onnx(rule_set, "centre", states, proposed), wanted)


def test_vectors_stand_at_every_threshold_and_a_step_either_side() -> None:
    rules = mined("lunar_lander", 0.005, 0.95)
    states = make_vectors(rules).states
    infinity = np.float32(np.inf)
    for rule in rules.rules:
        for feature, _, threshold in rule.conditions:
            at = largest_float32(threshold)
            assert float(at) <= threshold < float(np.nextafter(at, infinity))
            for value in (np.nextafter(at, -infinity), at, np.nextafter(at, infinity)):
                assert value in states[:, feature]


def test_every_node_is_reached_and_every_rule_applies_somewhere() -> None:
    from sarl_core.mining.rule_tree import tree_of

    rules = mined("cartpole", 0.001, 0.97)
    vectors = make_vectors(rules)
    assert set(vectors.rules.ravel().tolist()) >= set(range(len(rules)))
    nodes = tree_of(list(enumerate(rules.rules)))
    assert nodes is not None
    reached = set()
    for state in vectors.states:
        place = 0
        while nodes[place].feature != LEAF:
            reached.add(place)
            below = state[nodes[place].feature] <= np.float64(nodes[place].threshold)
            place = nodes[place].left if below else nodes[place].right
    assert reached == {place for place, node in enumerate(nodes) if node.feature != LEAF}


@pytest.mark.parametrize("on_invalid", ["raise", "pass"])
def test_vectors_read_back_as_the_same_numbers(on_invalid: OnInvalid) -> None:
    vectors = make_vectors(mined("pendulum", 0.005, 0.95), "clip", on_invalid)
    header, *rows = csv.reader(io.StringIO(vectors_to_csv(vectors)))
    assert header == [
        *("state_0", "state_1", "state_2", "proposed_0", "rule_0", "executed_0", "invalid")
    ]
    nothing = [row[5] == "" for row in rows]
    assert nothing == (vectors.invalid & (on_invalid == "raise")).tolist()
    read = np.array([[cell or "nan" for cell in row] for row in rows], dtype=np.float64)
    assert same(read[:, :3].astype(np.float32), vectors.states)
    assert same(read[:, 3:4].astype(np.float32), vectors.proposed)
    assert same(read[:, 4:5].astype(np.int64), vectors.rules)
    said = ~np.array(nothing)
    assert same(read[said, 5:6].astype(np.float32), vectors.executed[said])
    assert same(read[:, 6].astype(np.bool_), vectors.invalid)
    assert np.isnan(vectors.states).any()
    assert np.isinf(vectors.states).any()
    assert np.isnan(vectors.proposed).any()


@pytest.mark.parametrize("on_invalid", ["raise", "pass"])
def test_an_export_says_which_choice_it_is_for(on_invalid: OnInvalid) -> None:
    import onnx

    rules = mined("cartpole", 0.005, 0.95)
    said = f"(on_invalid: {on_invalid})"
    assert said in rules_to_c(rules, "centre", on_invalid).split("*/")[0]
    head = ast.get_docstring(ast.parse(rules_to_python(rules, "centre", on_invalid)))
    assert head is not None
    assert said in head
    model = onnx.load_model_from_string(rules_to_onnx(rules, "centre", on_invalid))
    assert said in model.doc_string
    assert {entry.key: entry.value for entry in model.metadata_props}["on_invalid"] == on_invalid


@pytest.mark.parametrize("name", ["one discrete action", "several continuous actions"])
def test_python_refuses_what_the_shield_refuses(name: str) -> None:
    rules = SETS[name]()
    good = [0.0] * len(rules.source.features)
    fits: object = [0.0] * len(rules.actions) if rules.actions[0].is_interval else 1
    names: dict[str, Any] = {}
    exec(compile(rules_to_python(rules), "shield.py", "exec"), names)
    passing: dict[str, Any] = {}
    exec(compile(rules_to_python(rules, "centre", "pass"), "shield.py", "exec"), passing)
    shield = Shield(rules)
    bad: list[tuple[object, object]] = [
        *((state, fits) for state in (good[1:], [*good, 0.0], ["0", *good[1:]], None, "text")),
        *(
            (state, fits)
            for state in ([1e300, *good[1:]], [10**400, *good[1:]], b"\0" * 4 * len(good))
        ),
        *(
            (good, action)
            for action in (None, "text", [], [fits, fits], -0.9, float("nan"), 10**30)
        ),
    ]
    for state, action in bad:
        with pytest.raises(InputError):
            shield.decide(state, action)
        with pytest.raises(ValueError, match="is none that the rules can be asked about"):
            names["shield"](state, action)
        executed, rule = passing["shield"](state, action)
        assert executed is action
        assert rule == [-1] * len(rules.actions)


HOSTILE = (
    "*/ int main(void) { return 7; } /*",
    '\'\'\'"""\nimport os; os._exit(7)\n"""',
    "\\\nraise SystemExit(7)  # \\",
    "??/\n??' ??? ????/",
    "-*- coding: utf-7 -*- +AAo-raise SystemExit(7)",
    "\u202eevil\u2066 \u2028raise SystemExit(7)\x85\x0c\x00",
    "%s {0} %n \ud800",
)


@pytest.mark.parametrize("hostile", HOSTILE)
def test_names_stay_names(hostile: str, tmp_path: Path) -> None:
    base = mined("cartpole", 0.005, 0.95)
    features = tuple(
        replace(
            feature,
            name=f"{hostile}{index}",
            unit=hostile,
            indicator=None if index else Indicator(hostile, hostile, hostile),
        )
        for index, feature in enumerate(base.source.features)
    )
    action = replace(base.actions[0], name=hostile, label_names=(hostile, f"{hostile}2"))
    for rules in (base, merged_rules(base)):
        rule_set = replace(
            rules,
            actions=(action,),
            source=replace(base.source, env_id=hostile, features=features),
            rules=tuple(replace(rule, id=f"{hostile}{rule.id}") for rule in rules.rules),
        )
        rng = np.random.default_rng(0)
        states = random_states(rule_set, 200, rng)
        proposed = proposed_actions(rule_set, 200, rng)
        wanted = expected(rule_set, "centre", states, proposed)
        agree(run_c(rule_set, "centre", states, proposed, tmp_path), wanted)
        agree(run_python(rule_set, "centre", states, proposed), wanted)
        source = rules_to_python(rule_set).encode(errors="replace")
        plain = rules_to_python(rules)
        # As a file, which Python decodes itself: nothing but comments differs.
        tree, other = (compile(code, "shield.py", "exec").co_consts for code in (source, plain))
        assert len(tree) == len(other)


def test_names_in_the_model_are_data() -> None:
    import onnx

    base = mined("cartpole", 0.005, 0.95)
    model = onnx.load_model_from_string(rules_to_onnx(base))
    props = {entry.key: entry.value for entry in model.metadata_props}
    assert props["environment"] == "CartPole-v1"
    assert '"cart position"' in props["features"]


def test_an_export_says_what_its_numbers_stand_for() -> None:
    rules = words_and_codes()
    for source in (rules_to_c(rules), rules_to_python(rules)):
        assert "mode is heavy (1 if so, else 0)" in source
        assert "mode is light" in source  # of the query whether it is at most 0.5
        assert "action 0 90000" in source
    labels = replace(rules.actions[0], label_names=("slow", "fast", "stop"))
    named = replace(rules, actions=(labels, rules.actions[1]))
    for source in (rules_to_c(named), rules_to_python(named)):
        assert "90000  stop" in source


def test_an_empty_set_is_refused() -> None:
    base = mined("cartpole", 0.005, 0.95)
    for write in (rules_to_c, rules_to_python, rules_to_onnx, make_vectors):
        with pytest.raises(InputError, match="has no rules, so there is nothing to export"):
            write(replace(base, rules=()))
        off = tuple(replace(rule, enabled=False) for rule in base.rules)
        with pytest.raises(InputError, match="every rule of the rule set is switched off"):
            write(replace(base, rules=off))
