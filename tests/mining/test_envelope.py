"""The box of a rule's pairs, against NumPy's quantiles of the rows that satisfy its conditions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sarl_core import Demonstrations, InputError, grow_policy_trees, mine_rules
from sarl_core.mining.envelope import box_of, with_boxes
from sarl_core.mining.rule_set import rules_from_json, rules_to_json
from sarl_core.mining.rules import Condition
from tests.mining.strategies import labelled_states


def mined_rule():
    states = np.arange(8, dtype=np.float32)[:, None]
    labels = (states[:, 0] > 3).astype(int)
    return mine_rules(
        Demonstrations(states, labels, np.zeros(8, int)), supp_min=0.0, conf_min=1.0
    ).rules[0]


def expect_boxes(rule_set, demonstrations):
    for rule in rule_set.rules:
        states = demonstrations.observations[rule.applies(demonstrations.observations)]
        if not len(states):
            assert rule.box is None
            continue
        low, high = np.quantile(states.astype(np.float64), [0.01, 0.99], axis=0)
        assert rule.box.least == tuple(states.min(axis=0).tolist())
        assert rule.box.most == tuple(states.max(axis=0).tolist())
        assert rule.box.low == pytest.approx(low, rel=1e-12, abs=1e-12)
        assert rule.box.high == pytest.approx(high, rel=1e-12, abs=1e-12)
        ordered = np.array(rule.box)
        assert (np.diff(ordered, axis=0) >= 0).all()


@settings(max_examples=60)
@given(labelled_states())
def test_boxes_of_random_rules_are_the_quantiles_of_their_states(demonstrations):
    for conf_min in (0.5, 1.0):
        expect_boxes(mine_rules(demonstrations, supp_min=0.0, conf_min=conf_min), demonstrations)


def test_boxes_of_real_numbers_and_of_rules_that_a_person_placed(lander_like):
    mined = mine_rules(lander_like, supp_min=0.01, conf_min=0.8)
    expect_boxes(mined, lander_like)
    manual = replace(
        mined.rules[0], id="own", origin="manual", conditions=(Condition(5, ">", 0.5),)
    )
    nowhere = replace(manual, id="none", conditions=(Condition(5, ">", 99.0),))
    mixed = with_boxes(replace(mined, rules=(manual, nowhere, *mined.rules)), lander_like)
    assert mixed.rules[1].box is None
    expect_boxes(mixed, lander_like)


@given(hnp.arrays(np.float32, (40, 2), elements=st.floats(-(2.0**99), 2.0**99, width=32)))
def test_boxes_of_numbers_of_any_size_and_sign(states):
    states[:3, 0] = -0.0, 0.0, -1e-45
    pairs = Demonstrations(states, np.arange(40) % 2, np.zeros(40, int))
    expect_boxes(mine_rules(pairs, supp_min=0.0, conf_min=0.5), pairs)


def test_what_is_no_number_lies_beyond_all_others_whatever_its_sign():
    values = np.array([3.0, -np.nan, -np.inf, np.nan, 0.0, np.inf], dtype=np.float32)
    values[1] = np.copysign(values[1], np.float32(-1))
    everywhere = replace(mined_rule(), conditions=())
    box = box_of(everywhere, values[:, None])
    assert (box.least, np.isnan(box.most).tolist()) == ((float(np.finfo(np.float32).min),), [True])
    finite = box_of(everywhere, values[[0, 2, 4, 5], None])
    assert finite.most == (float(np.finfo(np.float32).max),)


def test_trees_alone_have_no_states_and_so_no_boxes(lander_like):
    rules = mine_rules(grow_policy_trees(lander_like), supp_min=0.01, conf_min=0.8)
    assert all(rule.box is None for rule in rules.rules)
    assert with_boxes(rules, lander_like) == mine_rules(lander_like, supp_min=0.01, conf_min=0.8)


def test_boxes_survive_the_rule_file(lander_like):
    rules = mine_rules(lander_like, supp_min=0.0, conf_min=1.0)
    assert rules_from_json(rules_to_json(rules)) == rules


def test_other_features_are_refused(lander_like):
    rules = mine_rules(lander_like, supp_min=0.01, conf_min=0.8)
    other = Demonstrations(np.zeros((2, 3), np.float32), np.array([0, 1]), np.zeros(2, int))
    with pytest.raises(InputError, match="8 features and the demonstrations have 3"):
        with_boxes(rules, other)


def test_no_rule_has_no_box(lander_like):
    none = mine_rules(lander_like, supp_min=1.0, conf_min=1.0)
    assert with_boxes(none, lander_like).rules == ()
