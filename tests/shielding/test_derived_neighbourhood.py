"""What lies near a state where rules ask about what is derived: against trying many values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sarl_core import Demonstrations, RuleSet, Shield, mine_rules, with_formulas
from sarl_core.demonstrations.derived import Combination, DerivedFeature, extend
from sarl_core.environments.formulas import Formula
from sarl_core.explaining.state_path import PathFinder
from sarl_core.shielding.crossings import crossings, numbers_at, places_of
from sarl_core.shielding.neighbourhood import Neighbourhood, feature_spreads
from sarl_core.shielding.pair_moves import pair_moves

NAMES = ("gap", "speed", "lead")


def mined(formulas: list[str]) -> tuple[RuleSet, Demonstrations]:
    rng = np.random.default_rng(0)
    states = rng.normal(size=(600, 3)).astype(np.float32)
    made = Demonstrations(
        states,
        np.digitize(states[:, 0] + 0.5 * states[:, 1], [-0.5, 0.7]).astype(np.int64),
        np.repeat(np.arange(6), 100),
        feature_names=NAMES,
    )
    derived = [Combination(((0, 1.0), (1, ratio))) for ratio in (0.45, -2.0)]
    derived.append(Combination(((1, 1.0), (2, -0.7))))
    made = with_formulas(made.deriving([DerivedFeature(one) for one in derived]), formulas)
    return mine_rules(made, supp_min=0.01, conf_min=0.9), made


PLAIN = mined([])
FORMULAS = mined(["rate = gap / (speed - lead)", "near = min(abs(gap), speed * speed)"])


@pytest.mark.parametrize("made", [PLAIN, FORMULAS], ids=["combinations", "formulas"])
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_along_each_feature_the_shield_does_what_is_said(
    made: tuple[RuleSet, Demonstrations], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    state = rng.normal(size=3).astype(np.float32)
    shield = Shield(made[0])
    lines = Neighbourhood(shield).lines(state, 0)
    assert [line.feature for line in lines] == [0, 1, 2]
    for line in lines:
        values = rng.normal(size=200).astype(np.float32) * np.float32(3)
        finite = line.starts[np.isfinite(line.starts)]
        values = np.concatenate([values, finite, np.nextafter(finite, np.float32(-np.inf))])
        states = np.repeat(state[None], len(values), axis=0)
        states[:, line.feature] = values
        said = np.searchsorted(line.starts, values, side="right") - 1
        decided = shield.decide_batch(states, np.zeros(len(values), dtype=np.int64))
        differs = (line.decisions.rules[said] != decided.rules).any(axis=1)
        if made is PLAIN:
            assert not differs.any()
        else:  # a formula may turn between two of the numbers that are looked at
            assert differs.mean() < 0.02
        assert line.here == np.searchsorted(line.starts, state[line.feature], side="right") - 1


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_near_misses_are_the_nearest_states_in_which_rules_apply(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rule_set, made = PLAIN
    state = rng.normal(size=3).astype(np.float32)
    shield, spreads = Shield(rule_set), feature_spreads(made.raw_observations)
    misses = Neighbourhood(shield).near_misses(state, spreads, most=999)
    features = rule_set.source.features
    least: dict[tuple[int, int], float] = {}
    for miss in misses:
        (change,) = miss.changes
        there = state.copy()
        there[change.feature] = change.after
        assert rule_set[miss.rule].applies(extend(there[None], features))[0]
        assert not rule_set[miss.rule].applies(extend(state[None], features))[0]
        assert miss.in_force
        least[miss.rule, change.feature] = abs(change.by)
    for feature in range(3):
        values = np.concatenate([rng.normal(size=300) * 3, state[feature] + rng.normal(size=300)])
        states = np.repeat(state[None], len(values), axis=0)
        states[:, feature] = values
        whole = extend(states, features)
        for place, rule in enumerate(rule_set):
            rows = np.flatnonzero(rule.applies(whole))
            if len(rows) and not rule.applies(extend(state[None], features))[0]:
                way = np.abs(states[rows, feature] - state[feature]).min()
                assert least[place, feature] <= way


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_two_changes_are_the_nearest_that_let_a_rule_apply_where_one_does_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rule_set, made = PLAIN
    features = rule_set.source.features
    state = (2.0 * rng.normal(size=3)).astype(np.float32)
    near, spreads = Neighbourhood(Shield(rule_set)), feature_spreads(made.raw_observations)
    alone = {miss.rule for miss in near.near_misses(state, spreads, most=999)}
    said = {}
    for miss in near.near_misses(state, spreads, features=2, most=999):
        there = state.copy()
        for change in miss.changes:
            there[change.feature] = change.after
        assert rule_set[miss.rule].applies(extend(there[None], features))[0]
        assert len(miss.changes) == 2
        said[miss.rule] = miss.distance
    assert not alone & said.keys()
    for pair in ([0, 1], [0, 2], [1, 2]):
        states = np.repeat(state[None], 4_000, axis=0)
        width = rng.choice([0.3, 1.0, 3.0], size=(4_000, 1))
        states[:, pair] += (width * rng.normal(size=(4_000, 2))).astype(np.float32)
        whole = extend(states, features)
        way = (np.abs(states.astype(np.float64) - state) / spreads).sum(axis=1)
        for place, rule in enumerate(rule_set):
            rows = np.flatnonzero(rule.applies(whole))
            if len(rows) and not rule.applies(extend(state[None], features))[0]:
                # One alone that does it is not said a second time with another.
                assert place in alone or said[place] <= way[rows].min() + 1e-5


def test_two_that_go_less_far_do_not_hide_one_that_does_it_alone() -> None:
    # One alone has to go 4, both together 0.8 each.
    normals, room = np.array([[-1.0, -0.25], [-0.25, -1.0]]), np.array([-1.0, -1.0])
    moves = pair_moves(normals, room, np.array([[0, 1]]), np.ones(2))
    assert moves.by[0] == pytest.approx([0.8, 0.8])
    assert moves.distance[0] == pytest.approx(1.6)
    assert moves.alone[0]
    never = pair_moves(np.array([[1.0, 0.0], [-1.0, 0.0]]), room, np.array([[0, 1]]), np.ones(2))
    assert np.isinf(never.distance[0])
    assert not never.alone[0]


@example([3.4028234663852886e38, -3.4028234663852886e38])
@example([-0.0, 0.0])
@given(st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=1))
def test_float32_numbers_stand_in_one_order(values: list[float]) -> None:
    array = np.array(values, dtype=np.float32)
    places = places_of(array)
    assert np.array_equal(numbers_at(places), array)
    order = np.argsort(places, kind="stable")
    assert (np.diff(array[order].astype(np.float64)) >= 0).all()
    with np.errstate(over="ignore"):  # behind the largest number comes infinity
        later = np.nextafter(array, np.float32(np.inf))
    rises = np.isfinite(later)
    assert (places_of(later[rises]) - places[rises] == 1).all()


@given(
    ratio=st.floats(min_value=-1e3, max_value=1e3).filter(lambda ratio: abs(ratio) > 1e-3),
    bound=st.floats(width=32, min_value=-1e6, max_value=1e6),
    feature=st.sampled_from([0, 1]),
)
def test_a_combination_passes_a_bound_once(ratio: float, bound: float, feature: int) -> None:
    combination = Combination(((0, 1.0), (1, ratio)))
    state = np.array([0.3, -0.7], dtype=np.float32)
    (edge,) = crossings(combination, state, feature, np.array([bound], dtype=np.float32))
    states = np.repeat(state[None], 2, axis=0)
    states[:, feature] = [np.nextafter(edge, np.float32(-np.inf)), edge]
    below, at = combination.values(states).astype(np.float32) >= np.float32(bound)
    assert below != at


def test_a_formula_passes_a_bound_several_times() -> None:
    formula = Formula.parse("x * x", ("x",))
    edges = crossings(formula, np.zeros(1, dtype=np.float32), 0, np.array([4.0], dtype=np.float32))
    assert sorted(edges.tolist()) == pytest.approx([-2.0, 2.0])
    assert not len(crossings(formula, np.zeros(2, np.float32), 1, np.array([4.0], np.float32)))


def test_the_way_of_a_state_asks_about_what_is_derived() -> None:
    for rule_set, made in (PLAIN, FORMULAS):
        finder, shield = PathFinder(rule_set), Shield(rule_set)
        whole = made.observations
        for row in range(40):
            raw = made.raw_observations[row]
            rule = shield.rules_in_force(raw[None])[0, 0]
            path = finder.path(0, raw, int(rule))
            assert path.rule == (None if rule < 0 else rule)
            for query in path.queries:
                assert query.value == whole[row, query.condition.feature]
