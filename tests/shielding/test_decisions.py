"""Decisions of edited rule sets, their effects, and where two sets disagree: by brute force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import (
    Demonstrations,
    InputError,
    RuleSet,
    Shield,
    grow_policy_trees,
    mine_rules,
)
from sarl_core.mining.applications import labels_of
from sarl_core.mining.editing.edit_files import edits_from_json, edits_to_json
from sarl_core.mining.editing.edits import Add, Move, Pin, Switch, apply
from sarl_core.mining.editing.manual_rules import Ask, manual_rule
from sarl_core.mining.never.never_rules import mine_never_rules
from sarl_core.mining.rules import Condition, Rule
from sarl_core.shielding.decisions import deciding, ground_of, labels_at, regions
from sarl_core.shielding.disagreement import disagreement, sampled_states
from sarl_core.shielding.effects import change, verdicts
from sarl_core.shielding.leeway import leeway_of


def walk(n: int = 250) -> Demonstrations:
    """Three features, two discrete action dimensions."""
    rng = np.random.default_rng(11)
    states = (rng.integers(0, 40, (n, 3)) / 40).astype(np.float32)
    first = (states[:, 0] > 0.5).astype(int) + (states[:, 1] > 0.3)
    second = (states[:, 2] > 0.6).astype(int)
    noise = rng.random(n) < 0.15
    first[noise] = rng.integers(0, 3, int(noise.sum()))
    return Demonstrations(
        states,
        np.stack([first, second], axis=1),
        np.zeros(n, dtype=int),
        feature_names=("a", "b", "c"),
    )


DATA = walk()
FINE = mine_rules(DATA, supp_min=0.0, conf_min=1.0)
COARSE = mine_rules(DATA, supp_min=0.05, conf_min=0.8)
STATES = np.random.default_rng(2).random((120, 3)).astype(np.float32)


def holds(rule: Rule, state) -> bool:
    return all(
        (float(state[feature]) <= threshold) == (op == "<=")
        for feature, op, threshold in rule.conditions
    )


def in_order(rule_set: RuleSet, state, dimension: int) -> list[int]:
    """Every rule that applies, in the order in which a shield tries them."""
    numbered = list(enumerate(rule_set.rules))
    tried = [pair for pair in numbered if pair[1].placed]
    tried += [pair for pair in numbered if not pair[1].placed]
    return [
        index
        for index, rule in tried
        if rule.enabled and rule.dimension == dimension and holds(rule, state)
    ]


def added(asks: list[Ask], action: int, dimension: int, number: int) -> Add:
    return Add(
        manual_rule(FINE, asks, rule_id=f"manual.{number}", action=action, dimension=dimension)
    )


EDITS = [
    added([Ask("a", ">", 0.2), Ask("b", "<=", 0.7)], 1, 0, 1),
    Pin(COARSE.rules[0]),
    Switch(FINE.rules[3].id, False),
    added([Ask("a", ">", 0.4)], 0, 0, 2),
    Pin(FINE.rules[1]),
    Switch("manual.2", False),
    added([], 1, 1, 3),
    Move("manual.2", up=True),
    Switch(COARSE.rules[0].id, False),
    Switch("manual.2", True),
]


@settings(max_examples=40)
@given(st.lists(st.sampled_from(EDITS), unique=True, max_size=8), st.booleans())
def test_an_edit_decides_as_a_shield_and_as_a_scan_in_order(edits, fine):
    base = FINE if fine else COARSE
    edited = apply(base, edits)
    found = deciding(ground_of(base, STATES), edited)
    shield = Shield(edited).decide_batch(STATES, np.zeros((len(STATES), 2), dtype=np.int64))
    assert np.array_equal(found.first, shield.rules)
    for row, state in enumerate(STATES):
        for dimension in range(2):
            tried = [*in_order(edited, state, dimension), -1, -1]
            assert found.first[row, dimension] == tried[0]
            assert found.second[row, dimension] == tried[1]


def test_rules_of_no_tree_are_tried_in_the_order_of_the_file():
    rules = tuple(
        Rule(f"0.{n}", 0, (Condition(feature, op, threshold),), n % 2, 0.1, 1.0, 1.0, 5)
        for n, (feature, op, threshold) in enumerate(
            [(0, ">", 0.5), (1, "<=", 0.6), (0, "<=", 0.8), (2, ">", 0.1)]
        )
    )
    loose = RuleSet(rules, FINE.actions, FINE.source, FINE.thresholds)
    ground = ground_of(loose, STATES)
    assert ground.in_trees == (False, True)
    for edits in ([], [Switch("0.0", False)], [Pin(rules[3]), Switch("0.1", False)]):
        edited = apply(loose, edits)
        found = deciding(ground, edited)
        for row, state in enumerate(STATES):
            tried = [*in_order(edited, state, 0), -1, -1]
            assert found.first[row].tolist() == [tried[0], -1]
            assert found.second[row, 0] == tried[1]


def test_a_region_is_where_a_rule_applies_whatever_comes_before_it():
    edited = apply(FINE, EDITS)
    rules, rows = regions(ground_of(edited, STATES))
    expected = {
        (index, row)
        for index, rule in enumerate(edited.rules)
        for row, state in enumerate(STATES)
        if holds(rule, state)
    }
    assert set(zip(rules.tolist(), rows.tolist(), strict=True)) == expected
    assert len(rules) == len(expected)


def test_effects_are_what_counting_one_by_one_gives():
    edited = apply(FINE, EDITS)
    ground = ground_of(FINE, DATA.observations)
    expert = labels_of(FINE, DATA)
    assert expert.tolist() == DATA.actions.tolist()
    found = verdicts(ground, edited, expert)
    covered = right = 0
    decided = [0] * len(edited)
    conflicts: dict[tuple[int, int], list[int]] = {}
    for row, state in enumerate(DATA.observations):
        for dimension in range(2):
            tried = in_order(edited, state, dimension)
            if not tried:
                continue
            covered += 1
            decided[tried[0]] += 1
            right += edited.rules[tried[0]].action == DATA.actions[row, dimension]
            if len(tried) > 1 and edited.rules[tried[0]].placed:
                pair = (tried[0], tried[1])
                if len({edited.rules[one].action for one in pair}) == 2:
                    conflicts.setdefault(pair, []).append(row)
    assert found.coverage == pytest.approx(covered / (2 * len(DATA)))
    assert found.fidelity == pytest.approx(right / covered)
    assert found.decided.tolist() == decided
    assert {(one.rule, one.other): one.states for one in found.conflicts} == {
        pair: len(rows) for pair, rows in conflicts.items()
    }
    assert conflicts
    for one in found.conflicts:
        rows = conflicts[one.rule, one.other]
        dimension = edited.rules[one.rule].dimension
        assert one.example in rows
        did = [DATA.actions[row, dimension] for row in rows]
        assert one.right == did.count(edited.rules[one.rule].action)
        assert one.other_right == did.count(edited.rules[one.other].action)
    assert sorted((one.states for one in found.conflicts), reverse=True) == [
        one.states for one in found.conflicts
    ]


def test_a_change_counts_states_and_not_dimensions():
    ground = ground_of(COARSE, DATA.observations)
    before = verdicts(ground, COARSE)
    after = verdicts(ground, apply(COARSE, EDITS))
    found = change(before, after)
    old, new = before.labels.tolist(), after.labels.tolist()
    pairs = list(zip(old, new, strict=True))
    assert found.states == len(DATA)
    assert found.different == sum(one != other for one, other in pairs)
    assert found.by_dimension == tuple(
        sum(one[at] != other[at] for one, other in pairs) for at in range(2)
    )
    assert found.newly_covered == sum(
        any(was < 0 <= now for was, now in zip(*pair, strict=True)) for pair in pairs
    )
    assert found.newly_uncovered == sum(
        any(now < 0 <= was for was, now in zip(*pair, strict=True)) for pair in pairs
    )
    assert change(before, before) == (len(DATA), 0, (0, 0), 0, 0)
    assert np.isnan(before.fidelity)
    assert before.conflicts == ()


def test_states_of_another_width_are_refused():
    with pytest.raises(InputError, match="3 features and the states have 2"):
        ground_of(FINE, np.zeros((4, 2), dtype=np.float32))


# --- two sets ----------------------------------------------------------------------------------


def test_two_sets_disagree_where_their_shields_do():
    edited = apply(COARSE, EDITS)
    found = disagreement(FINE, edited, STATES)
    nothing = np.zeros((len(STATES), 2), dtype=np.int64)
    says = [
        labels_at(one, Shield(one).decide_batch(STATES, nothing).rules) for one in (FINE, edited)
    ]
    differing = [row for row in range(len(STATES)) if (says[0][row] != says[1][row]).any()]
    assert found.rows.tolist() == differing
    assert found.different == len(differing)
    assert found.share == pytest.approx(len(differing) / len(STATES))
    for dimension in range(2):
        labels = [one[:, dimension].tolist() for one in says]
        n = FINE.actions[dimension].n_labels
        expected = [[0] * (n + 1) for _ in range(n + 1)]
        for one, other in zip(*labels, strict=True):
            expected[one][other] += 1  # -1, no rule, is the last
        assert found.confusion(dimension).tolist() == expected
        kinds = found.kinds(dimension)
        assert sum(kinds) == int(found.differs[:, dimension].sum())
        assert kinds.only_first == sum(row[-1] for row in expected[:-1])
        assert kinds.only_second == sum(expected[-1][:-1])


def test_a_set_agrees_with_itself():
    found = disagreement(FINE, FINE, STATES)
    assert (found.different, found.share) == (0, 0.0)
    assert found.difference.same == len(FINE)
    assert found.difference.added == found.difference.removed == found.difference.changed == ()


def test_sampled_states_lie_around_the_thresholds_and_come_again():
    states = sampled_states([FINE, COARSE], count=500)
    assert states.shape == (500, 3)
    assert states.dtype == np.float32
    assert np.array_equal(states, sampled_states([FINE, COARSE], count=500))
    for feature in range(3):
        asked = [
            condition.threshold
            for rule in FINE.rules + COARSE.rules
            for condition in rule.conditions
            if condition.feature == feature
        ]
        width = max(asked) - min(asked)
        assert states[:, feature].min() < min(asked) < max(asked) < states[:, feature].max()
        assert min(asked) - 0.11 * width < states[:, feature].min()
        assert states[:, feature].max() < max(asked) + 0.11 * width


def test_a_feature_with_one_threshold_or_none_is_sampled_too():
    rule = Rule("0.1", 0, (Condition(1, ">", 4.0),), 0, 0.1, 1.0, 1.0, 5)
    lone = RuleSet((rule,), FINE.actions, FINE.source, FINE.thresholds)
    states = sampled_states([lone], count=200)
    assert (states[:, [0, 2]] == 0).all()
    assert 0 < (states[:, 1] > 4).mean() < 1


def test_rules_that_forbid_say_what_they_leave(lander_like: Demonstrations) -> None:
    trees = grow_policy_trees(lander_like)
    never = mine_never_rules(trees, epsilon=0.2, supp_min=0.05)
    demanding = mine_rules(trees, supp_min=0.05, conf_min=0.8)
    states = lander_like.observations
    found = disagreement(demanding, never, states)
    shield, count = Shield(never), never.actions[0].n_labels
    left = np.stack(
        [
            ~shield.decide_batch(states, np.full(len(states), label)).intervened
            for label in range(count)
        ],
        axis=1,
    )
    said = found.labels[1][:, 0]
    for row, code in enumerate(said.tolist()):
        there = tuple(np.flatnonzero(left[row]).tolist())
        if code < 0:
            assert len(there) == count
        elif code < count:
            assert there == (code,)
        else:
            assert there == found.choices[0][code - count]
    assert found.choices[0]
    assert found.confusion(0).sum() == len(states)
    np.testing.assert_array_equal(found.differs[:, 0], found.labels[0][:, 0] != said)
    same = disagreement(never, never, states)
    assert same.different == 0
    assert same.difference.same == len(never)
    # Two that forbid different things in the same states are two rules, and not one that changed.
    fewer = replace(never, rules=never.rules[1:])
    assert [rule.id for rule in disagreement(never, fewer, states).difference.removed] == [
        never.rules[0].id
    ]
    assert not disagreement(never, fewer, states).difference.changed


def test_to_forbid_all_but_one_label_is_to_demand_it(lander_like: Demonstrations) -> None:
    demanding = mine_rules(lander_like, supp_min=0.05, conf_min=0.8)
    others = [
        [label for label in range(demanding.actions[0].n_labels) if label != rule.action]
        for rule in demanding
    ]
    forbidding = replace(
        demanding,
        rules=tuple(
            replace(rule, forbids=tuple(some), instead=(rule.action,), demonstrated_value=None)
            for rule, some in zip(demanding.rules, others, strict=True)
        ),
    )
    found = disagreement(demanding, forbidding, lander_like.observations)
    assert found.different == 0
    assert found.difference.same == 0


def test_edits_of_rules_that_forbid_are_counted_as_the_shield_decides() -> None:
    never = mine_never_rules(DATA, epsilon=0.3, supp_min=0.05)
    by_hand = manual_rule(
        never,
        [Ask("a", ">", 0.25)],
        rule_id="manual.1",
        action=None,
        forbids=(2, 0),
        demonstrations=DATA,
    )
    holds = by_hand.applies(DATA.observations)
    assert by_hand.samples == holds.sum()
    assert by_hand.confidence == (DATA.actions[holds, 0] == 1).mean()
    assert (by_hand.forbids, by_hand.instead) == ((0, 2), (1,))
    demands = manual_rule(
        never, [Ask("b", ">", 0.8)], rule_id="manual.2", action=1, demonstrations=DATA
    )
    ground, expert = ground_of(never, DATA.observations), labels_of(never, DATA)
    before = verdicts(ground, never, expert)
    made = [Add(by_hand), Add(demands), Switch(never.rules[0].id, on=False)]
    assert edits_from_json(edits_to_json(made), never, name="edits") == tuple(made)
    edited = apply(never, made)
    after = verdicts(ground, edited, expert)
    for found in (before, after):
        leeway = leeway_of(found.rule_set, DATA)
        assert found.coverage == pytest.approx(leeway.coverage)
        assert found.fidelity == pytest.approx(leeway.fidelity)
        assert found.freedom == pytest.approx(leeway.freedom)
    deciding_by_hand = demands.applies(DATA.observations)
    places = {rule.id: at for at, rule in enumerate(edited.rules)}
    assert after.decided[places["manual.2"]] == deciding_by_hand.sum()
    assert after.decided[places["manual.1"]] == (holds & ~deciding_by_hand).sum()
    assert after.decided[places[never.rules[0].id]] == 0
    differs = disagreement(never, edited, DATA.observations).differs
    assert change(before, after).by_dimension == tuple(differs.sum(axis=0).tolist())


@pytest.mark.parametrize(
    ("forbids", "problem"),
    [((0, 1, 2), "leave one at least"), ((3,), "has no label 3"), ((), "has no action")],
)
def test_what_nobody_can_forbid_is_refused(forbids: tuple[int, ...], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        manual_rule(FINE, [], rule_id="manual.1", action=None, forbids=forbids)


def test_a_rule_says_what_to_do_or_what_not_to_do() -> None:
    with pytest.raises(InputError, match=r"what to do .* and what not to do; choose one of them"):
        manual_rule(FINE, [], rule_id="manual.1", action=1, forbids=(0,))
