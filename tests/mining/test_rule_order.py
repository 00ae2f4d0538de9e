"""Rules that are put into the order of what they meet say of every state what they said."""

from dataclasses import replace

import numpy as np
import pytest

from sarl_core import Demonstrations, Shield, mine_rules
from sarl_core.errors import InputError
from sarl_core.explaining.exports.export import prepare
from sarl_core.explaining.report.tally import tally
from sarl_core.mining.editing.difference import comparable
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.rule_order import fitting, rules_for
from sarl_core.mining.validation.holding_out import with_held_out, with_untried_held_out
from sarl_core.mining.validation.stability import rule_stability
from sarl_core.shielding.disagreement import disagreement

NAMES = ("height", "speed", "tilt", "load")
ORDER = (2, 0, 3, 1)


def recording(names=NAMES, *, actions=("lift", "turn"), env_id="", seed=3):
    rng = np.random.default_rng(seed)
    states = rng.normal(size=(600, 4)).astype(np.float32)
    acts = np.stack([states[:, 0] + states[:, 2], states[:, 1] - states[:, 3]], axis=1)
    return Demonstrations(
        states,
        acts.astype(np.float32),
        np.repeat(np.arange(20), 30),
        feature_names=names,
        action_names=actions,
        action_low=(-6.0, -6.0),
        action_high=(6.0, 6.0),
        env_id=env_id,
    )


def permuted(shown):
    """The same pairs with features and actions in another order."""
    return replace(
        shown,
        observations=shown.observations[:, ORDER],
        actions=shown.actions[:, ::-1],
        feature_names=tuple(shown.feature_names[place] for place in ORDER),
        action_names=shown.action_names[::-1],
        action_low=shown.action_low[::-1],
        action_high=shown.action_high[::-1],
    )


SHOWN = recording()
MOVED = permuted(SHOWN)
RULES = with_boxes(mine_rules(SHOWN, supp_min=0.01, conf_min=0.9, divider=3), SHOWN)


def test_every_decision_is_the_same_in_the_other_order():
    fitted = rules_for(RULES, MOVED)
    assert [rule.id for rule in fitted.rule_set.rules] == [rule.id for rule in RULES.rules]
    assert tuple(one.name for one in fitted.rule_set.source.features) == MOVED.feature_names
    assert len(fitted.notes) == 2
    proposed = np.random.default_rng(0).uniform(-6, 6, size=(600, 2)).astype(np.float32)
    for outside in ("act", "abstain"):
        before = Shield(RULES, outside=outside).decide_batch(SHOWN.observations, proposed)
        after = Shield(fitted.rule_set, outside=outside).decide_batch(
            MOVED.observations, proposed[:, ::-1]
        )
        np.testing.assert_array_equal(before.executed[:, ::-1], after.executed)
        np.testing.assert_array_equal(before.rules[:, ::-1], after.rules)
        np.testing.assert_array_equal(before.outside, after.outside)
        assert before.intervened.any()


def test_whoever_counts_rules_on_demonstrations_takes_them_by_name():
    here, there = tally(RULES, SHOWN), tally(RULES, MOVED)
    assert here.shares == there.shares
    tried, moved = with_held_out(RULES, SHOWN), with_held_out(RULES, MOVED)
    assert [rule.held_out for rule in tried.rules] == [rule.held_out for rule in moved.rules]
    half = replace(
        tried, rules=(*tried.rules[:3], *(replace(one, held_out=None) for one in tried.rules[3:]))
    )
    again = with_untried_held_out(half, MOVED)
    assert [rule.held_out for rule in again.rules] == [rule.held_out for rule in tried.rules]
    assert [rule.box for rule in with_boxes(RULES, MOVED).rules] == [
        rule.box for rule in rules_for(RULES, MOVED).rule_set.rules
    ]
    assert prepare(RULES, demonstrations=MOVED).changed == 0


def test_stability_is_the_same_under_another_order():
    plain = mine_rules(SHOWN, supp_min=0.05, conf_min=0.8, divider=2)
    found = [rule_stability(plain, shown, rounds=2, seed=1) for shown in (SHOWN, MOVED)]
    assert [one.overlap for one in found[0].rules] == [one.overlap for one in found[1].rules]


def test_two_rule_sets_are_compared_by_name():
    moved = rules_for(RULES, MOVED).rule_set
    assert comparable(RULES, moved).rule_set == RULES
    found = disagreement(RULES, moved, SHOWN.observations)
    assert not found.different
    between = found.difference
    assert (between.added, between.removed, between.changed) == ((), (), ())


def test_other_names_do_not_fit():
    other = replace(SHOWN, feature_names=("a", "b", "c", "d"))
    assert fitting(RULES, other) is None
    with pytest.raises(InputError, match=r"height, speed, tilt, load.*a, b, c, d"):
        tally(RULES, other)
    with pytest.raises(InputError, match="action dimensions"):
        rules_for(RULES, replace(SHOWN, action_names=("up", "round")))


def test_names_that_say_nothing_are_trusted():
    nameless = replace(SHOWN, feature_names=None, action_names=None)
    fitted = rules_for(RULES, nameless)
    assert fitted.rule_set is RULES
    assert all("no names" in note for note in fitted.notes)
    assert len(fitted.notes) == 2


def test_what_rules_were_mined_from_fits_them_without_a_word():
    assert rules_for(RULES, SHOWN) == (RULES, ())
    bare = replace(SHOWN, feature_names=None)
    assert rules_for(mine_rules(bare, supp_min=0.1, conf_min=0.9), bare).notes == ()


def test_rules_of_one_environment_may_be_renamed():
    known = recording(env_id="Crane-v0")
    rules = mine_rules(known, supp_min=0.05, conf_min=0.8)
    renamed = recording(("Höhe", "Tempo", "Neigung", "Last"), env_id="Crane-v0")
    fitted = rules_for(rules, renamed)
    assert fitted.rule_set is rules
    assert "'height' for 'Höhe'" in fitted.notes[0]
