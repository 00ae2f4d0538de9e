"""Moving what combinations count their second feature for."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sarl_core import Demonstrations, load_demonstrations
from sarl_core.demonstrations.derived import Combination, DerivedFeature
from sarl_core.improving.aggregation import aggregate
from sarl_core.improving.movement import Parameters
from sarl_core.improving.plan import Plan
from sarl_core.mining.budgeted_trees import grow_budgeted_trees, leaf_rules
from sarl_core.mining.combining.choice import with_combinations
from sarl_core.mining.combining.queries import trees_over_used
from sarl_core.mining.tree import LEAF, PolicyTree

CARTPOLE = load_demonstrations(
    Path(__file__).parents[2] / "data" / "demonstrations" / "cartpole.parquet"
)


def grown(rules: int = 6) -> tuple[Demonstrations, tuple[PolicyTree, ...]]:
    combined = with_combinations(CARTPOLE)
    trees = trees_over_used(grow_budgeted_trees(combined, max_rules=rules), combined)
    asked = {int(feature) for tree in trees for feature in tree.feature if feature != LEAF}
    names = [feature.name for feature in trees[0].source.features]
    # What is not asked about is not derived any more, and what is observed stays.
    assert asked >= set(range(len(CARTPOLE.observed), len(names)))
    assert len(names) > len(CARTPOLE.observed)
    derived = [one for one in combined.derived if _name(one, combined) in names]
    return combined.deriving(derived), trees


def _name(one: DerivedFeature, pairs: Demonstrations) -> str:
    return pairs.deriving([one]).features[-1].name


def test_trees_over_what_they_ask_about_send_every_state_where_it_went() -> None:
    combined = with_combinations(CARTPOLE)
    before = grow_budgeted_trees(combined, max_rules=6)
    pairs, after = grown()
    assert len(pairs.derived) < len(combined.derived)
    np.testing.assert_array_equal(
        before[0].apply(combined.observations), after[0].apply(pairs.observations)
    )
    assert leaf_rules(before).fidelity == leaf_rules(after).fidelity


def test_nothing_moved_is_the_tree_itself() -> None:
    pairs, trees = grown()
    parameters = Parameters.of(trees, pairs)
    (again,) = parameters.candidate(np.zeros(parameters.count)).trees(pairs, 2)
    np.testing.assert_array_equal(again.threshold, trees[0].threshold)
    np.testing.assert_array_equal(again.feature, trees[0].feature)
    np.testing.assert_array_equal(again.label, trees[0].label)


def test_a_line_turns_around_the_middle_of_what_reaches_it() -> None:
    pairs, trees = grown()
    parameters = Parameters.of(trees, pairs)
    line = parameters.lines[0][0]
    values = np.zeros(parameters.count)
    queries = int((trees[0].feature != LEAF).sum())
    values[queries] = 0.3  # the first ratio stands behind the thresholds
    moved = parameters.candidate(values)
    asked = moved.derived[int(moved.structures[0].feature[line.node]) - len(pairs.observed)]
    assert isinstance(asked.definition, Combination)
    ratio = asked.definition.ratio
    assert ratio == float(f"{line.ratio + 0.3 * line.scale:.1e}") != line.ratio
    # At the median of the second feature the border lies where it lay.
    border = moved.structures[0].threshold[line.node] - ratio * line.centre
    before = trees[0].threshold[line.node] - line.ratio * line.centre
    np.testing.assert_allclose(border, before, rtol=1e-9, atol=1e-12)


def test_a_refined_run_derives_what_its_rules_ask_about_and_nothing_else(
    small_search: None,
) -> None:
    plan = Plan(
        max_rules=8,
        rounds=1,
        episodes=2,
        turns=1,
        validation=2,
        report=2,
        combined=((2, 3), (1, 3)),
        max_steps=100,
    )
    run = aggregate(CARTPOLE.select(range(6)), plan)
    features = run.rule_set.source.features
    asked = {condition.feature for rule in run.rule_set.rules for condition in rule.conditions}
    assert {place for place, one in enumerate(features) if one.derived is not None} <= asked
    assert any(one.derived is not None for one in features)
    assert [one.name for one in run.demonstrations.features] == [one.name for one in features]
