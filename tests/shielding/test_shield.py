"""The shield against a plain scan of the rule list (the paper's Algorithm 2)."""

from __future__ import annotations

import math
import pickle
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, Shield, mine_rules
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Condition, Rule
from tests.mining.strategies import labelled_states


def scan(rules, state, dimension):
    """Algorithm 2, line by line: the first rule whose conditions all hold."""
    for number, rule in enumerate(rules):
        if rule.dimension != dimension or not rule.enabled:
            continue
        if all(
            (np.float64(state[c.feature]) <= c.threshold) == (c.op == "<=") for c in rule.conditions
        ):
            return number
    return None


def states_around(rules, d, seed=0, n=60):
    """Random states, and states on thresholds and one float32 step to either side."""
    rng = np.random.default_rng(seed)
    states = rng.uniform(-0.5, 2.0, (n, d)).astype(np.float32)
    thresholds = [(c.feature, c.threshold) for rule in rules for c in rule.conditions]
    for _ in range(n):
        state = rng.uniform(-0.5, 2.0, d).astype(np.float32)
        for feature, threshold in thresholds:
            if rng.random() < 0.7:
                at = np.float32(threshold)
                near = [at, np.nextafter(at, np.float32(-9)), np.nextafter(at, np.float32(9))]
                state[feature] = near[rng.integers(3)]
        states = np.vstack([states, state])
    return states


@settings(max_examples=60)
@given(labelled_states(), st.sampled_from([(0.0, 1.0), (0.05, 0.7), (0.2, 0.4), (0.9, 1.0)]))
def test_it_does_what_a_scan_of_the_rules_does(demonstrations, thresholds):
    rules = mine_rules(demonstrations, supp_min=thresholds[0], conf_min=thresholds[1])
    shield = Shield(rules)
    states = states_around(rules.rules, demonstrations.observations.shape[1])
    labels = np.arange(len(states)) % rules.actions[0].n_labels
    batch = shield.decide_batch(states, labels)
    for row, (state, label) in enumerate(zip(states, labels, strict=True)):
        wanted = scan(rules.rules, state, 0)
        decision = shield.decide(state, label)
        assert decision.rules == (wanted,)
        executed = label if wanted is None else rules.rules[wanted].action
        assert decision.executed == executed
        assert decision.intervened == (executed != label)
        assert batch.rules[row, 0] == (-1 if wanted is None else wanted)
        assert batch.executed[row] == executed
        assert batch.intervened[row] == decision.intervened
        assert batch.margin[row] == decision.margin


@settings(max_examples=30)
@given(labelled_states())
def test_the_tree_and_the_shield_agree_bit_for_bit(demonstrations):
    from sarl_core import grow_policy_trees

    (tree,) = grow_policy_trees(demonstrations)
    rules = mine_rules([tree], supp_min=0.0, conf_min=0.0, lift_min=0.0)
    assert len(rules) == 1  # the root qualifies
    rules = mine_rules([tree], supp_min=0.0, conf_min=1.0)
    states = states_around(rules.rules, demonstrations.observations.shape[1], seed=3)
    found = Shield(rules).decide_batch(states, np.zeros(len(states), dtype=int)).rules[:, 0]
    leaves = tree.apply(states)
    for leaf, number in zip(leaves, found, strict=True):
        on_path = [
            n for n, rule in enumerate(rules.rules) if int(rule.id.split(".")[1]) in tree.path(leaf)
        ]
        assert on_path == ([] if number < 0 else [number])


def manual(name, conditions, action, **kwargs):
    return Rule(
        name,
        0,
        tuple(Condition(*c) for c in conditions),
        action,
        0.1,
        1.0,
        1.0,
        5,
        origin="manual",
        **kwargs,
    )


def test_rules_of_a_person_come_first_in_their_order_and_disabled_ones_not_at_all(lander_like):
    mined = mine_rules(lander_like, supp_min=0.01, conf_min=0.8)
    added = (
        *mined.rules,
        manual("m0", [(0, ">", 0.0)], 3, enabled=False),
        manual("m1", [(0, ">", 0.5)], 1),
        manual("m2", [(0, ">", 0.0), (1, "<=", 0.0)], 2),
    )
    pin = 2  # a mined rule that was moved behind those of a person, and before the others
    added = (*added, replace(added[pin], pinned=True))
    added = (*added[:pin], replace(added[pin], enabled=False), *added[pin + 1 :])
    edited = replace(mined, rules=added)
    shield = Shield(edited)
    states = states_around(added, 8, n=250)
    others = [index for index in range(len(mined)) if index != pin]
    order = [len(mined) + 1, len(mined) + 2, len(mined) + 3, *others]
    batch = shield.decide_batch(states, np.zeros(len(states), dtype=int))
    for row, state in enumerate(states):
        place = scan([added[i] for i in order], state, 0)
        wanted = None if place is None else order[place]
        assert shield.decide(state, 0).rules == (wanted,)
        assert batch.rules[row, 0] == (-1 if wanted is None else wanted)
        assert batch.margin[row] == shield.decide(state, 0).margin


def test_mined_rules_that_are_not_of_one_tree_are_scanned_in_order(lander_like):
    mined = mine_rules(lander_like, supp_min=0.01, conf_min=0.8)
    strange = tuple(
        replace(manual(f"s{i}", [(i % 3, ">", 0.1 * i - 0.2)], i % 4), origin="mined")
        for i in range(5)
    )
    shield = Shield(replace(mined, rules=strange))
    states = states_around(strange, 8, n=150)
    found = shield.decide_batch(states, np.zeros(len(states), dtype=int)).rules[:, 0]
    wanted = [scan(strange, state, 0) for state in states]
    assert [shield.decide(state, 0).rules[0] for state in states] == wanted
    assert found.tolist() == [-1 if number is None else number for number in wanted]


def test_a_tree_deeper_than_pythons_calls_is_no_trouble():
    conditions = [(0, ">", float(level)) for level in range(3000)]
    rule = replace(manual("deep", conditions, 1), origin="mined")
    labels = Demonstrations(np.zeros((2, 1)), np.array([0, 1]), np.zeros(2, dtype=int))
    rules = replace(mine_rules(labels, supp_min=0, conf_min=1), rules=(rule,))
    shield = Shield(rules)
    for one in (shield, pickle.loads(pickle.dumps(shield)), deepcopy(shield)):
        above, below = (one.decide(np.array([at], dtype=np.float32), 0) for at in (8e9, 2998.5))
        assert (above.executed, above.margin) == (1, 8e9 - 2999.0)
        assert (below.executed, below.margin) == (0, 0.5)


def test_the_margin_is_to_the_nearest_of_all_thresholds_of_a_path():
    """A rule file may hold a path whose later queries of a feature are the looser ones."""
    conditions = [[(0, "<=", 1.0), (0, "<=", 5.0), (1, ">", -0.0), (1, ">", -3.0)]]
    conditions += [[*conditions[0][:2], (1, "<=", -0.0)], [(0, ">", 1.0), (0, ">", -2.0)]]
    rules = tuple(
        replace(manual(f"r{place}", path, 1), origin="mined")
        for place, path in enumerate(conditions)
    )
    labels = Demonstrations(np.zeros((2, 2)), np.array([0, 1]), np.zeros(2, dtype=int))
    shield = Shield(replace(mine_rules(labels, supp_min=0, conf_min=1), rules=rules))
    assert shield.scanned == ()
    grid = np.array([-1.0, 0.0, 0.5, 1.0, 1.25, 4.0], dtype=np.float32)
    states = np.array([(x, y) for x in grid for y in grid], dtype=np.float32)
    batch = shield.decide_batch(states, np.zeros(len(states), dtype=int))
    for row, state in enumerate(states):
        number = scan(rules, state, 0)
        at = [abs(float(state[f]) - t) for f, _, t in conditions[number]]
        decision = shield.decide(state, 0)
        assert decision.rules == (number,)
        # Nothing lies -0 away from a threshold, one by one or together.
        for margin in (decision.margin, float(batch.margin[row])):
            assert (margin, math.copysign(1.0, margin)) == (min(at), 1.0)


# ---- continuous actions


@pytest.fixture(scope="module")
def joints():
    rng = np.random.default_rng(3)
    observations = rng.normal(size=(1500, 3)).astype(np.float32)
    actions = np.tanh(observations[:, :2] + 0.1 * rng.normal(size=(1500, 2))).astype(np.float32)
    return Demonstrations(
        observations,
        actions,
        np.zeros(1500, dtype=int),
        action_low=(-1.0, -1.0),
        action_high=(1.0, 1.0),
    )


@pytest.mark.parametrize("projection", ["centre", "clip", "expert"])
@pytest.mark.parametrize("divider", [2, 3, 7])
def test_a_replaced_action_carries_the_rules_label(joints, projection, divider):
    rules = mine_rules(joints, supp_min=0.005, conf_min=0.8, divider=divider)
    shield = Shield(rules, projection=projection)
    rng = np.random.default_rng(1)
    states = rng.normal(size=(600, 3)).astype(np.float32)
    actions = rng.uniform(-1, 1, (600, 2)).astype(np.float32)
    edges = np.array(rules.actions[0].edges, dtype=np.float32)
    actions[:200] = rng.choice(edges, (200, 2))
    batch = shield.decide_batch(states, actions)
    assert batch.intervened.any()
    assert batch.executed.dtype == np.float32
    for row in range(600):
        one = shield.decide(states[row], actions[row])
        assert np.array_equal(one.executed, batch.executed[row])
        assert one.executed.dtype == np.float32
        for dimension in range(2):
            number = batch.rules[row, dimension]
            before, after = actions[row, dimension], batch.executed[row, dimension]
            if number < 0:
                assert before == after
                continue
            rule = rules.rules[number]
            assert rules.actions[dimension].label_of(float(after)) == rule.action
            if rules.actions[dimension].label_of(float(before)) == rule.action:
                assert before == after
            elif projection == "centre":
                low, high = rules.actions[dimension].edges[rule.action : rule.action + 2]
                assert after == pytest.approx((low + high) / 2, abs=1e-6)
            elif projection == "expert":
                assert after == pytest.approx(rule.demonstrated_value, abs=1e-6)
            else:
                low, high = rules.actions[dimension].edges[rule.action : rule.action + 2]
                assert abs(after - before) == pytest.approx(
                    min(abs(before - low), abs(before - high)), abs=1e-6
                )


def test_the_centre_around_zero_is_zero(joints):
    rules = mine_rules(joints, supp_min=0.005, conf_min=0.8, divider=3)
    middle = next(rule for rule in rules.rules if rule.action == 1)
    state = next(s for s in joints.observations if middle.applies(s[None])[0])
    executed = Shield(rules).decide(state, np.ones(2, dtype=np.float32)).executed
    assert executed[middle.dimension] == 0.0


def test_clip_never_lands_on_the_wrong_side_of_an_edge():
    # 1/3 is no float32: the nearest one below the edge belongs to the lower interval.
    demonstrations = Demonstrations(
        np.arange(6, dtype=np.float32)[:, None],
        np.array([[-0.9], [-0.8], [0.0], [0.1], [0.9], [0.8]], dtype=np.float32),
        np.zeros(6, dtype=int),
        action_low=(-1.0,),
        action_high=(1.0,),
    )
    rules = mine_rules(demonstrations, supp_min=0.0, conf_min=1.0, divider=3)
    shield = Shield(rules, projection="clip")
    for state in demonstrations.observations:
        for value in (-1.0, 0.0, 1.0):
            decision = shield.decide(state, np.array([value], dtype=np.float32))
            rule = rules.rules[decision.rules[0]]
            assert rules.actions[0].label_of(float(decision.executed[0])) == rule.action


def test_a_compliant_action_is_passed_on_untouched(joints, lander_like):
    rules = mine_rules(joints, supp_min=0.005, conf_min=0.8)
    shield = Shield(rules)
    compliant = 0
    for state, action in zip(joints.observations[:200], joints.actions[:200], strict=True):
        decision = shield.decide(state, action)
        if not decision.intervened:
            assert decision.executed is action
            compliant += any(rule is not None for rule in decision.rules)
    assert compliant > 50
    discrete = Shield(mine_rules(lander_like, supp_min=0.0, conf_min=0.9))
    for state, action in zip(lander_like.observations[:50], lander_like.actions[:50], strict=True):
        decision = discrete.decide(state, action)
        if not decision.intervened:
            assert decision.executed is action


@pytest.mark.parametrize(
    ("kind", "becomes"),
    [
        (int, int),
        (np.int64, np.int64),
        (np.int32, np.int64),
        (np.uint8, np.int64),
        (float, np.int64),
        (np.array, np.ndarray),
    ],
)
def test_a_label_is_executed_in_the_environments_dtype(lander_like, kind, becomes):
    shield = Shield(mine_rules(lander_like, supp_min=0.0, conf_min=1.0))
    state = lander_like.observations[0]
    wanted = shield.decide(state, 0).executed
    for label in range(4):
        decision = shield.decide(state, kind(label))
        assert decision.intervened == (label != wanted)
        assert type(decision.executed) is becomes
        assert np.asarray(decision.executed).dtype == np.int64
        assert decision.executed == wanted


def test_bad_input_is_said_in_a_sentence(lander_like):
    rules = mine_rules(lander_like, supp_min=0.0, conf_min=1.0)
    with pytest.raises(InputError, match="none of centre, clip, expert"):
        Shield(rules, projection="nearest")
    with pytest.raises(InputError, match="8 features"):
        Shield(rules).decide(np.zeros(3), 0)
    with pytest.raises(InputError, match="8 features"):
        Shield(rules).decide_batch(np.zeros((2, 3)), [0, 1])
    with pytest.raises(InputError, match="3 action values for 2 states"):
        Shield(rules).decide_batch(np.zeros((2, 8)), [0, 1, 0])
    empty = RuleSet((), rules.actions, rules.source, rules.thresholds)
    assert Shield(empty).decide(np.zeros(8), 1) == (1, 1, (None,), False, float("inf"), False, None)
    assert len(Shield(empty).decide_batch(np.zeros((0, 8)), np.zeros(0, dtype=int)).executed) == 0


def test_expert_needs_demonstrated_values(joints):
    rules = mine_rules(joints, supp_min=0.01, conf_min=0.8)
    bare = replace(rules, rules=tuple(replace(r, demonstrated_value=None) for r in rules.rules))
    with pytest.raises(InputError, match="'expert'"):
        Shield(bare, projection="expert")


def test_a_rule_by_hand_where_the_expert_never_was_takes_the_centre(joints):
    rules = mine_rules(joints, supp_min=0.01, conf_min=0.8)
    by_hand = Rule("manual.1", 0, (), 0, 0.0, 0.0, 0.0, 0, origin="manual")
    mixed = replace(rules, rules=(by_hand, *rules.rules))
    shield, plain = Shield(mixed, projection="expert"), Shield(rules, projection="expert")
    states = joints.observations[:200]
    wanted = np.full((200, 2), 0.99, dtype=np.float32)
    executed = shield.decide_batch(states, wanted).executed
    assert (executed[:, 0] == -0.5).all()  # of [-1, 0)
    assert np.array_equal(executed[:, 1], plain.decide_batch(states, wanted).executed[:, 1])
    shown = replace(mixed, rules=(replace(by_hand, demonstrated_value=-0.25), *rules.rules))
    assert Shield(shown, projection="expert").decide(states[0], wanted[0]).executed[0] == -0.25
