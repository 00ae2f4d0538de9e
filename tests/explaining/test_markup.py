from __future__ import annotations

from dataclasses import replace

import numpy as np

from sarl_core import Demonstrations, grow_policy_trees, mine_rules
from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.figures import demonstrations as demonstration_figures
from sarl_core.explaining.figures import tree as rule_figures
from sarl_core.explaining.figures.distributions import histogram_by_label
from sarl_core.explaining.figures.replay import Timeline, Track, intervention_strip
from sarl_core.explaining.html.rule_features import features_html
from sarl_core.explaining.html.tree import place_html
from sarl_core.explaining.markup import plain
from sarl_core.explaining.tables.rule_evidence import feature_evidence
from sarl_core.mining.algorithm_1 import cut_nodes
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import node_of


def test_markup_and_templates_become_text() -> None:
    assert plain('<b>x</b> & "y"') == '&lt;b&gt;x&lt;/b&gt; &amp; "y"'
    assert "%{" not in plain("%{x}")
    assert plain("pole angle, 5 %") == "pole angle, 5 %"


def test_names_from_files_are_no_markup_in_the_figures_of_a_rule(
    lander_like: Demonstrations,
) -> None:
    harmful = replace(
        lander_like,
        feature_names=tuple(f"<b>{i}</b>" for i in range(8)),
        label_names=(("<i>", "1", "2", "3"),),
    )
    tree = grow_policy_trees(harmful)[0]
    limits = {"supp_min": 0.005, "conf_min": 0.9}
    rule = mine_rules((tree,), **limits).rules[0]
    cut = cut_nodes(tree, **limits)
    drawn = rule_figures.tree_figure(tree, cut, node_of(rule)).to_json()
    drawn += place_html(tree, cut, node_of(rule))
    found = feature_evidence(harmful, tree, rule)
    units = [replace(feature, unit="<b>m</b>") for feature in harmful.features]
    for features in (harmful.features, units):
        drawn += features_html(found, features, "#0072B2")
    for raw in ("<b>", "<i>", r"\u003cb\u003e", r"\u003ci\u003e"):
        assert raw not in drawn


def test_names_from_files_are_no_markup_in_other_figures() -> None:
    dimension = LabelledDimension("<u>d</u>", ("<b>0</b>", "1"))
    labels = np.array([0, 1, 1])
    histogram = histogram_by_label(labels, labels, 2)
    bars = demonstration_figures.action_figure(histogram, dimension)
    assert bars.data[0].y[0] == "&lt;b&gt;0&lt;/b&gt;"
    spread = demonstration_figures.feature_figure(Feature("x", "<b>"), histogram, dimension)
    assert "<b>" not in "".join([*spread.data[0].customdata, spread.data[0].hovertemplate])
    rows = [Track("<u>d</u>: done", labels.astype(float), dimension)]
    strip = intervention_strip(rows, ["", "", ""], Timeline.of(rows, 3))
    assert strip.layout.yaxis.ticktext[0] == "&lt;u&gt;d&lt;/u&gt;: done"


def test_actions_named_by_numbers_stand_on_an_axis_of_names() -> None:
    labels = np.array([0, 1, 1])
    figure = demonstration_figures.action_figure(
        histogram_by_label(labels, labels, 2), LabelledDimension("action", ("0", "1"))
    )
    assert list(figure.data[0].y) == ["0", "1"]
    assert figure.layout.yaxis.type == "category"
