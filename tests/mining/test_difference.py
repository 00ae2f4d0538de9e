from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core import InputError, RuleSet
from sarl_core.demonstrations.dataset import Feature
from sarl_core.mining.editing.difference import comparable, rule_difference
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import Condition, Rule, Thresholds
from sarl_core.mining.tree import Source

ACTIONS = (LabelledDimension("push", ("left", "right")),)
SOURCE = Source("CartPole-v1", (Feature("angle", "rad"), Feature("speed", "m/s")), "d", 100, 2)
STATES = (np.arange(200).reshape(100, 2) / 100).astype(np.float32)  # angle 0, 0.02 ... 1.98


def rule(name: str, *conditions: tuple[int, str, float], action: int = 0, **more) -> Rule:
    queries = tuple(Condition(*one) for one in conditions)  # type: ignore[arg-type]
    return Rule(name, 0, queries, action, 0.1, 0.9, 1.0, 10, **more)


def rules(*members: Rule, **more) -> RuleSet:
    given = RuleSet(members, ACTIONS, SOURCE, Thresholds(0.1, 0.9))
    return replace(given, **more)


def reach(rule_set: RuleSet):
    pairs = [
        (index, row)
        for index, one in enumerate(rule_set.rules)
        for row in np.flatnonzero(one.applies(STATES)).tolist()
    ]
    found = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def compare(first: RuleSet, second: RuleSet):
    return rule_difference(first, second, (reach(first), reach(second)), states=len(STATES))


LOW, HIGH = rule("0.1", (0, "<=", 1.0)), rule("0.2", (0, ">", 1.0), action=1)


def test_rules_that_ask_the_same_are_the_same_under_any_name_and_path():
    detour = rule("0.7", (0, "<=", 1.5), (0, "<=", 1.0))
    found = compare(rules(LOW, HIGH), rules(HIGH, detour))
    assert (found.added, found.removed, found.changed, found.same) == ((), (), (), 2)


def test_what_only_one_has_was_added_or_removed():
    found = compare(rules(LOW), rules(HIGH))
    assert (found.added, found.removed, found.changed) == ((HIGH,), (LOW,), ())


@pytest.mark.parametrize(
    ("after", "what"),
    [
        (replace(LOW, action=1), ("action",)),
        (replace(LOW, enabled=False), ("switched",)),
        (replace(LOW, pinned=True), ("place",)),
        (replace(LOW, origin="manual"), ("origin",)),
        (replace(LOW, conditions=(Condition(0, "<=", 1.2),)), ("conditions",)),
        (replace(LOW, enabled=False, action=1), ("action", "switched")),
        (replace(LOW, confidence=0.5, samples=3, id="0.99"), ()),
    ],
)
def test_what_changed_is_named(after, what):
    found = compare(rules(LOW, HIGH), rules(after, HIGH))
    assert (found.added, found.removed) == ((), ())
    if what:
        assert found.changed == ((LOW, after, what),)
        assert found.same == 1
    else:
        assert (found.changed, found.same) == ((), 2)


def test_the_partner_shares_more_than_half_of_the_states_of_both():
    # 51 states below 1.0. Of the candidates one has 26 of them and no other, one 40.
    near, far = rule("0.8", (0, "<=", 0.78)), rule("0.9", (0, ">", 0.79), (0, "<=", 1.4))
    found = compare(rules(LOW), rules(far, near))
    assert [(one.before.id, one.after.id) for one in found.changed] == [("0.1", "0.8")]
    assert found.added == (far,)
    small = rule("0.8", (0, "<=", 0.4))
    found = compare(rules(LOW), rules(small))
    assert (found.added, found.removed, found.changed) == ((small,), (LOW,), ())


def test_of_two_that_overlap_the_larger_share_is_taken_first():
    ours = rules(rule("0.1", (0, "<=", 1.0)), rule("0.2", (0, "<=", 0.7), origin="manual"))
    theirs = rules(rule("0.5", (0, "<=", 0.98)), rule("0.6", (0, "<=", 0.76), origin="manual"))
    found = compare(ours, theirs)
    assert [(one.before.id, one.after.id) for one in found.changed] == [
        ("0.1", "0.5"),
        ("0.2", "0.6"),
    ]


def test_rules_of_different_action_dimensions_are_never_partners():
    two = (*ACTIONS, ACTIONS[0])
    other = replace(rule("1.1", (0, "<=", 0.98)), dimension=1)
    found = compare(rules(LOW, actions=two), rules(other, actions=two))
    assert (found.added, found.removed) == ((other,), (LOW,))


def test_without_a_state_the_path_tells_where_it_is_the_only_one():
    far, further = rule("0.1", (0, ">", 50.0)), rule("0.4", (0, ">", 60.0))
    found = compare(rules(far), rules(further))
    assert [(one.before.id, one.after.id, one.what) for one in found.changed] == [
        ("0.1", "0.4", ("conditions",))
    ]
    several = rules(further, rule("0.5", (0, ">", 70.0)))
    found = compare(rules(far), several)
    assert len(found.added) == 2
    assert found.removed == (far,)
    assert not rule_difference(rules(far), rules(further)).added  # no states at all


def test_the_order_of_placed_rules_is_a_change_and_that_of_mined_ones_is_none():
    one, two, three = (
        rule(f"manual.{n}", (0, ">", n / 10), action=n % 2, origin="manual") for n in (1, 2, 3)
    )
    found = compare(rules(one, two, three, LOW, HIGH), rules(two, one, three, HIGH, LOW))
    assert [(change.before.id, change.what) for change in found.changed] == [
        ("manual.1", ("place",)),
        ("manual.2", ("place",)),
    ]
    # One that went moves nobody.
    assert compare(rules(one, two, three), rules(two, three)).changed == ()


def test_several_rules_with_the_same_conditions_meet_those_that_say_the_same():
    says = [
        rule("manual.1", action=0, origin="manual"),
        rule("manual.2", action=1, origin="manual"),
    ]
    found = compare(rules(*says), rules(replace(says[1], id="a"), replace(says[0], id="b")))
    assert {(one.before.id, one.after.id) for one in found.changed} == {
        ("manual.1", "b"),
        ("manual.2", "a"),
    }
    assert {one.what for one in found.changed} == {("place",)}


def intervals(*edges: float) -> tuple[LabelledDimension, ...]:
    return (LabelledDimension.of_edges("torque", edges),)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"source": replace(SOURCE, env_id="", features=SOURCE.features[:1])}, "features"),
        ({"source": replace(SOURCE, features=SOURCE.features * 2)}, "features"),
        (
            {"source": replace(SOURCE, env_id="x", features=SOURCE.features[::-1])},
            "different features",
        ),
        ({"actions": ACTIONS * 2}, "1 and 2 action dimensions"),
        ({"actions": (replace(ACTIONS[0], label_names=("a", "b", "c")),)}, "different actions"),
        ({"actions": (replace(ACTIONS[0], first=1),)}, "different actions"),
        ({"actions": intervals(-1, 0, 1)}, "same divider"),
    ],
)
def test_sets_for_other_things_are_refused_in_one_sentence(more, words):
    with pytest.raises(InputError, match=words) as caught:
        compare(rules(LOW), rules(LOW, **more))
    assert "\n" not in str(caught.value)


def test_another_divider_is_named_and_new_names_are_no_hindrance():
    with pytest.raises(InputError, match="2 intervals in one rule set and 3 intervals"):
        comparable(rules(actions=intervals(-1, 0, 1)), rules(actions=intervals(-1, 0, 1, 2)))
    with pytest.raises(InputError, match="some edges"):
        comparable(rules(actions=intervals(-1, 0, 1)), rules(actions=intervals(-2, 0, 2)))
    renamed = replace(SOURCE, features=(Feature("tilt", "°"), Feature("pace", "")))
    comparable(rules(), rules(source=renamed, actions=(LabelledDimension("shove", ("l", "r")),)))
