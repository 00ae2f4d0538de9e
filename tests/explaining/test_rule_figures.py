from __future__ import annotations

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sarl_core import (
    Demonstrations,
    PolicyTree,
    RuleSet,
    grow_policy_trees,
    mine_rules,
    with_formulas,
)
from sarl_core.explaining.figures import tree as figures
from sarl_core.explaining.html.path import path_table
from sarl_core.explaining.tables.rule_evidence import (
    example_columns,
    example_rows,
    feature_evidence,
    path_steps,
)
from sarl_core.explaining.tables.rules import rule_columns, top_rules
from sarl_core.mining.algorithm_1 import cut_nodes
from sarl_core.mining.rules import Thresholds, node_of

AT = {"supp_min": 0.005, "conf_min": 0.9}


@pytest.fixture(scope="module")
def rules(lander_trees: tuple[PolicyTree, ...]) -> RuleSet:
    return mine_rules(lander_trees, **AT)


def test_a_path_goes_from_all_states_to_those_of_the_rule(
    lander_trees: tuple[PolicyTree, ...], rules: RuleSet
) -> None:
    for rule in rules.rules:
        steps = path_steps(lander_trees[0], node_of(rule))
        assert len(steps) == rule.length + 1
        assert steps[0].query == ""
        assert steps[0].support == 1.0
        assert steps[-1].samples == rule.samples
        assert [step.is_cut for step in steps] == [False] * rule.length + [True]
        assert all(sum(step.shares) == pytest.approx(1.0) for step in steps)
        # Algorithm 1: nothing above the rule was frequent and certain enough.
        assert all(step.confidence < 0.9 for step in steps[:-1])


def test_evidence_of_a_feature_is_that_of_its_states(
    lander_like: Demonstrations, lander_trees: tuple[PolicyTree, ...], rules: RuleSet
) -> None:
    rule = max(rules.rules, key=lambda one: len(one.bounds))
    found = feature_evidence(lander_like, lander_trees[0], rule)
    assert [one.bounds for one in found] == list(rule.bounds)
    for one in found:
        assert one.everywhere.sum() == pytest.approx(1.0)
        assert one.at_rule.sum() == pytest.approx(1.0)
        width = one.edges[1] - one.edges[0]
        inside = (one.edges[1:] > one.bounds.low - width) & (
            one.edges[:-1] < one.bounds.high + width
        )
        assert one.at_rule[~inside].sum() == 0.0


def test_evidence_tells_how_many_states_are_infinite(lander_like: Demonstrations) -> None:
    first = lander_like.features[0].name
    made = with_formulas(lander_like, [f"way = 1 / max({first}, 0)"])
    trees = grow_policy_trees(made)
    rules = mine_rules(trees, supp_min=0.0, conf_min=1.0)
    of_way = len(made.features) - 1
    rule = next(one for one in rules if any(b.feature == of_way for b in one.bounds))
    found = {one.feature: one for one in feature_evidence(made, trees[0], rule)}
    share = float(np.mean(lander_like.observations[:, 0] <= 0))
    assert 0.0 < share < 1.0
    assert found[of_way].infinite == pytest.approx(share)
    assert all(one.infinite == 0.0 for feature, one in found.items() if feature != of_way)


def test_examples_are_states_of_the_rule(
    lander_like: Demonstrations, lander_trees: tuple[PolicyTree, ...], rules: RuleSet
) -> None:
    rule = rules.rules[0]
    rows = example_rows(lander_trees[0], node_of(rule))
    assert len(rows) == min(10, rule.samples)
    assert rule.applies(lander_like.observations[rows]).all()
    columns = example_columns(lander_like, lander_trees[0], rule)
    assert columns["Episode"] == lander_like.episodes[rows].tolist()
    asked = lander_like.features[rule.bounds[0].feature].name
    assert list(columns)[2] == asked
    agrees = np.array(columns["As the rule says"])
    assert np.array_equal(agrees, lander_trees[0].demonstrated[rows] == rule.action)


def test_examples_of_continuous_actions_are_values(two_torques: Demonstrations) -> None:
    trees = grow_policy_trees(two_torques, divider=3)
    rule = mine_rules(trees, supp_min=0.02, conf_min=0.8).of_dimension(1)[0]
    columns = example_columns(two_torques, trees[1], rule)
    assert all(-2.0 <= float(str(value)) <= 2.0 for value in columns["Expert did"])


@pytest.mark.parametrize("dark", [False, True])
def test_the_path_is_lit_in_the_tree(
    lander_trees: tuple[PolicyTree, ...], rules: RuleSet, dark: bool
) -> None:
    tree = lander_trees[0]
    node = node_of(rules.rules[-1])
    figure = figures.tree_figure(tree, cut_nodes(tree, **AT), node, dark=dark)
    lit = next(trace for trace in figure.data if trace.name == "path")
    assert len(lit.x) == len(tree.path(node))
    assert list(np.floor(lit.y)) == tree.depth[list(tree.path(node))].tolist()
    low, high = figure.layout.xaxis.range
    assert low <= lit.x[-1] <= high
    json.loads(figure.to_json())


def boxes(figure: Any, what: str = "") -> list[tuple[float, float, int]]:
    """From, to and depth of each box."""
    found = re.findall(
        r"M([^,]+),(\d+)H([^V]+)V",
        "".join(shape.path for shape in figure.layout.shapes if shape.name.endswith(what)),
    )
    return [(float(left), float(right), int(depth)) for left, depth, right in found]


def test_boxes_cover_every_level_of_the_tree(
    lander_trees: tuple[PolicyTree, ...], rules: RuleSet
) -> None:
    tree = lander_trees[0]
    figure = figures.tree_figure(tree, cut_nodes(tree, **AT), node_of(rules.rules[0]))
    for depth in range(int(tree.depth.max()) + 1):
        drawn = sum(right - left for left, right, level in boxes(figure) if level == depth)
        assert drawn == pytest.approx(tree.support[tree.depth == depth].sum(), abs=1e-4)


def test_the_box_of_a_rule_stands_where_its_states_do(
    lander_trees: tuple[PolicyTree, ...], rules: RuleSet
) -> None:
    tree, node = lander_trees[0], node_of(max(rules.rules, key=lambda one: one.samples))
    figure = figures.tree_figure(tree, cut_nodes(tree, **AT), node)
    start, end = tree.sample_start[node], tree.sample_start[node] + tree.samples[node]
    assert any(
        left <= start / len(tree.demonstrated) + 1e-5
        and right >= end / len(tree.demonstrated) - 1e-5
        and depth == tree.depth[node]
        for left, right, depth in boxes(figure, "a rule")
    )
    hovers = next(trace for trace in figure.data if trace.name == "boxes")
    assert f"{int(tree.samples[node]):,} states" in "".join(hovers.text)


def test_a_large_tree_keeps_its_rules_when_boxes_are_left_out(
    lander_trees: tuple[PolicyTree, ...], rules: RuleSet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "MAX_BOXES", 20)
    tree = lander_trees[0]
    cut = cut_nodes(tree, **AT)
    figure = figures.tree_figure(tree, cut, int(cut[-1]))
    drawn = sum(right - left for left, right, _ in boxes(figure, "a rule"))
    assert drawn == pytest.approx(tree.support[cut].sum(), abs=1e-4)


def test_a_rule_at_the_root_has_a_figure(lander_trees: tuple[PolicyTree, ...]) -> None:
    cut = cut_nodes(lander_trees[0], supp_min=0.0, conf_min=0.1)
    assert cut.tolist() == [0]
    assert figures.tree_figure(lander_trees[0], cut, 0).data


def test_the_path_table_escapes_names_from_files(
    lander_like: Demonstrations,
) -> None:
    harmful = replace(
        lander_like,
        feature_names=("<script>alert(1)</script>", *(f"f{i}" for i in range(7))),
        label_names=(("<b>", "1", "2", "3"),),
    )
    tree = grow_policy_trees(harmful)[0]
    rule = mine_rules((tree,), **AT).rules[0]
    html = path_table(path_steps(tree, node_of(rule)), tree.dimension)
    assert "<script>" not in html
    assert "<b>" not in html
    assert "this is the rule" in html


def test_the_largest_rules_are_the_first_of_all(lander_trees: tuple[PolicyTree, ...]) -> None:
    everything = mine_rules(lander_trees, supp_min=0.0, conf_min=1.0)
    some, names = top_rules(lander_trees, Thresholds(0.0, 1.0), 7)
    largest = sorted((rule.samples for rule in everything.rules), reverse=True)[:7]
    assert [rule.samples for rule in some.rules] == largest
    assert {rule.id for rule in some.rules} <= {rule.id for rule in everything.rules}
    whole = {rule.id: everything.name_of(rule) for rule in everything.rules}
    assert list(names) == [whole[rule.id] for rule in some.rules]
    columns = rule_columns(some.rules, some)
    assert columns["States"] == largest
    assert columns["Joint support"] == [100 * rule.joint_support for rule in some.rules]
    assert columns["Support"] == [100 * rule.support for rule in some.rules]
    assert columns["Confidence"] == [100 * rule.confidence for rule in some.rules]
