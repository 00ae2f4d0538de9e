"""Which rule applies: where a number is missing, and where a rule is taken out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core import InputError, Shield, mine_rules
from sarl_core.shielding import matching


def test_a_state_with_a_missing_number_has_no_rule(lander_like):
    rule_set = mine_rules(lander_like, supp_min=0.0, conf_min=1.0)
    shield = Shield(rule_set, on_invalid="pass")
    states = lander_like.observations[:300].copy()
    holes = np.random.default_rng(0).random(states.shape) < 0.1
    states[holes] = np.nan
    broken = holes.any(axis=1)
    assert 0 < broken.sum() < len(states)

    found = shield.rules_in_force(states)

    applies = np.array([rule.applies(states) for rule in rule_set.rules])
    expected = np.where(applies.any(axis=0), applies.argmax(axis=0), -1)
    assert np.array_equal(found[:, 0], np.where(broken, -1, expected))
    with pytest.raises(InputError, match="is not a number"):
        Shield(rule_set).rules_in_force(states)


def test_where_a_rule_is_taken_out_another_applies_only_if_it_was_scanned(lander_like):
    mined = mine_rules(lander_like, supp_min=0.01, conf_min=0.8)
    pinned = replace(mined.rules[2], pinned=True)
    wide = replace(mined.rules[0], id="m0", origin="manual", conditions=())
    off = replace(wide, id="m1", enabled=False)
    edited = replace(mined, rules=(*mined.rules[:2], pinned, *mined.rules[3:], off, wide))
    shield, states = Shield(edited), lander_like.observations[:500]
    actions = np.zeros(len(states), dtype=np.int64)
    last = len(edited) - 1
    assert Shield(mined).scanned == ()
    assert shield.scanned == (2, last)

    for given, base in ((mined, Shield(mined)), (edited, shield)):
        before = base.decide_batch(states, actions).rules[:, 0]
        for index, rule in enumerate(given.rules):
            rules = list(given.rules)
            rules[index] = replace(rule, enabled=False)
            without = Shield(replace(given, rules=tuple(rules)))
            after = without.decide_batch(states, actions).rules[:, 0]
            if index in base.scanned:
                assert (after[before == index] >= 0).any()
            else:
                assert after.tolist() == np.where(before == index, -1, before).tolist()


def test_mined_rules_of_no_tree_are_all_scanned(lander_like):
    mined = mine_rules(lander_like, supp_min=0.01, conf_min=0.8)
    turned = replace(mined.rules[1], id="x", conditions=mined.rules[1].conditions[::-1][:1])
    rules = (turned, *mined.rules)
    assert Shield(replace(mined, rules=rules)).scanned == tuple(range(len(rules)))


def test_few_states_and_many_are_matched_alike(lander_like, monkeypatch):
    mined = mine_rules(lander_like, supp_min=0.0, conf_min=1.0)
    first = replace(mined.rules[4], pinned=True)
    shield = Shield(replace(mined, rules=(*mined.rules[:4], first, *mined.rules[5:])))
    (matcher,) = shield._matchers
    states = lander_like.observations[:200].copy()
    asked = [one for rule in mined.rules for one in rule.conditions]
    for row, (feature, _, threshold) in enumerate(asked[:60]):
        states[row, feature] = threshold  # on it, where it is a float32 number
    states[60:70, 2], states[70:80, 3] = np.nan, np.inf
    rules, margins = matcher.match_batch(states)
    assert (margins == 0).any()
    assert len(np.unique(rules)) > 20
    assert len(states) > matching._FEW
    monkeypatch.setattr(matching, "_FEW", len(states))
    one_by_one = matcher.match_batch(states)
    assert [one.tobytes() for one in one_by_one] == [rules.tobytes(), margins.tobytes()]
