"""A state with a missing number: one by one and in a batch, it takes the same way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sarl_core import Shield, mine_rules


def test_a_missing_number_is_above_every_threshold_one_by_one_and_in_a_batch(lander_like):
    rule_set = mine_rules(lander_like, supp_min=0.0, conf_min=1.0)
    shield = Shield(rule_set)
    states = lander_like.observations[:300].copy()
    holes = np.random.default_rng(0).random(states.shape) < 0.2
    states[holes] = np.nan
    actions = np.zeros(len(states), dtype=np.int64)

    together = shield.decide_batch(states, actions)

    applies = np.array([rule.applies(states) for rule in rule_set.rules])
    expected = np.where(applies.any(axis=0), applies.argmax(axis=0), -1)
    assert np.array_equal(together.rules[:, 0], expected)
    for row, state in enumerate(states):
        alone = shield.decide(state, 0)
        assert alone.rules == (None if expected[row] < 0 else int(expected[row]),)
        assert alone.margin == together.margin[row]


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
