"""Combinations: which are tried, which are taken, and that every part reads them alike."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, RuleSet, Shield, grow_policy_trees, mine_rules
from sarl_core.auditing.audit import audit
from sarl_core.demonstrations.dataset import formula_feature
from sarl_core.demonstrations.derived import Combination, DerivedFeature, extend
from sarl_core.demonstrations.recoding import recoded
from sarl_core.mining.applications import applications
from sarl_core.mining.combining.candidates import (
    candidates,
    pairs_by_name,
    pairs_of_like_kind,
)
from sarl_core.mining.combining.choice import pairs_chosen_from, with_combinations
from sarl_core.mining.editing.difference import comparable
from sarl_core.mining.editing.renaming import renamed_rules
from sarl_core.mining.editing.shared_words import in_shared_words
from sarl_core.mining.rule_order import rules_for
from sarl_core.mining.rule_set import rules_from_json, rules_to_json
from sarl_core.mining.rules import Condition
from sarl_core.mining.validation.cross_fitting import cross_fit
from sarl_core.shielding.decisions import deciding, ground_of
from sarl_core.shielding.disagreement import disagreement, sampled_states

NAMES = ("position", "velocity", "contact", "noise")
UNITS = ("m", "m/s", "", "")


def demonstrations(seed: int = 0, n: int = 1_500) -> Demonstrations:
    """What the expert does hangs on where it will be in half a second."""
    rng = np.random.default_rng(seed)
    states = rng.normal(size=(n, 4))
    states = (states / states.std(axis=0)).astype(np.float32)
    states[:, 1] *= 2
    states[:, 2] = states[:, 2] > 0
    return Demonstrations(
        states,
        (states[:, 0] + 0.5 * states[:, 1] > 0.1).astype(np.int64),
        np.repeat(np.arange(n // 100), 100),
        feature_names=NAMES,
        feature_units=UNITS,
        label_names=(("left", "right"),),
    )


@pytest.fixture(scope="module")
def combined() -> RuleSet:
    return mine_rules(with_combinations(demonstrations()), supp_min=0.01, conf_min=0.95)


def test_amounts_are_combined_and_flags_are_not() -> None:
    made = demonstrations()
    assert pairs_of_like_kind(made) == ((0, 1), (0, 3), (1, 3))
    possible = candidates(made, [(0, 1)])
    assert [one.ratio for one in possible] == [-1.0, -0.5, -0.25, 0.25, 0.5, 1.0]


def test_ratios_have_two_digits() -> None:
    made = demonstrations()
    wide = Demonstrations(made.observations * np.float32(137.0), made.actions, made.episodes)
    ratios = {one.ratio for one in candidates(wide, [(0, 1), (1, 3)])}
    assert all(float(f"{ratio:.1e}") == ratio != 0.0 for ratio in ratios)


def test_a_feature_that_never_changes_is_combined_with_nothing() -> None:
    made = demonstrations()
    states = np.array(made.observations)
    states[:, 1] = 3.0
    steady = Demonstrations(states[:, :2], made.actions, made.episodes)
    assert candidates(steady, [(0, 1)]) == ()
    with pytest.raises(InputError, match="no two features"):
        with_combinations(steady)


def test_the_combination_that_decides_is_found_and_said(combined: RuleSet) -> None:
    plain = mine_rules(demonstrations(), supp_min=0.01, conf_min=0.95)
    assert len(combined) < len(plain)
    assert combined.coverage > 0.95
    text = combined.to_text()
    assert "the position plus 0.5 s of velocity is at most 0.1" in text
    assert "the position plus 0.5 s of velocity is above 0.1" in text


def test_the_choice_is_the_same_every_time_and_is_not_long() -> None:
    made = demonstrations()
    first, second = with_combinations(made), with_combinations(made)
    assert first.digest == second.digest
    assert 0 < len(first.derived) <= 18
    assert len(with_combinations(made, most=1).derived) == 1
    # What is there already stays, and is not chosen again.
    again = with_combinations(first)
    assert again.derived[: len(first.derived)] == first.derived
    assert len({one.definition for one in again.derived}) == len(again.derived)


def test_pairs_are_named_with_commas() -> None:
    made = demonstrations()
    assert pairs_by_name(made, ["Velocity, position, noise"]) == ((1, 0), (1, 3), (0, 3))
    chosen = with_combinations(made, pairs=[("Velocity", "position")])
    assert all(one.name.startswith("velocity") for one in chosen.features[4:])
    assert chosen.digest == with_combinations(made, pairs=[(1, 0)]).digest


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("position, speed", "'speed' is no feature"),
        ("position, position", "combined with itself"),
        ("position", "names one feature"),
        ("position,", "'' is no feature"),
    ],
)
def test_what_cannot_be_combined_is_refused(text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        pairs_by_name(demonstrations(), [text])


@pytest.mark.parametrize("pair", [(0, 0), (0, 9), (-1, 0)])
def test_pairs_are_of_two_features(pair: tuple[int, int]) -> None:
    with pytest.raises(InputError, match="no two of the 4 features"):
        with_combinations(demonstrations(), pairs=[pair])


def test_a_rule_file_keeps_what_is_derived_in_version_2(combined: RuleSet, tmp_path: Path) -> None:
    combined.save(tmp_path / "rules.json")
    assert RuleSet.load(tmp_path / "rules.json") == combined
    document = json.loads(rules_to_json(combined))
    assert document["version"] == 2
    derived = [one["derived"] for one in document["features"] if "derived" in one]
    assert [[0, 1.0], [1, 0.5]] in [one["terms"] for one in derived]
    plain = mine_rules(demonstrations(), supp_min=0.01, conf_min=0.95)
    assert json.loads(rules_to_json(plain))["version"] == 1


def test_a_combination_in_a_file_is_called_what_it_is(combined: RuleSet) -> None:
    document = json.loads(rules_to_json(combined))
    at = next(i for i, one in enumerate(document["features"]) if "derived" in one)
    document["features"][at]["name"] = "something else"
    assert rules_from_json(json.dumps(document)) == combined


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"version": 1}, "version 1 of the format knows no 'derived'"),
        ({"version": 3}, "version 3"),
        ({"derived": {"terms": [[0, 1.0], [0, 2.0]]}}, "combined with itself"),
        ({"derived": {"terms": [[0, 1.0], [7, 2.0]]}}, "no feature 7"),
        ({"derived": {"terms": [[0, 1.0], [1, 0.0]]}}, "ratio"),
        ({"derived": {"terms": [[0, 1.0], [1, 2.0]], "formula": "position"}}, "either"),
        ({"derived": {}}, "either"),
        ({"derived": {"formula": "position / nothing"}}, "no feature"),
        ({"derived": {"factors": []}}, "factors"),
    ],
)
def test_a_rule_file_that_derives_what_cannot_be_is_refused(
    combined: RuleSet, change: dict[str, object], says: str
) -> None:
    document = json.loads(rules_to_json(combined))
    if "version" in change:
        document |= change
    else:
        document["features"][4] |= change
    with pytest.raises(InputError, match=says) as raised:
        rules_from_json(json.dumps(document))
    assert "\n" not in str(raised.value)
    if "version" not in change:  # of which it is said with which one it came
        assert str(raised.value).count("; ") == 1  # one piece of advice


def test_what_is_observed_stands_first_in_a_rule_file(combined: RuleSet) -> None:
    document = json.loads(rules_to_json(combined))
    document["features"].append({"name": "late", "unit": ""})
    with pytest.raises(InputError, match="stands behind a derived one"):
        rules_from_json(json.dumps(document))


@settings(max_examples=30, deadline=None)
@given(
    ratios=st.lists(
        st.floats(min_value=-50, max_value=50).filter(lambda ratio: abs(ratio) > 0.01),
        min_size=1,
        max_size=3,
    ),
    formula=st.sampled_from(
        [
            "",
            "velocity / max(abs(position), 0.01)",
            "position * velocity - 3",
            "position / noise",
            "(position - contact) / (velocity - velocity * contact)",
        ]
    ),
    seed=st.integers(0, 50),
)
def test_tree_rules_and_shield_read_derived_features_alike(
    ratios: list[float], formula: str, seed: int
) -> None:
    made = demonstrations(seed, 300)
    derived = [DerivedFeature(Combination(((0, 1.0), (1, ratio)))) for ratio in ratios]
    if formula:
        derived.append(formula_feature(f"rate = {formula}", made.observed))
    made = made.deriving(derived)
    trees = grow_policy_trees(made)
    rule_set = mine_rules(trees, supp_min=0.0, conf_min=1.0)
    raw = made.raw_observations
    leaves = trees[0].apply(made.observations)
    says = np.array([rule.action for rule in rule_set])
    shield = Shield(rule_set)
    in_force = shield.rules_in_force(raw)[:, 0]
    assert (in_force >= 0).all()
    assert np.array_equal(says[in_force], trees[0].label[leaves])
    applied = applications(rule_set, raw)
    assert np.array_equal(applied.rule[np.argsort(applied.row)], in_force)
    assert np.array_equal(deciding(ground_of(rule_set, raw)).first[:, 0], in_force)
    for place, rule in enumerate(rule_set):
        rows = rule.applies(extend(raw, rule_set.source.features))
        assert np.array_equal(np.flatnonzero(rows), np.flatnonzero(in_force == place))
    # The same one by one, at other states, and for rules that are tried in their order.
    states = np.random.default_rng(seed).normal(size=(60, 4)).astype(np.float32)
    states[::3, 1] = 0.0
    states[::6, 0] = states[::6, 2] = 0.0
    proposed = np.zeros(60, dtype=np.int64)
    placed = replace(rule_set, rules=tuple(replace(one, pinned=True) for one in rule_set))
    for each in (shield, Shield(placed)):
        many = each.decide_batch(states, proposed)
        for row in range(60):
            one = each.decide(states[row], int(proposed[row]))
            assert one.rules == tuple(None if at < 0 else at for at in many.rules[row].tolist())
            assert one.intervened == many.intervened[row]
            assert one.margin == many.margin[row]
        whole = each.decide_batch(extend(states, rule_set.source.features), proposed)
        assert np.array_equal(whole.rules, many.rules)
    assert np.array_equal(shield.rules_in_force(states), Shield(placed).rules_in_force(states))
    for place, rule in enumerate(rule_set):
        rows = rule.applies(extend(states, rule_set.source.features))
        assert np.array_equal(rows, shield.rules_in_force(states)[:, 0] == place)


def test_rules_in_another_order_derive_the_same(combined: RuleSet) -> None:
    made = demonstrations()
    order = [3, 1, 0, 2]
    other = Demonstrations(
        made.observations[:, order],
        made.actions,
        made.episodes,
        feature_names=tuple(NAMES[place] for place in order),
        feature_units=tuple(UNITS[place] for place in order),
        label_names=made.label_names,
    )
    seen = recoded(other, combined.source.features, called="the log")
    moved = rules_for(combined, seen).rule_set
    assert moved.source.features[4].name == combined.source.features[4].name
    expected = Shield(combined).decide_batch(made.observations, made.actions)
    decided = Shield(moved).decide_batch(other.observations, made.actions)
    assert np.array_equal(decided.rules, expected.rules)
    assert np.array_equal(applications(moved, seen.observations).row, _rows(combined, made))


def _rows(rule_set: RuleSet, made: Demonstrations) -> list[int]:
    return applications(rule_set, made.observations).row.tolist()


def test_rules_under_other_names_speak_of_what_they_derive_by_them(combined: RuleSet) -> None:
    from sarl_core.demonstrations.names import names_of

    names = names_of(demonstrations())._replace(features=("place", "speed", "contact", "noise"))
    assert (
        "the place plus 0.5 s of speed is at most 0.1" in renamed_rules(combined, names).to_text()
    )


def test_rule_sets_that_derive_different_features_are_compared(combined: RuleSet) -> None:
    made = demonstrations()
    plain = mine_rules(made, supp_min=0.01, conf_min=0.95)
    with pytest.raises(InputError, match="derive different features"):
        comparable(combined, plain)
    first, second, _ = in_shared_words(combined, plain)
    assert first is combined
    second = comparable(first, second).rule_set
    result = disagreement(first, second, made.observations)
    assert 0 < result.different < len(made) / 2
    assert in_shared_words(combined, combined).second is combined
    third = replace(plain, rules=())
    other = mine_rules(
        made.deriving([DerivedFeature(Combination(((1, 1.0), (3, -2.0))))]),
        supp_min=0.01,
        conf_min=0.95,
    )
    one, two, _ = in_shared_words(combined, other)
    states = sampled_states([one, two])
    assert states.shape == (10_000, len(one.source.features))
    for before, after in ((combined, one), (other, two)):
        wanted = Shield(before).rules_in_force(states[:, :4])
        assert np.array_equal(Shield(after).rules_in_force(states), wanted)
    assert in_shared_words(third, plain).first is third


def test_a_rule_by_hand_may_ask_about_what_is_derived(combined: RuleSet) -> None:
    place = next(i for i, one in enumerate(combined.source.features) if "0.5 s" in one.name)
    rule = replace(
        combined[0], id="m1", origin="manual", conditions=(Condition(place, ">", 5.0),), action=0
    )
    edited = replace(combined, rules=(rule, *combined.rules))
    state = np.array([3.0, 5.0, 0.0, 0.0], dtype=np.float32)
    assert Shield(edited).decide(state, 1).rules == (0,)
    assert Shield(edited).decide(state, 1).executed == 0
    assert Shield(edited).decide(state, 1).margin == pytest.approx(0.5)


def test_a_fold_has_no_say_in_what_is_combined_for_it() -> None:
    plain = demonstrations()
    pairs = pairs_of_like_kind(plain)
    combined = with_combinations(plain, pairs=pairs)
    fit = cross_fit(combined, combined=pairs, folds=3)
    numbers = set(plain.episodes.tolist())
    for fold in fit.folds:
        without = numbers - set(fold.leaves[0].numbers.tolist())
        own = with_combinations(plain.select(sorted(without)), pairs=pairs)
        assert fold.trees[0].source.features == own.features
    assert pairs_chosen_from(combined, divider=2) == pairs
    assert pairs_chosen_from(plain, divider=2) == ()


def test_features_whose_names_differ_in_capitals_alone_are_two_features() -> None:
    plain = demonstrations()
    alike = replace(plain, feature_names=("x", "v", "contact", "X"))
    apart = replace(plain, feature_names=("x", "v", "contact", "w"))
    for names, others in (("X,v", "w,v"), ("x,v", "x,v"), ("x,X", "x,w")):
        assert pairs_by_name(alike, [names]) == pairs_by_name(apart, [others])
    spaced = replace(plain, feature_names=("x", "v", "contact", "X "))
    assert pairs_by_name(spaced, ["X ,x"]) == ((3, 0),)
    mined = with_combinations(alike)
    assert [one.definition.terms for one in mined.derived] == [
        one.definition.terms for one in with_combinations(apart).derived
    ]
    rules = mine_rules(mined, supp_min=0.01, conf_min=0.95)
    # As a log that was read in another order, with a column more.
    order = [3, 1, 0, 2]
    log = replace(
        plain,
        observations=np.hstack([plain.observations[:, order], plain.observations[:, :1]]),
        feature_names=("X", "v", "x", "contact", "further"),
        feature_units=("", "m/s", "m", "", ""),
    )
    assert audit(rules, log).broken == audit(rules, alike).broken
    seen = recoded(log, rules.source.features, called="the log")
    assert [one.name for one in seen.features[5:]] == [one.name for one in mined.features[4:]]
    assert (seen.observations[:, 5:] == mined.observations[:, 4:]).all()
