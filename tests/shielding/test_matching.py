"""A state with a missing number: one by one and in a batch, it takes the same way."""

from __future__ import annotations

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
