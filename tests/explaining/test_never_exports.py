"""What rules forbid is exported as the shield has it: C, Python and ONNX, to the last bit."""

from __future__ import annotations

import csv
import io
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import (
    Demonstrations,
    RuleSet,
    grow_policy_trees,
    load_demonstrations,
    mine_never_rules,
    mine_rules,
)
from sarl_core.explaining.exports.code_c import rules_to_c
from sarl_core.explaining.exports.code_python import rules_to_python
from sarl_core.explaining.exports.export import rules_to_csv
from sarl_core.explaining.exports.markdown import rules_to_markdown
from sarl_core.explaining.exports.vectors import make_vectors, proposed_actions
from sarl_core.mining.action_words import says_label, says_text
from sarl_core.mining.editing.rounding import merged_rules
from sarl_core.mining.language import share_text
from sarl_core.mining.never.never_rules import with_never_rules
from sarl_core.mining.rules import Condition, Rule
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import OnInvalid
from tests.explaining import test_derived_exports as derived
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
from tests.explaining.test_export_code import HOSTILE
from tests.mining.strategies import labelled_states

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


@cache
def forbidding(name: str, divider: int = 2, conf_min: float | None = None) -> RuleSet:
    """Never-rules of shipped demonstrations, alone or behind rules that demand an action."""
    trees = grow_policy_trees(load_demonstrations(DATA / f"{name}.parquet"), divider=divider)
    if conf_min is None:
        return mine_never_rules(trees, epsilon=0.1, supp_min=0.004)
    return with_never_rules(mine_rules(trees, supp_min=0.004, conf_min=conf_min), trees, 0.1)


def of_derived(*, continuous: bool) -> RuleSet:
    """Rules that ask about combinations and formulas, which have no value at times."""
    shown = derived.demonstrations(continuous=continuous, ratios=(0.52, -3.3), formulas=True)
    trees = grow_policy_trees(shown, divider=3)
    demanding = mine_rules(trees, supp_min=0.05, conf_min=0.97)
    return with_never_rules(demanding, trees, 0.2)


@cache
def several_discrete() -> RuleSet:
    """Codes and labels that begin elsewhere than at 0, not the same number of each."""
    rng = np.random.default_rng(2)
    states = rng.normal(size=(3_000, 3)).astype(np.float32)
    codes = np.array([100, 205, 90_000])[rng.integers(0, 2, 3_000) + (states[:, 0] > 0.3)]
    others = -3 + rng.integers(0, 3, 3_000) + 2 * (states[:, 1] > 0)
    shown = Demonstrations(states, np.stack([codes, others], axis=1), np.repeat(np.arange(30), 100))
    return mine_never_rules(shown, epsilon=0.05, supp_min=0.02)


def edited(rules: RuleSet) -> RuleSet:
    """With rules that are off, pinned, forbid several labels, or all of them between them."""
    first, second, *others = rules.rules
    last = rules.actions[0].n_labels - 1
    most = replace(
        second,
        id="most",
        conditions=(Condition(0, ">", 0.0123),),
        forbids=tuple(range(last)),
        instead=(last,),
        action=last,
        pinned=True,
    )
    rest = replace(
        most,
        id="rest",
        conditions=(Condition(1, "<=", 0.3),),
        forbids=(last,),
        instead=tuple(range(last)),
        action=0,
        pinned=False,
    )
    off = replace(first, enabled=False)
    return replace(rules, rules=(rest, off, *others, most, replace(second, pinned=True)))


SETS = {
    "one discrete action": lambda: forbidding("lunar_lander"),
    "behind rules that demand": lambda: forbidding("lunar_lander", conf_min=0.97),
    "merged": lambda: merged_rules(forbidding("lunar_lander", conf_min=0.97)),
    "edited": lambda: edited(forbidding("lunar_lander")),
    "several discrete actions": several_discrete,
    "derived": lambda: of_derived(continuous=False),
    "one continuous action": lambda: forbidding("pendulum", 5),
    "edited, continuous": lambda: edited(forbidding("pendulum", 5)),
    "several continuous actions": lambda: forbidding("bipedal_walker", 4, 0.9),
    "derived, continuous": lambda: of_derived(continuous=True),
}
CASES: list[tuple[str, Projection]] = [
    (name, projection)
    for name in SETS
    for projection in (("centre", "clip", "expert") if "continuous" in name else ("centre",))
]


@pytest.mark.parametrize("on_invalid", ["raise", "pass"])
@pytest.mark.parametrize(("name", "projection"), CASES)
def test_every_vector_and_twenty_thousand_states(
    name: str, projection: Projection, on_invalid: OnInvalid, tmp_path: Path
) -> None:
    rules = SETS[name]()
    vectors = make_vectors(rules, projection, on_invalid)
    rng = np.random.default_rng(5)
    further = random_states(rules, 20_000, rng)[:, : vectors.states.shape[1]]
    states = np.concatenate([vectors.states, further])
    proposed = np.concatenate([vectors.proposed, proposed_actions(rules, 20_000, rng)])
    wanted = expected(rules, projection, states, proposed)
    never = np.array([bool(rule.forbids) for rule in rules] + [False])
    assert (never[wanted.rules].any(axis=1) & wanted.changed).any()
    assert (never[wanted.rules].any(axis=1) & ~wanted.changed).any()
    few = Said(*(column[: len(vectors)] for column in wanted))
    assert same(vectors.rules, few.rules)
    assert same(vectors.executed, few.executed)

    passing = on_invalid == "pass"
    in_c = run_c(rules, projection, states, proposed, tmp_path, on_invalid)
    agree(in_c, wanted, passing=passing)
    assert same(in_c.changed, wanted.changed)
    as_model = run_onnx(rules, projection, states, proposed, on_invalid)
    agree(as_model, wanted, passing=passing)
    in_python = run_python(rules, projection, states[:30_000], proposed[:30_000], on_invalid)
    few = Said(*(column[:30_000] for column in wanted))
    agree(in_python, few, passing=passing, told=not passing)


@settings(max_examples=12, deadline=None)
@given(
    labelled_states(),
    st.floats(0.1, 0.9),
    st.floats(0, 0.3),
    st.one_of(st.none(), st.floats(0.5, 1.0)),
)
def test_exports_agree_on_whatever_was_mined(
    shown: Demonstrations, epsilon: float, supp_min: float, conf_min: float | None
) -> None:
    trees = grow_policy_trees(shown)
    rules = mine_never_rules(trees, epsilon=epsilon, supp_min=supp_min)
    if conf_min is not None:
        demanding = mine_rules(trees, supp_min=supp_min, conf_min=conf_min)
        rules = with_never_rules(demanding, trees, epsilon)
    if not rules.rules:
        return
    vectors = make_vectors(rules)
    wanted = expected(rules, "centre", vectors.states, vectors.proposed)
    agree(run_python(rules, "centre", vectors.states, vectors.proposed), wanted)
    agree(run_onnx(rules, "centre", vectors.states, vectors.proposed), wanted)
    with TemporaryDirectory() as folder:
        agree(run_c(rules, "centre", vectors.states, vectors.proposed, Path(folder)), wanted)


@st.composite
def overlapping(draw: st.DrawFn, continuous: bool) -> RuleSet:
    """Rules of no tree, which forbid one label or several or demand one, in any order."""
    base = forbidding("pendulum", 5) if continuous else forbidding("lunar_lander")
    count, labels = draw(st.integers(1, 12)), range(base.actions[0].n_labels)
    rules = []
    for index in range(count):
        order = draw(st.permutations(labels))
        never = draw(st.integers(0, len(order) - 1))
        rules.append(
            Rule(
                str(index),
                0,
                tuple(
                    Condition(
                        draw(st.integers(0, 1)),
                        draw(st.sampled_from(["<=", ">"])),
                        draw(st.sampled_from([-1.0, -0.1, 0.0, 0.1, 1e-50, 1e300])),
                    )
                    for _ in range(draw(st.integers(0, 3)))
                ),
                order[never],
                0.1,
                1.0,
                1.0,
                draw(st.integers(1, 3)),  # equally many at times
                enabled=index == 0 or draw(st.integers(0, 4)) > 0,
                pinned=draw(st.booleans()),
                demonstrated_value=0.3,
                forbids=tuple(sorted(order[:never])),
                instead=tuple(order[never:]) if never else (),
            )
        )
    return replace(base, rules=tuple(rules))


@settings(max_examples=25, deadline=None)
@given(st.data(), st.sampled_from(["centre", "clip", "expert"]), st.booleans())
def test_exports_agree_on_any_rules_in_any_order(
    data: st.DataObject, projection: Projection, continuous: bool
) -> None:
    rules = data.draw(overlapping(continuous))
    vectors = make_vectors(rules, projection)
    rng = np.random.default_rng(0)
    states = np.concatenate([vectors.states, random_states(rules, 200, rng)])
    proposed = np.concatenate([vectors.proposed, proposed_actions(rules, 200, rng)])
    wanted = expected(rules, projection, states, proposed)
    agree(run_python(rules, projection, states, proposed), wanted)
    agree(run_onnx(rules, projection, states, proposed), wanted)
    with TemporaryDirectory() as folder:
        agree(run_c(rules, projection, states, proposed, Path(folder)), wanted)


def test_a_number_between_codes_is_forbidden_by_nothing(tmp_path: Path) -> None:
    rules = several_discrete()
    vectors = make_vectors(rules)
    states = vectors.states[~vectors.invalid]
    proposed = vectors.proposed[~vectors.invalid].copy()
    proposed[:, 0] = 150
    wanted = expected(rules, "centre", states, proposed)
    assert (wanted.executed[:, 0] == 150).all()
    agree(run_c(rules, "centre", states, proposed, tmp_path), wanted)
    agree(run_python(rules, "centre", states, proposed), wanted)
    agree(run_onnx(rules, "centre", states, proposed), wanted)


@pytest.mark.parametrize("name", ["edited", "several discrete actions", "one continuous action"])
def test_every_label_is_proposed_in_each_state_of_the_vectors(name: str) -> None:
    rules = SETS[name]()
    vectors = make_vectors(rules)
    for index, dimension in enumerate(rules.actions):
        proposed: dict[bytes, set[int]] = {}
        valid = ~vectors.invalid
        labels = dimension.labels_of(vectors.proposed[valid, index]).tolist()
        for state, label in zip(vectors.states[valid], labels, strict=True):
            proposed.setdefault(state.tobytes(), set()).add(label)
        assert all(len(each) == dimension.n_labels for each in proposed.values())
    if name == "one continuous action":
        (dimension,) = rules.actions
        assert set(np.float32(dimension.inner_edges)) <= set(vectors.proposed.ravel().tolist())


def test_code_says_what_is_forbidden_and_what_comes_in_its_place() -> None:
    rules = forbidding("lunar_lander", conf_min=0.97)
    place = next(index for index, rule in enumerate(rules) if rule.forbids == (1,))
    name, never = rules.name_of(rules[place]), "never fire left engine"
    in_c, in_python = rules_to_c(rules), rules_to_python(rules)
    assert "/* engine: the rule that forbids fire left engine. */" in in_c
    assert f"return {place}; /* {name}: {never} */" in in_c
    assert f"return {place}  # {name}: {never}" in in_python
    assert f"{place}: ({rules[place].samples}, {rules[place].instead}),  # {name}: {never}" in (
        in_python
    )


def test_never_rules_that_are_off_leave_the_code_of_the_others(tmp_path: Path) -> None:
    rules = forbidding("lunar_lander", conf_min=0.97)
    off = replace(
        rules, rules=tuple(replace(rule, enabled=not rule.forbids) for rule in rules.rules)
    )
    for text in (rules_to_c(off), rules_to_python(off)):
        assert "never fire left engine, off" in text
        assert "allowed(" not in text
    vectors = make_vectors(off)
    wanted = expected(off, "centre", vectors.states, vectors.proposed)
    agree(run_c(off, "centre", vectors.states, vectors.proposed, tmp_path), wanted)


@pytest.mark.parametrize("hostile", HOSTILE)
def test_names_of_what_is_forbidden_stay_names(hostile: str, tmp_path: Path) -> None:
    base = forbidding("lunar_lander")
    labels = tuple(f"{hostile}{label}" for label in range(4))
    rules = replace(base, actions=(replace(base.actions[0], label_names=labels),))
    vectors = make_vectors(rules)
    wanted = expected(rules, "centre", vectors.states, vectors.proposed)
    agree(run_c(rules, "centre", vectors.states, vectors.proposed, tmp_path), wanted)
    agree(run_python(rules, "centre", vectors.states, vectors.proposed), wanted)


def test_markdown_says_what_the_expert_did_and_did_not() -> None:
    rules = forbidding("lunar_lander", conf_min=0.97)
    document = rules_to_markdown(rules)
    assert "They cover" not in document
    forbid = sum(bool(rule.forbids) for rule in rules)
    assert f"{forbid} of them forbid." in document
    assert "| Rule | If | Then | The expert | States |" in document
    for rule, did in ((rules[0], "did so in"), (rules[-1], "did not in")):
        (line,) = (one for one in document.splitlines() if f"| {rules.name_of(rule)} |" in one)
        action = says_text(rule, rules.actions[0])
        assert f" | {action} | {did} {share_text(rule.confidence)} | {rule.samples:,} |" in line
    probed = replace(rules, rules=(replace(rules[-1], origin="probed"),))
    assert f"| failed after it in {share_text(rules[-1].confidence)} |" in (
        rules_to_markdown(probed)
    )


def test_csv_names_what_is_forbidden() -> None:
    rules = forbidding("lunar_lander")
    rows = list(csv.DictReader(io.StringIO(rules_to_csv(rules))))
    assert [row["action"] for row in rows] == [says_label(rule, rules.actions[0]) for rule in rules]
    assert all(row["action"].startswith("never ") for row in rows)
    assert all(f"then {row['action']}." in row["rule"] for row in rows)
