from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, InputError, RuleSet, mine_rules
from sarl_core.mining.editing.edits import (
    Add,
    Change,
    History,
    Move,
    Pin,
    Remove,
    Switch,
    Unpin,
    apply,
    check_edit,
    next_manual_id,
)
from sarl_core.mining.editing.manual_rules import Ask, asks_of, manual_rule


def walk(n: int = 400) -> Demonstrations:
    """Two features in [0, 1); the label is which corner, with some noise."""
    rng = np.random.default_rng(3)
    states = rng.random((n, 2)).astype(np.float32)
    labels = (states[:, 0] > 0.5).astype(int) + 2 * (states[:, 1] > 0.5)
    noise = rng.random(n) < 0.1
    labels[noise] = rng.integers(0, 4, int(noise.sum()))
    return Demonstrations(
        states,
        labels,
        np.zeros(n, dtype=int),
        feature_names=("angle", "speed"),
        label_names=(("rest", "left", "right", "both"),),
    )


DATA = walk()
FINE = mine_rules(DATA, supp_min=0.0, conf_min=1.0)
COARSE = mine_rules(DATA, supp_min=0.1, conf_min=0.8)


def manual(rule_set: RuleSet, *asks: Ask, action: int | None = 1, rule_id: str = "manual.1"):
    return manual_rule(rule_set, asks, rule_id=rule_id, action=action, demonstrations=DATA)


ABOVE = Ask("angle", ">", 0.25)


def ids(rule_set: RuleSet) -> list[str]:
    return [rule.id for rule in rule_set.rules]


def by_id(rule_set: RuleSet, rule_id: str):
    return next(rule for rule in rule_set.rules if rule.id == rule_id)


# --- what each edit does -----------------------------------------------------------------------


def test_without_edits_nothing_is_touched():
    assert apply(FINE, ()) is FINE


def test_a_rule_is_switched_off_and_on_again():
    rule = FINE.rules[4]
    off = apply(FINE, [Switch(rule.id, False)])
    assert [one.id for one in off.rules if not one.enabled] == [rule.id]
    assert ids(off) == ids(FINE)
    assert apply(FINE, [Switch(rule.id, False), Switch(rule.id, True)]) == FINE


def test_placed_rules_come_first_in_the_order_in_which_they_were_placed():
    third, first = FINE.rules[3], FINE.rules[1]
    added = manual(FINE, ABOVE)
    found = apply(FINE, [Pin(third), Add(added), Pin(first)])
    rest = [one for one in ids(FINE) if one not in (third.id, first.id)]
    assert ids(found) == [third.id, "manual.1", first.id, *rest]
    moved = apply(FINE, [Pin(third), Add(added), Pin(first), Move(first.id, up=True)])
    assert ids(moved)[:3] == [third.id, first.id, "manual.1"]
    moved = apply(FINE, [Pin(third), Add(added), Pin(first), Move(third.id, up=False)])
    assert ids(moved)[:3] == ["manual.1", third.id, first.id]
    assert ids(apply(FINE, [Pin(third), Move(third.id, up=True)]))[0] == third.id


def test_a_place_is_among_the_rules_of_one_action_dimension():
    rng = np.random.default_rng(0)
    states = rng.random((60, 2)).astype(np.float32)
    two = Demonstrations(states, rng.integers(0, 2, (60, 2)), np.zeros(60, dtype=int))
    rules = mine_rules(two, supp_min=0.0, conf_min=1.0)
    ours, theirs = rules.of_dimension(0)[:2], rules.of_dimension(1)[0]
    edits = [Pin(ours[0]), Pin(theirs), Pin(ours[1]), Move(ours[1].id, up=True)]
    assert ids(apply(rules, edits))[:3] == [ours[1].id, theirs.id, ours[0].id]


def test_a_pin_holds_a_rule_when_the_thresholds_move():
    rule = next(one for one in COARSE.rules if one.id not in ids(FINE))
    edits = [Pin(rule)]
    found = apply(FINE, edits)
    assert ids(found) == [rule.id, *ids(FINE)]
    assert found.rules[0].pinned
    assert found.rules[0].conditions == rule.conditions
    # And goes with its pin.
    assert ids(apply(FINE, [*edits, Unpin(rule.id)])) == ids(FINE)
    assert apply(COARSE, [*edits, Unpin(rule.id)]) == COARSE


def test_a_rule_that_is_not_there_waits_until_it_comes_back():
    gone = next(one for one in FINE.rules if one.id not in ids(COARSE))
    edits = [
        Switch(gone.id, False),
        Unpin(gone.id),
        Move(gone.id, up=True),
        Remove("manual.7"),
        Change(manual(FINE, ABOVE, rule_id="manual.7")),
    ]
    assert apply(COARSE, edits) == COARSE
    assert not by_id(apply(FINE, edits), gone.id).enabled


def test_a_manual_rule_stays_changes_and_goes():
    added = Add(manual(FINE, ABOVE))
    changed = Change(manual(FINE, Ask("speed", "<=", 0.5), action=2))
    for rule_set in (FINE, COARSE):
        assert ids(apply(rule_set, [added])) == ["manual.1", *ids(rule_set)]
        found = apply(rule_set, [added, changed])
        assert found.rules[0].action == 2
        assert apply(rule_set, [added, changed, Remove("manual.1")]) == rule_set


def test_edits_of_a_file_with_placed_rules_start_from_their_order():
    given_file = apply(FINE, [Pin(FINE.rules[2]), Add(manual(FINE, ABOVE))])
    found = apply(given_file, [Pin(FINE.rules[0]), Move("manual.1", up=True)])
    assert ids(found)[:3] == ["manual.1", FINE.rules[2].id, FINE.rules[0].id]
    unpinned = apply(given_file, [Unpin(FINE.rules[2].id)])
    assert ids(unpinned)[0] == "manual.1"
    assert not by_id(unpinned, FINE.rules[2].id).placed


def test_a_file_keeps_what_a_person_did(tmp_path):
    edits = [Add(manual(FINE, ABOVE)), Pin(FINE.rules[5]), Switch(FINE.rules[6].id, False)]
    edited = apply(FINE, edits)
    edited.save(tmp_path / "edited.json")
    read = RuleSet.load(tmp_path / "edited.json")
    assert read.rules == edited.rules
    assert [rule.origin for rule in read.rules[:2]] == ["manual", "mined"]
    assert read.rules[1].pinned
    assert not by_id(read, FINE.rules[6].id).enabled


# --- undo and redo -----------------------------------------------------------------------------

EDITS = st.one_of(
    st.builds(Switch, st.sampled_from(ids(FINE)), st.booleans()),
    st.builds(Pin, st.sampled_from(FINE.rules)),
    st.builds(Unpin, st.sampled_from(ids(FINE))),
    st.builds(Move, st.sampled_from([*ids(FINE), "manual.1"]), st.booleans()),
    st.just(Change(manual(FINE, ABOVE, action=3))),
    st.just(Remove("manual.1")),
)


@settings(max_examples=60)
@given(st.lists(EDITS, max_size=12))
def test_every_step_is_undone_and_redone(edits):
    history = History()
    seen = [apply(FINE, history.edits)]
    for edit in edits:
        history = history.done(edit)
        seen.append(apply(FINE, history.edits))
    for expected in reversed(seen[:-1]):
        history = history.undo()
        assert apply(FINE, history.edits) == expected
    assert history.undo() == history
    for expected in seen[1:]:
        history = history.redo()
        assert apply(FINE, history.edits) == expected
    assert history.redo() == history
    assert history.edits == tuple(edits)


@settings(max_examples=60)
@given(st.lists(EDITS, max_size=12))
def test_no_edit_loses_or_doubles_a_rule_that_was_mined(edits):
    for rule_set in (FINE, COARSE):
        found = ids(apply(rule_set, edits))
        assert len(found) == len(set(found))
        assert set(ids(rule_set)) <= set(found)


def test_a_new_edit_forgets_what_was_undone():
    one, two = Switch("0.1", False), Switch("0.2", False)
    history = History().done(one).undo().done(two)
    assert history == History((two,))


def test_a_name_is_never_given_twice():
    history = History().done(Add(manual(FINE, ABOVE))).undo()
    assert next_manual_id(FINE) == "manual.1"
    assert next_manual_id(FINE, history) == "manual.2"
    edited = apply(FINE, [Add(manual(FINE, ABOVE, rule_id="manual.2"))])
    assert next_manual_id(edited) == "manual.1"
    assert next_manual_id(edited, history) == "manual.3"


# --- what is refused ---------------------------------------------------------------------------

EDITED = apply(FINE, [Pin(FINE.rules[0]), Add(manual(FINE, ABOVE))])


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (Switch("0.99999", True), "not in force any more"),
        (Pin(FINE.rules[0]), "already"),
        (Unpin(FINE.rules[3].id), "not pinned"),
        (Unpin("manual.1"), "not pinned"),
        (Move(FINE.rules[3].id, up=True), "pin it first"),
        (Move(FINE.rules[0].id, up=True), "is the first"),
        (Move("manual.1", up=False), "is the last"),
        (Remove(FINE.rules[0].id), "was mined"),
        (Change(FINE.rules[0]), "was mined"),
        (Add(manual(FINE, ABOVE)), "already"),
    ],
)
def test_an_edit_that_cannot_be_made_says_why(edit, words):
    with pytest.raises(InputError, match=words) as caught:
        check_edit(EDITED, edit)
    assert "\n" not in str(caught.value)
    # People call a rule by its name, and see its id nowhere.
    assert EDITED.names.get(edit.rule_id, "the rule ") in str(caught.value)
    assert edit.rule_id not in str(caught.value)


def test_an_edit_that_can_be_made_passes():
    for edit in (
        Switch(FINE.rules[3].id, False),
        Pin(FINE.rules[3]),
        Unpin(FINE.rules[0].id),
        Move("manual.1", up=True),
        Remove("manual.1"),
        Change(manual(FINE, Ask("speed", ">", 0.1))),
        Add(manual(FINE, Ask("speed", ">", 0.1), rule_id="manual.2")),
    ):
        check_edit(EDITED, edit)


# --- rules by hand -----------------------------------------------------------------------------


def test_a_manual_rule_is_counted_on_the_demonstrations():
    rule = manual(FINE, Ask("angle", ">", 0.5), Ask("speed", "<=", 0.4))
    states, labels = DATA.observations, DATA.actions
    holds = [i for i in range(len(DATA)) if states[i, 0] > 0.5 and states[i, 1] <= 0.4]
    right = [i for i in holds if labels[i] == 1]
    share = sum(label == 1 for label in labels) / len(DATA)
    assert (rule.samples, rule.correct) == (len(holds), len(right))
    assert rule.support == pytest.approx(len(holds) / len(DATA))
    assert rule.confidence == pytest.approx(len(right) / len(holds))
    assert rule.lift == pytest.approx(len(right) / len(holds) / share)
    assert (rule.id, rule.origin, rule.enabled) == ("manual.1", "manual", True)


def test_a_manual_rule_has_the_box_of_its_states_and_the_box_follows_a_change():
    for threshold in (0.5, 0.7):
        rule = manual(FINE, Ask("angle", ">", threshold), Ask("speed", "<=", 0.4))
        states = DATA.observations
        own = states[(states[:, 0] > threshold) & (states[:, 1] <= 0.4)].astype(np.float64)
        wanted = [own.min(axis=0), *np.quantile(own, [0.01, 0.99], axis=0), own.max(axis=0)]
        np.testing.assert_allclose(np.array(rule.box), wanted, rtol=1e-12)
    nowhere = manual(FINE, Ask("angle", ">", 5.0))
    assert nowhere.box is None
    assert manual_rule(FINE, [ABOVE], rule_id="manual.1", action=0).box is None


def test_it_is_not_counted_on_pairs_that_the_set_is_not_of():
    other = Demonstrations(DATA.observations[:50], DATA.actions[:50], DATA.episodes[:50])
    rule = manual_rule(FINE, [ABOVE], rule_id="manual.1", action=0, demonstrations=other)
    assert (rule.samples, rule.support) == (0, 0.0)
    assert manual_rule(FINE, [ABOVE], rule_id="manual.1", action=0).samples == 0


def test_a_rule_on_a_continuous_action_carries_what_the_expert_did_there():
    rng = np.random.default_rng(1)
    states = rng.random((80, 1)).astype(np.float32)
    torque = (2 * states - 1).astype(np.float32)
    shown = Demonstrations(states, torque, np.zeros(80, dtype=int), feature_names=("angle",))
    rules = mine_rules(shown, supp_min=0.0, conf_min=1.0)
    rule = manual_rule(rules, [ABOVE], rule_id="manual.1", action=1, demonstrations=shown)
    expected = sorted(
        float(value)
        for value, state in zip(torque[:, 0], states[:, 0], strict=True)
        if state > 0.25
    )
    middle = len(expected) // 2
    median = expected[middle] if len(expected) % 2 else sum(expected[middle - 1 : middle + 1]) / 2
    assert rule.demonstrated_value == pytest.approx(median)


def test_several_conditions_on_a_feature_become_one_interval():
    rule = manual(
        FINE, ABOVE, Ask("angle", "<=", 0.9), Ask("speed", ">", 0.1), Ask("angle", ">", 0.4)
    )
    assert [tuple(condition) for condition in rule.conditions] == [
        (0, ">", 0.4),
        (0, "<=", 0.9),
        (1, ">", 0.1),
    ]
    again = manual(FINE, *asks_of(rule, FINE))
    assert again.conditions == rule.conditions


def test_no_condition_is_always():
    rule = manual(FINE)
    assert rule.conditions == ()
    assert rule.samples == len(DATA)


NEXT = float(np.nextafter(np.float32(0.5), np.float32(1)))


@pytest.mark.parametrize(
    ("asks", "words"),
    [
        ([Ask("pace", ">", 1.0)], "no feature 'pace'; the features are angle, speed"),
        ([Ask("angle", ">", None)], "'angle' has no number"),
        ([Ask("angle", ">", float("nan"))], "nan"),
        ([Ask("angle", "<=", float("inf"))], "inf"),
        ([Ask("angle", "<", 1.0)], "neither"),  # type: ignore[arg-type]
        ([Ask("angle", ">", 2.0), Ask("angle", "<=", 1.0)], "above 2 and at most 1"),
        ([Ask("angle", ">", 1.0), Ask("angle", "<=", 1.0)], "above 1 and at most 1"),
        ([Ask("angle", ">", 0.5), Ask("angle", "<=", NEXT - 1e-12)], "32-bit"),
        ([Ask("angle", ">", 1e39)], "32-bit"),
        ([Ask("angle", "<=", -1e39)], "32-bit"),
    ],
)
def test_conditions_that_no_state_meets_or_nobody_knows_are_refused(asks, words):
    with pytest.raises(InputError, match=words) as caught:
        manual(FINE, *asks)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("low", "high", "holds"),
    [(0.5, NEXT, NEXT), (float(np.nextafter(0.5, 0)), 0.5, 0.5), (1e38, 1e39, 3e38)],
)
def test_an_interval_with_a_float32_in_it_is_taken(low, high, holds):
    rule = manual(FINE, Ask("angle", ">", low), Ask("angle", "<=", high))
    assert rule.applies(np.array([[holds, 0.0]], dtype=np.float32)).all()


def test_a_rule_without_an_action_or_one_nobody_knows_is_refused():
    with pytest.raises(InputError, match="no action"):
        manual(FINE, ABOVE, action=None)
    with pytest.raises(InputError, match="no label 4"):
        manual(FINE, ABOVE, action=4)
    with pytest.raises(InputError, match="no action dimension 1"):
        manual_rule(FINE, [ABOVE], rule_id="manual.1", action=0, dimension=1)


def test_a_rule_that_is_there_already_is_refused_but_not_one_that_overrules_it():
    mined = FINE.rules[0]
    asks = asks_of(mined, FINE)
    with pytest.raises(InputError, match=f"^{FINE.name_of(mined)} asks and says the same; pin it"):
        manual(FINE, *reversed(asks), action=mined.action)
    off = apply(FINE, [Switch(mined.id, False)])
    with pytest.raises(InputError, match="switch it on"):
        manual(off, *asks, action=mined.action)
    assert manual(FINE, *asks, action=(mined.action + 1) % 4).samples == mined.samples
    edited = apply(FINE, [Add(manual(FINE, ABOVE))])
    with pytest.raises(InputError, match="move it up"):
        manual(edited, ABOVE, rule_id="manual.2")
    assert manual(edited, ABOVE).id == "manual.1"  # itself, unchanged


def test_a_rule_keeps_its_number_when_it_is_pinned_or_another_is_added():
    own = manual(COARSE, ABOVE)
    second = manual(COARSE, ABOVE, rule_id="manual.2")
    last = COARSE.rules[-1]
    edited = apply(COARSE, [Pin(last), Add(own), Add(second), Move("manual.2", up=True)])
    assert [rule.id for rule in edited.rules[:3]] == [last.id, "manual.2", "manual.1"]
    assert {rule.id: edited.name_of(rule) for rule in edited.rules if rule.origin == "mined"} == {
        rule.id: COARSE.name_of(rule) for rule in COARSE.rules
    }
    assert edited.name_of(own) == f"R{len(COARSE) + 1}"
    assert edited.name_of(second) == f"R{len(COARSE) + 2}"


def test_rules_with_ids_of_somebody_else_are_numbered_as_they_stand():
    rules = tuple(replace(rule, id=f"their {rule.id}.x") for rule in COARSE.rules)
    first = replace(rules[1], pinned=True)
    theirs = replace(COARSE, rules=(first, rules[0], *rules[2:]))
    assert [theirs.name_of(rule) for rule in theirs.rules] == [
        f"R{number + 1}" for number in range(len(rules))
    ]
