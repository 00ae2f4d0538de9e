from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core import Shield, mine_rules
from sarl_core.shielding.sampling import Span, feature_spans, random_state, within


@pytest.mark.parametrize("covered", [True, False])
def test_a_random_state_is_covered_or_not_and_the_same_for_its_seed(lander_like, covered):
    rules = mine_rules(lander_like, supp_min=0.005, conf_min=0.9)
    shield = Shield(rules)
    states = {}
    for seed in range(5):
        state = random_state(shield, lander_like.observations, covered=covered, seed=seed)
        again = random_state(shield, lander_like.observations, covered=covered, seed=seed)
        assert state.tolist() == again.tolist()
        assert (shield.decide(state, 0).rules[0] is not None) == covered
        assert (state == lander_like.observations).all(axis=1).any()
        states[seed] = tuple(state.tolist())
    assert len(set(states.values())) > 1


def test_where_every_demonstrated_state_has_a_rule_one_is_put_together(lander_like):
    """Every feature's value was demonstrated, though not together with the others."""
    mined = mine_rules(lander_like, supp_min=0.005, conf_min=0.9)
    covered = np.array([rule.applies(lander_like.observations) for rule in mined.rules]).any(axis=0)
    shown = lander_like.observations[covered]
    shield = Shield(mined)
    state = random_state(shield, shown, covered=False, seed=3)
    assert shield.decide(state, 0).rules == (None,)
    assert not (state == shown).all(axis=1).any()
    assert all(state[index] in shown[:, index] for index in range(8))


def test_rules_that_cover_everything_leave_no_state_without(lander_like):
    mined = mine_rules(lander_like, supp_min=0.0, conf_min=0.0)
    assert mined.rules[0].conditions == ()
    observations = lander_like.observations
    assert random_state(Shield(mined), observations, covered=False, seed=0) is None
    empty = replace(mined, rules=())
    assert random_state(Shield(empty), observations, covered=True, seed=0) is None


def test_spans_reach_from_the_least_to_the_largest_value():
    values = np.array([[1, 7], [2, 7], [9, 7]], dtype=np.float32)
    spans = feature_spans(values)
    assert spans == (Span(1.0, 2.0, 9.0), Span(6.5, 7.0, 7.5))
    assert within(np.array([10, 6], dtype=np.float32), spans).tolist() == [9.0, 6.5]
    inside = np.array([1.5, 7.25], dtype=np.float32)
    assert within(inside, spans).tolist() == inside.tolist()
