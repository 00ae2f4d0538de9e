from __future__ import annotations

import re
from html import unescape
from itertools import pairwise

import numpy as np
import pytest

from sarl_core import PolicyTree, RuleSet, mine_rules
from sarl_core.explaining.colours import faded, label_colour
from sarl_core.explaining.figures.tree import window_around
from sarl_core.explaining.html.tree import place_html
from sarl_core.mining.algorithm_1 import cut_nodes
from sarl_core.mining.rules import node_of

AT = {"supp_min": 0.005, "conf_min": 0.9}


@pytest.fixture(scope="module")
def rules(lander_trees: tuple[PolicyTree, ...]) -> RuleSet:
    return mine_rules(lander_trees, **AT)


def rows(html: str) -> list[list[tuple[str, float, float]]]:
    """Colour, from and to of each box, row by row; in percent from the left."""
    found = []
    for row in re.findall(r"background:(?:none|linear-gradient\(90deg,(.*?),#0000 0\))\"", html):
        stops = [stop.split(" 0 ") for stop in re.split(r",(?![^(]*\))", row)] if row else []
        ends = [0.0, *(float(end.removesuffix("%")) for _, end in stops)]
        assert ends == sorted(ends)
        found.append(
            [
                (colour, start, end)
                for (colour, _), (start, end) in zip(stops, pairwise(ends), strict=True)
            ]
        )
    return found


def test_a_rule_stands_in_its_row_where_its_states_do(
    lander_trees: tuple[PolicyTree, ...], rules: RuleSet
) -> None:
    tree, cut = lander_trees[0], cut_nodes(lander_trees[0], **AT)
    for rule in rules.rules:
        node = node_of(rule)
        left, right, top, bottom = window_around(tree, node)
        found = rows(place_html(tree, cut, node))
        assert len(found) == bottom - top
        start = 100 * (tree.sample_start[node] - left) / (right - left)
        end = start + 100 * tree.samples[node] / (right - left)
        full = faded(label_colour(rule.action), 0.95)
        assert any(
            colour == full and begun <= start + 0.01 and ended >= end - 0.01
            for colour, begun, ended in found[int(tree.depth[node]) - top]
        )


def test_boxes_of_a_row_cover_its_states_and_nothing_else(
    lander_trees: tuple[PolicyTree, ...], rules: RuleSet
) -> None:
    tree, cut = lander_trees[0], cut_nodes(lander_trees[0], **AT)
    node = node_of(rules.rules[-1])
    left, right, top, _ = window_around(tree, node)
    for depth, row in enumerate(rows(place_html(tree, cut, node)), start=top):
        here = np.flatnonzero(tree.depth == depth)
        start = np.clip(tree.sample_start[here], left, right)
        end = np.clip(tree.sample_start[here] + tree.samples[here], left, right)
        drawn = sum(last - first for colour, first, last in row if colour != "#0000")
        assert drawn == pytest.approx(100 * (end - start).sum() / (right - left), abs=0.5)


def test_the_conditions_stand_along_the_path(
    lander_trees: tuple[PolicyTree, ...], rules: RuleSet
) -> None:
    tree, cut = lander_trees[0], cut_nodes(lander_trees[0], **AT)
    rule = max(rules.rules, key=lambda one: one.length)
    node = node_of(rule)
    _, _, top, bottom = window_around(tree, node)
    html = place_html(tree, cut, node)
    shown = [above for above in tree.path(node) if top <= tree.depth[above] < bottom]
    assert html.count('<i class="dot') == len(shown)
    assert html.count('<i class="dot end"') == 1
    queries = [unescape(text) for text in re.findall(r"<em [^>]*>([^<]*)</em>", html)]
    assert len(queries) == len([above for above in shown if above])
    feature = lander_trees[0].source.features[rule.conditions[-1].feature]
    assert queries[-1].startswith(feature.name)


def test_boxes_say_how_many_states_they_are(
    lander_trees: tuple[PolicyTree, ...], rules: RuleSet
) -> None:
    tree, cut = lander_trees[0], cut_nodes(lander_trees[0], **AT)
    node = node_of(rules.rules[0])
    told = re.findall(r'<b title="([^"]+)"', place_html(tree, cut, node))
    assert any(text.startswith(f"{int(tree.samples[node]):,} states") for text in told)


def test_a_rule_at_the_root_has_a_place(lander_trees: tuple[PolicyTree, ...]) -> None:
    html = place_html(lander_trees[0], np.array([0]), 0)
    assert html.count('<i class="dot') == 1
    assert "clip-path" not in html
