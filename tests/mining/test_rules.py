from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from sarl_core import Demonstrations, InputError, grow_policy_trees, mine_rules, threshold_landscape
from sarl_core.mining.rules import Bounds, Condition, Rule, node_of
from tests.mining.strategies import labelled_states


def rule(*conditions):
    return Rule("0.1", 0, tuple(Condition(*c) for c in conditions), 1, 0.5, 0.9, 1.2, 10)


def test_several_bounds_on_one_feature_make_one_interval():
    merged = rule((2, "<=", 5.0), (0, ">", 1.0), (2, ">", -1.0), (2, "<=", 3.0), (0, ">", 0.5))
    assert merged.bounds == (Bounds(2, -1.0, 3.0), Bounds(0, 1.0, np.inf))
    assert (merged.length, len(merged.bounds)) == (5, 2)


def test_a_state_on_the_threshold_goes_left():
    states = np.array([[1.0], [np.nextafter(np.float32(1), np.float32(2))]], dtype=np.float32)
    assert rule((0, "<=", 1.0)).applies(states).tolist() == [True, False]
    assert rule((0, ">", 1.0)).applies(states).tolist() == [False, True]


@settings(max_examples=40)
@given(labelled_states())
def test_measures_are_those_of_the_rows(demonstrations):
    for one in mine_rules(demonstrations, supp_min=0.0, conf_min=0.7).rules:
        applies = one.applies(demonstrations.observations)
        right = demonstrations.actions[applies] == one.action
        assert one.samples == applies.sum()
        assert one.support == applies.mean()
        assert one.confidence == right.mean()
        assert one.correct == right.sum()
        assert one.lift == pytest.approx(
            right.mean() / (demonstrations.actions == one.action).mean()
        )


def test_a_continuous_rule_remembers_the_median_shown():
    observations = np.arange(8, dtype=np.float32)[:, None]
    actions = np.array([-1, -0.5, -0.25, -0.25, 0.5, 1, 1, 0.75], dtype=np.float32)[:, None]
    demonstrations = Demonstrations(
        observations, actions, np.zeros(8, dtype=int), action_low=(-1.0,), action_high=(1.0,)
    )
    low, high = mine_rules(demonstrations, supp_min=0.0, conf_min=1.0).rules
    assert (low.demonstrated_value, high.demonstrated_value) == (-0.375, 0.875)


def test_a_mined_rule_knows_its_node(lander_like):
    (tree,) = grow_policy_trees(lander_like)
    for one in mine_rules([tree], supp_min=0.01, conf_min=0.8).rules:
        assert tree.samples[node_of(one)] == one.samples


@pytest.mark.parametrize(
    ("bad", "names"),
    [
        ({"supp_min": -0.1, "conf_min": 1}, "support"),
        ({"supp_min": 0, "conf_min": 1.1}, "confidence"),
        ({"supp_min": float("nan"), "conf_min": 1}, "support"),
        ({"supp_min": 0, "conf_min": 1, "lift_min": -1}, "lift"),
        ({"supp_min": 0, "conf_min": 1, "max_depth": -1}, "maximum depth"),
    ],
)
def test_impossible_thresholds_are_refused(lander_like, bad, names):
    with pytest.raises(InputError, match=names):
        mine_rules(lander_like, **bad)


def test_no_trees_are_refused():
    with pytest.raises(InputError, match="no tree"):
        mine_rules([], supp_min=0, conf_min=1)
    with pytest.raises(InputError, match="no tree"):
        threshold_landscape([], [0], [1])


@pytest.mark.parametrize("grid", [[], [0.5, 0.1], [0.1, 0.1], [float("nan")], [[0.1]]])
def test_an_impossible_grid_is_refused(lander_like, grid):
    with pytest.raises(InputError, match="supports"):
        threshold_landscape(grow_policy_trees(lander_like), grid, [0.5])
