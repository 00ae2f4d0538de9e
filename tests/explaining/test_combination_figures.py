from __future__ import annotations

import math
from urllib.parse import unquote

import numpy as np
import pytest

from sarl_core import Demonstrations, mine_rules
from sarl_core.demonstrations.derived import Combination, DerivedFeature
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.combination_plots import CombinationPlot, combination_plots
from sarl_core.explaining.html.rule_combinations import combinations_html
from sarl_core.explaining.report.demonstrations import demonstrations_part
from sarl_core.explaining.report.rule_set_card import RuleSetCard
from sarl_core.explaining.report.rules import in_order, rules_part
from sarl_core.explaining.report.tally import tally
from sarl_core.explaining.tables.rule_evidence import example_columns
from sarl_core.explaining.words.replay import state_rows
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.rules import Condition, Rule


def demonstrated(n: int = 5_000) -> Demonstrations:
    """Positions 0 to 10 and speeds -5 to 5; brakes where it would be beyond 6 in two seconds."""
    rng = np.random.default_rng(0)
    states = np.stack([rng.uniform(0, 10, n), rng.uniform(-5, 5, n)], axis=1).astype(np.float32)
    actions = (states[:, 0] + 2 * states[:, 1] > 6).astype(np.int64)
    plain = Demonstrations(
        states,
        actions,
        np.arange(n) // 100,
        feature_names=("position", "speed"),
        feature_units=("m", "m/s"),
        label_names=(("go", "brake"),),
    )
    return plain.deriving([DerivedFeature(Combination(((0, 1.0), (1, 2.0))))])


def rule(*conditions: tuple[int, str, float]) -> Rule:
    return Rule(
        id="0.1",
        dimension=0,
        conditions=tuple(Condition(*one) for one in conditions),
        action=1,
        support=0.5,
        confidence=1.0,
        lift=2.0,
        samples=10,
    )


def plots(data: Demonstrations, *conditions: tuple[int, str, float]) -> tuple[CombinationPlot, ...]:
    (dimension,) = label_dimensions(data, 2)
    return combination_plots(data, rule(*conditions), dimension, data.features)


def test_a_sample_of_the_demonstrations_stands_over_the_two_features() -> None:
    data = demonstrated()
    (one,) = plots(data, (2, ">", 6.0))
    assert one.features == (0, 1)
    assert len(one.points) == 1_200
    assert np.array_equal(one.points, plots(data, (2, ">", 6.0))[0].points)
    assert np.array_equal(one.labels, one.points[:, 0] + 2 * one.points[:, 1] > 6)
    rows = {tuple(row) for row in data.raw_observations.astype(float).tolist()}
    assert {tuple(point) for point in one.points.tolist()} <= rows


def inside(corners: tuple[tuple[float, float], ...], x: float, y: float) -> bool:
    signs = {
        math.copysign(1, (x2 - x1) * (y - y1) - (y2 - y1) * (x - x1))
        for (x1, y1), (x2, y2) in zip(corners, (*corners[1:], corners[0]), strict=True)
    }
    return len(signs) == 1


@pytest.mark.parametrize(
    "conditions",
    [[(2, ">", 6.0)], [(2, "<=", 6.0)], [(2, ">", -2.0), (2, "<=", 6.0)]],
)
def test_the_side_is_where_the_rule_applies(conditions: list[tuple[int, str, float]]) -> None:
    data = demonstrated()
    (one,) = plots(data, *conditions)
    taken = [one.bounds.low < x + 2 * y <= one.bounds.high for x, y in one.points.tolist()]
    assert any(taken)
    assert not all(taken)
    assert [inside(one.side, x, y) for x, y in one.points.tolist()] == taken
    assert len(one.lines) == len(conditions)
    for line in one.lines:
        values = [x + 2 * y for x, y in line]
        assert values[0] == pytest.approx(values[1])
        assert round(values[0], 6) in (6.0, -2.0)


def test_a_bound_beyond_the_demonstrations_has_no_line() -> None:
    data = demonstrated()
    (all_of_it,) = plots(data, (2, "<=", 1_000.0))
    assert all_of_it.lines == ()
    assert len(all_of_it.side) == 4
    (none_of_it,) = plots(data, (2, ">", 1_000.0))
    assert none_of_it.lines == none_of_it.side == ()


def test_the_picture_is_said_in_words_and_has_the_colours_of_the_actions() -> None:
    data = demonstrated()
    (dimension,) = label_dimensions(data, 2)
    page = combinations_html(plots(data, (2, ">", 6.0)), data.features, dimension)
    assert "position plus 2 s of speed &gt; 6 m" in page
    assert "position (m)" in page
    assert "speed (m/s)" in page
    picture = unquote(page.split("data:image/svg+xml,")[1].split("&#34;")[0])
    for label in (0, 1):
        assert f'stroke="{label_colour(label)}"' in picture
        assert label_colour(label) in page.split("sarl-features-note")[1].split("</div>")[0]
    assert picture.count("<line") == 1
    assert picture.count("<polygon") == 1


def test_all_combinations_are_drawn_unless_it_says_how_many() -> None:
    data = demonstrated()
    (dimension,) = label_dimensions(data, 2)
    (one,) = plots(data, (2, ">", 6.0))
    every = combinations_html([one] * 8, data.features, dimension)
    assert every.count("<figure>") == 8
    assert "the first" not in every
    some = combinations_html([one] * 8, data.features, dimension, most=6)
    assert some.count("<figure>") == 6
    assert "the first 6 of 8 combinations" in some


def test_a_rule_without_combinations_has_no_picture() -> None:
    data = demonstrated()
    (dimension,) = label_dimensions(data, 2)
    assert combinations_html(plots(data, (0, ">", 6.0)), data.features, dimension) == ""


def test_a_report_counts_what_was_seen_and_says_how_the_picture_is_read() -> None:
    data = demonstrated()
    rules = mine_rules(data, supp_min=0.01, conf_min=0.95)
    counts = tally(rules, data)
    seen = demonstrations_part(rules, data, counts)
    assert "the state of the task, 2 numbers listed below" in seen.sentences[0]
    assert [line.name for line in seen.features] == ["position (m)", "speed (m/s)"]
    part = rules_part(rules, data, counts, in_order(rules, 9), None, RuleSetCard())
    assert "two features together, as “position plus 2 s of speed”" in part.introduction[-1]
    plain = data.deriving([])
    rules = mine_rules(plain, supp_min=0.01, conf_min=0.95)
    part = rules_part(rules, plain, tally(rules, plain), in_order(rules, 9), None, RuleSetCard())
    assert "two features together" not in " ".join(part.introduction)


def test_tables_of_states_hold_the_combinations_that_a_rule_asks_about_and_no_others() -> None:
    data = demonstrated()
    other = DerivedFeature(Combination(((1, 1.0), (0, -0.3))))
    data = data.deriving([*data.derived, other])
    state = data.observations[0]
    names = ["position", "speed", "position plus 2 s of speed"]
    one = rule((2, ">", 6.0))
    rows = state_rows(state, data.features, data.features, [one])
    assert [name for name, _, _ in rows] == names
    rows = state_rows(state, data.features, data.features, [rule((0, ">", 6.0))])
    assert [name for name, _, _ in rows] == names[:2]
    (tree,) = grow_policy_trees(data)
    mined = next(
        one
        for one in mine_rules((tree,), supp_min=0.01, conf_min=0.95)
        if {bounds.feature for bounds in one.bounds} == {2}
    )
    columns = example_columns(data, tree, mined, 3)
    assert list(columns)[2:-2] == ["position plus 2 s of speed (m)", "position (m)", "speed (m/s)"]
