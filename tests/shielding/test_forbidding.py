"""What a shield of never-rules does: one by one, in batches, and as the rules themselves say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gymnasium.spaces import Discrete
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, RuleSet, Shield, grow_policy_trees, mine_rules
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.never.never_rules import mine_never_rules, with_never_rules
from sarl_core.shielding.leeway import allowed_actions, labels_left, leeway_of
from tests.mining.strategies import labelled_states


def ruled(rules: RuleSet, state: np.ndarray, label: int, dimension: int = 0):
    """Rule in force, label to execute and labels allowed, as the rules' own words have it."""
    applying = [
        (index, rule)
        for index, rule in enumerate(rules)
        if rule.dimension == dimension and rule.enabled and rule.applies(state[None])[0]
    ]
    demanding = [(index, rule) for index, rule in applying if not rule.forbids]
    if demanding:
        return demanding[0][0], demanding[0][1].action, 1
    count = rules.actions[dimension].n_labels
    forbidden = {one for _, rule in applying for one in rule.forbids}
    allowed = max(count - len(forbidden), 1)
    broken = [(index, rule) for index, rule in applying if label in rule.forbids]
    if not broken:
        return (applying[0][0] if applying else None), label, allowed
    index, rule = broken[0]
    free = [one for one in rule.instead if one not in forbidden]
    if free:
        return index, free[0], allowed
    _, closest = min(applying, key=lambda entry: (entry[1].samples, entry[0]))
    return index, closest.instead[0], allowed


@settings(max_examples=60)
@given(
    labelled_states(),
    st.floats(0.1, 0.9),
    st.floats(0, 0.3),
    st.one_of(st.none(), st.floats(0.5, 1.0)),
)
def test_one_by_one_in_a_batch_and_by_the_rules_words(shown, epsilon, supp_min, conf_min):
    if len(shown.label_names[0]) < 2:
        return
    trees = grow_policy_trees(shown)
    rules = mine_never_rules(trees, epsilon=epsilon, supp_min=supp_min)
    if conf_min is not None:
        demanding = mine_rules(trees, supp_min=supp_min, conf_min=conf_min)
        rules = with_never_rules(demanding, trees, epsilon)
    shield, count = Shield(rules), rules.actions[0].n_labels
    states = np.repeat(shown.observations, count, axis=0)
    labels = np.tile(np.arange(count), len(shown))
    together = shield.decide_batch(states, labels)
    freedom = shield.freedom(states, together.rules)
    for row, (state, label) in enumerate(zip(states, labels.tolist(), strict=True)):
        alone = shield.decide(state, label)
        rule, executed, allowed = ruled(rules, state, label)
        assert alone.rules == (rule,)
        assert (alone.executed, alone.intervened) == (executed, executed != label)
        assert together.rules[row, 0] == (-1 if rule is None else rule)
        assert together.executed[row] == executed
        assert together.intervened[row] == alone.intervened
        assert together.margin[row] == alone.margin
        assert freedom[row] == pytest.approx(np.log(allowed) / np.log(count))
    passing = allowed_actions(shield, shown.observations, count)
    np.testing.assert_array_equal(passing.reshape(-1), ~together.intervened)
    assert passing.any(axis=1).all()
    in_force = shield.rules_in_force(shown.observations)[:, 0]
    for state, found in zip(shown.observations, in_force.tolist(), strict=True):
        applying = [place for place, rule in enumerate(rules) if rule.applies(state[None])[0]]
        assert found == (applying[0] if applying else -1)


def walk(kind: str = "discrete") -> Demonstrations:
    """Three labels; left of 0 never the first, right of it never the last."""
    rng = np.random.default_rng(1)
    x = rng.uniform(-1, 1, 3_000).astype(np.float32)
    labels = rng.integers(0, 2, len(x)) + (x <= 0)
    actions = labels if kind == "discrete" else (labels * 0.6 - 0.6).astype(np.float32)[:, None]
    names = {"label_names": (("a", "b", "c"),)} if kind == "discrete" else {}
    return Demonstrations(x[:, None], actions, np.arange(len(x)) // 100, **names)


def test_what_is_allowed_passes_as_it_is_and_the_rest_becomes_the_most_frequent():
    shield = Shield(mine_never_rules(walk(), epsilon=0.05, supp_min=0.1))
    state = np.array([-0.5], dtype=np.float32)
    frequent = int(np.bincount(walk().actions[walk().observations[:, 0] <= 0]).argmax())
    for label in (1, 2):
        assert not shield.decide(state, label).intervened
    decision = shield.decide(state, 0)
    assert (decision.executed, decision.intervened) == (frequent, True)
    assert type(decision.executed) is int
    assert shield.decide(state, np.int64(0)).executed.dtype == np.int64


@pytest.mark.parametrize("projection", ["centre", "clip", "expert"])
def test_a_forbidden_interval_is_left(projection):
    shown = walk("continuous")
    rules = mine_never_rules(shown, epsilon=0.05, supp_min=0.1, divider=3)
    shield = Shield(rules, projection=projection)
    states = np.array([[-0.5], [-0.5], [0.5], [0.5]], dtype=np.float32)
    proposed = np.array([[-0.6], [0.55], [0.6], [-0.55]], dtype=np.float32)
    together = shield.decide_batch(states, proposed)
    assert together.intervened.tolist() == [True, False, True, False]
    (dimension,) = rules.actions
    for row in range(4):
        alone = shield.decide(states[row], proposed[row])
        assert alone.executed == together.executed[row]
        rule = rules[int(together.rules[row, 0])]
        assert rule.obeyed_by(dimension.labels_of(together.executed[row])).all()
    assert (together.executed[[1, 3]] == proposed[[1, 3]]).all()


def test_outside_its_data_a_rule_may_abstain():
    rules = with_boxes(mine_never_rules(walk(), epsilon=0.05, supp_min=0.1), walk())
    state = np.array([-7.0], dtype=np.float32)
    acting, abstaining = Shield(rules), Shield(rules, outside="abstain")
    decision = acting.decide(state, 0)
    assert (decision.executed != 0, decision.intervened, decision.outside) == (True, True, True)
    assert decision.margin == pytest.approx(7.0, abs=0.1)  # the rules part at the middle
    decision = abstaining.decide(state, 0)
    assert (decision.executed, decision.intervened, decision.outside) == (0, False, True)
    together = abstaining.decide_batch(state[None], [0])
    assert (together.intervened[0], together.outside[0]) == (False, True)
    in_force = together.rules
    assert abstaining.freedom(state[None], in_force)[0] == 1.0
    assert acting.freedom(state[None], in_force)[0] == pytest.approx(np.log(2) / np.log(3))


@pytest.mark.parametrize("space", [Discrete(5), Discrete(5, start=-1)])
def test_an_action_that_the_rules_do_not_know_passes_alone_and_in_a_batch(space: Discrete):
    shield = Shield(mine_never_rules(walk(), epsilon=0.05, supp_min=0.1)).for_space(space)
    states = np.array([[-0.5], [0.5]], dtype=np.float32)
    for action in set(range(int(space.start), int(space.start) + 5)) - {0, 1, 2}:
        together = shield.decide_batch(states, [action, action])
        assert not together.intervened.any()
        for row, state in enumerate(states):
            alone = shield.decide(state, action)
            assert (alone.executed, alone.rules) == (action, (together.rules[row, 0],))


def test_where_no_rule_is_asked_everything_is_left():
    shield = Shield(mine_never_rules(walk(), epsilon=0.05, supp_min=0.1), on_invalid="pass")
    states = np.array([[np.inf], [np.nan], [-0.5], [-0.5]], dtype=np.float32)
    together = shield.decide_batch(states, [0, 0, 99, 1])
    assert (together.rules[:3] == -1).all()
    freedom = shield.freedom(states, together.rules)
    assert freedom[:3].tolist() == [1.0] * 3
    assert freedom[3] == pytest.approx(np.log(2) / np.log(3))


def test_what_comes_instead_is_of_the_kind_that_was_proposed():
    shield = Shield(mine_never_rules(walk(), epsilon=0.05, supp_min=0.1))
    state = np.array([-0.5], dtype=np.float32)
    executed = shield.decide(state, np.array(0)).executed
    assert isinstance(executed, np.ndarray)
    assert executed.shape == ()


def test_a_rule_that_is_switched_off_forbids_nothing():
    rules = mine_never_rules(walk(), epsilon=0.05, supp_min=0.1)
    off = replace(rules, rules=tuple(replace(rule, enabled=False) for rule in rules))
    assert not Shield(off).decide(np.array([-0.5], dtype=np.float32), 0).intervened


def test_what_rules_leave_is_counted_in_the_pairs():
    rules = mine_never_rules(walk(), epsilon=0.05, supp_min=0.1)
    leeway = leeway_of(rules, walk())
    assert (leeway.coverage, leeway.fidelity) == (1.0, 1.0)
    assert leeway.freedom == pytest.approx(np.log(2) / np.log(3))


def test_each_action_dimension_has_rules_of_its_own():
    rng = np.random.default_rng(4)
    states = rng.uniform(-1, 1, (3_000, 2)).astype(np.float32)
    actions = rng.integers(0, 2, states.shape) + (states <= 0)
    names = (("a", "b", "c"), ("d", "e", "f"))
    shown = Demonstrations(states, actions, np.arange(3_000) // 100, label_names=names)
    rules = mine_never_rules(shown, epsilon=0.05, supp_min=0.1)
    shield = Shield(rules)
    assert {rule.dimension for rule in rules} == {0, 1}
    pairs = np.array([(first, second) for first in range(3) for second in range(3)])
    seen, proposed = np.repeat(states[:30], 9, axis=0), np.tile(pairs, (30, 1))
    together = shield.decide_batch(seen, proposed)
    freedom = shield.freedom(seen, together.rules)
    for row, (state, action) in enumerate(zip(seen, proposed, strict=True)):
        alone = shield.decide(state, action)
        expected = [ruled(rules, state, int(action[one]), one) for one in range(2)]
        assert alone.rules == tuple(rule for rule, _, _ in expected)
        assert alone.executed.tolist() == [label for _, label, _ in expected]
        assert together.executed[row].tolist() == alone.executed.tolist()
        assert together.intervened[row] == alone.intervened == (alone.executed != action).any()
        left = [np.log(allowed) / np.log(3) for _, _, allowed in expected]
        assert freedom[row] == pytest.approx(np.mean(left))


def test_of_several_continuous_actions_only_what_is_forbidden_is_moved():
    rng = np.random.default_rng(5)
    states = rng.uniform(-1, 1, (3_000, 2)).astype(np.float32)
    actions = (rng.uniform(0, 1, states.shape) - (states <= 0)).astype(np.float32)
    bounds = {"action_low": (-1, -1), "action_high": (1, 1)}
    shown = Demonstrations(states, actions, np.arange(3_000) // 100, **bounds)
    shield = Shield(mine_never_rules(shown, epsilon=0.05, supp_min=0.1, divider=2))
    state = np.array([-0.5, 0.5], dtype=np.float32)
    for action, changed in (((-0.3, 0.3), ()), ((0.3, 0.3), (0,)), ((0.3, -0.3), (0, 1))):
        proposed = np.array(action, dtype=np.float32)
        decision = shield.decide(state, proposed)
        assert tuple(np.flatnonzero(decision.executed != proposed)) == changed
        together = shield.decide_batch(state[None], proposed[None])
        assert together.executed[0].tolist() == decision.executed.tolist()


@settings(max_examples=30, deadline=None)
@given(data=labelled_states(), abstain=st.booleans())
def test_what_is_left_in_a_state_is_what_a_shield_lets_pass(data, abstain: bool) -> None:
    rules = with_boxes(mine_never_rules(data, epsilon=0.6), data)
    shield = Shield(rules, outside="abstain" if abstain else "act")
    states = np.concatenate([data.observations[:5], data.observations[:5] + 3])
    for state in states:
        left = labels_left(shield, state, 0)
        (in_force,) = shield.rules_in_force(state[None])
        assert (left is None) == (in_force[0] < 0)
        if left is None:
            continue
        count = rules.actions[0].n_labels
        actions = [rules.actions[0].actions[label] for label in range(count)]
        passed = [
            label for label in range(count) if not shield.decide(state, actions[label]).intervened
        ]
        assert left.left == tuple(passed)
        assert all(label in rules[rule].forbids for label, rule in left.forbidden)
        (freedom,) = shield.freedom(state[None], in_force[None])
        assert left.freedom == pytest.approx(freedom)
