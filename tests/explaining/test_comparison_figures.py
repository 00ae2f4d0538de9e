from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core.explaining.figures.comparison import (
    arm_style,
    arm_styles,
    returns_figure,
    typical_figure,
)
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.rule_set import RuleSet
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.recording import record
from sarl_core.rollouts.statistics import summarise
from sarl_core.studies.comparison import Arm, Comparison


def episodes(returns: list[float], seed: int = 40) -> Episodes:
    count = len(returns)
    return Episodes(
        env_id="CartPole-v1",
        agent="novice",
        seeds=np.arange(seed, seed + count),
        returns=np.array(returns),
        lengths=np.ones(count, dtype=np.int64),
        interventions=np.zeros(count, dtype=np.int64),
        covered=np.zeros(count, dtype=np.int64),
        terminated=np.ones(count, dtype=np.bool_),
        truncated=np.zeros(count, dtype=np.bool_),
        last_rewards=np.ones(count),
    )


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    return mine_rules(record("CartPole-v1", "expert", steps=200), supp_min=0.0, conf_min=1.0)


@pytest.fixture
def comparison(rules: RuleSet) -> Comparison:
    arms = (Arm("alone <b>", "novice"), Arm("filtered", "novice", rules), Arm("expert", "expert"))
    returns = ([1.0, 9.0, 2.0, 4.0], [50.0, 70.0, 60.0, 40.0], [500.0, 500.0])
    return Comparison("CartPole-v1", 40, arms, tuple(map(episodes, returns)))


def test_every_arm_has_a_line_through_its_returns(comparison: Comparison) -> None:
    figure = returns_figure(comparison)
    assert [list(line.y) for line in figure.data] == [
        found.returns.tolist() for found in comparison.episodes
    ]
    assert list(figure.data[0].x) == [1, 2, 3, 4]
    assert list(figure.data[0].customdata) == [40, 41, 42, 43]
    assert figure.layout.xaxis.range[1] >= 4


def test_what_is_typical_stands_with_its_interval(comparison: Comparison) -> None:
    figure = typical_figure(comparison)
    for row, (point, found) in enumerate(zip(figure.data, comparison.episodes, strict=True)):
        wanted = summarise(found.returns)
        assert list(point.y) == [row]
        assert point.x[0] == pytest.approx(wanted.iqm)
        assert point.x[0] + point.error_x.array[0] == pytest.approx(wanted.high)
        assert point.x[0] - point.error_x.arrayminus[0] == pytest.approx(wanted.low)
    assert list(figure.layout.yaxis.ticktext)[1:] == ["filtered", "expert"]


def test_whoever_never_crashes_says_so_where_others_say_how_often(comparison: Comparison) -> None:
    *novices, expert = comparison.episodes
    upright = replace(expert, terminated=np.zeros(len(expert), dtype=np.bool_))
    comparison = replace(comparison, episodes=(*novices, upright))
    texts = [point.text[0] for point in typical_figure(comparison).data]
    assert [text[text.index("(") :] for text in texts] == [
        "(100 % fail)",
        "(100 % fail)",
        "(0 % fail)",
    ]
    unknown = tuple(replace(found, env_id="Unknown-v0") for found in comparison.episodes)
    for point in typical_figure(replace(comparison, episodes=unknown)).data:
        assert "fail" not in point.text[0]


def test_names_are_text_and_not_markup(comparison: Comparison) -> None:
    for figure in (returns_figure(comparison), typical_figure(comparison)):
        assert "<b>" not in str(figure.data[0].name)
        assert "alone <b>" not in figure.to_json()


def test_colours_are_the_paper_s_and_agents_are_told_by_symbols(rules: RuleSet) -> None:
    other = RuleSet(rules.rules, rules.actions, rules.source, rules.thresholds)
    arms = [
        Arm("a", "novice"),
        Arm("b", "novice", rules),
        Arm("c", "novice", other),
        Arm("d", "expert"),
        Arm("e", "expert", rules),
    ]
    novice, filtered, unfiltered, expert, filtered_expert = arm_styles(arms)
    assert (novice, filtered, unfiltered) == tuple(arm_style(0, rules) for rules in (None, 0, 1))
    assert (expert, filtered_expert) == (arm_style(1, None), arm_style(1, 0))
    colours = {style.colour for style in (novice, filtered, unfiltered, expert)}
    assert len(colours) == 4
    assert filtered.colour == filtered_expert.colour
    assert filtered.symbol != filtered_expert.symbol
    assert novice.symbol == filtered.symbol
