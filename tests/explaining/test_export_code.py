"""What is exported decides as the shield does: C, Python and ONNX."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, RuleSet, load_demonstrations, mine_rules
from sarl_core.explaining.code_c import rules_to_c
from sarl_core.explaining.code_python import rules_to_python
from sarl_core.explaining.export_program import largest_float32
from sarl_core.explaining.onnx_export import rules_to_onnx
from sarl_core.explaining.test_vectors import make_vectors, proposed_actions, vectors_to_csv
from sarl_core.mining.rounding import merged_rules
from sarl_core.mining.rules import Condition, Rule
from sarl_core.mining.tree import LEAF
from sarl_core.shielding.projection import Projection
from tests.explaining.exported import (
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


@pytest.mark.parametrize(("name", "projection"), CASES)
def test_every_vector_and_a_hundred_thousand_states(
    name: str, projection: Projection, tmp_path: Path
) -> None:
    rules = SETS[name]()
    vectors = make_vectors(rules, projection)
    rng = np.random.default_rng(5)
    states = np.concatenate([vectors.states, random_states(rules, 100_000, rng)])
    proposed = np.concatenate([vectors.proposed, proposed_actions(rules, 100_000, rng)])
    executed, found, changed = expected(rules, projection, states, proposed)
    assert 0 < np.count_nonzero(changed) < len(changed)
    assert same(vectors.rules, found[: len(vectors)])
    assert same(vectors.executed, executed[: len(vectors)])

    in_c = run_c(rules, projection, states, proposed, tmp_path)
    assert same(in_c[0], executed)
    assert same(in_c[1], found)
    assert np.array_equal(in_c[2], changed)
    as_model = run_onnx(rules, projection, states, proposed)
    assert same(as_model[0], executed)
    assert same(as_model[1], found)
    few = slice(0, len(vectors) + 3_000)
    in_python = run_python(rules, projection, states[few], proposed[few])
    assert same(in_python[0], executed[few])
    assert same(in_python[1], found[few])


@given(st.integers(0, 10_000), st.integers(1, 25), st.booleans())
@settings(max_examples=10, deadline=None)
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
    executed, found, _ = expected(rule_set, "centre", states, proposed)
    for answer in (
        run_python(rule_set, "centre", states, proposed),
        run_onnx(rule_set, "centre", states, proposed),
    ):
        assert same(answer[0], executed)
        assert same(answer[1], found)


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
    executed, found, _ = expected(rule_set, "centre", states, proposed)
    assert len(np.unique(found)) > 50
    for answer in (
        run_c(rule_set, "centre", states, proposed, tmp_path),
        run_python(rule_set, "centre", states, proposed),
        run_onnx(rule_set, "centre", states, proposed),
    ):
        assert same(answer[0], executed)
        assert same(answer[1], found)


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


def test_vectors_read_back_as_the_same_numbers() -> None:
    vectors = make_vectors(mined("pendulum", 0.005, 0.95), "clip")
    rows = list(csv.reader(io.StringIO(vectors_to_csv(vectors))))
    assert rows[0] == ["state_0", "state_1", "state_2", "proposed_0", "rule_0", "executed_0"]
    read = np.array(rows[1:], dtype=np.float64)
    assert same(read[:, :3].astype(np.float32), vectors.states)
    assert same(read[:, 3:4].astype(np.float32), vectors.proposed)
    assert same(read[:, 4:5].astype(np.int64), vectors.rules)
    assert same(read[:, 5:].astype(np.float32), vectors.executed)
    assert np.isnan(vectors.states).any()


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
        replace(feature, name=f"{hostile}{index}", unit=hostile)
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
        executed, found, _ = expected(rule_set, "centre", states, proposed)
        for answer in (
            run_c(rule_set, "centre", states, proposed, tmp_path),
            run_python(rule_set, "centre", states, proposed),
        ):
            assert same(answer[0], executed)
            assert same(answer[1], found)
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


def test_an_empty_set_is_refused() -> None:
    base = mined("cartpole", 0.005, 0.95)
    for write in (rules_to_c, rules_to_python, rules_to_onnx, make_vectors):
        with pytest.raises(InputError, match="has no rules, so there is nothing to export"):
            write(replace(base, rules=()))
        off = tuple(replace(rule, enabled=False) for rule in base.rules)
        with pytest.raises(InputError, match="every rule of the rule set is switched off"):
            write(replace(base, rules=off))
