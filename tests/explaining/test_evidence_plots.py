from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sarl_core import Demonstrations, RuleSet, mine_rules
from sarl_core.explaining.html.evidence import enough_plot, overview_plot
from sarl_core.explaining.html.plot import Axis, Scale, area, plot
from sarl_core.explaining.ticks import round_ticks, tick_text
from sarl_core.mining.rules import Rule
from sarl_core.mining.validation.holding_out import hold_out, with_held_out


@pytest.fixture(scope="module")
def tried() -> RuleSet:
    rng = np.random.default_rng(1)
    states = rng.normal(size=(2_000, 3)).astype(np.float32)
    actions = (states[:, 0] + 0.4 * rng.normal(size=2_000) > 0).astype(np.int64)
    pairs = Demonstrations(states, actions, np.repeat(np.arange(20), 100))
    mined, other = hold_out(pairs, share=0.3, seed=0)
    return with_held_out(mine_rules(mined, supp_min=0.02, conf_min=0.85), other)


def whiskers(html: str) -> list[tuple[float, float, float, float]]:
    """From the left, from below, height, and where the dot is within; each a share."""
    found = re.findall(
        r"left:([\d.]+)%;bottom:([\d.]+)%;height:([\d.]+)%;[^\"]*--at:([\d.]+)%", html
    )
    return [tuple(float(part) / 100 for part in one) for one in found]


def test_the_overview_draws_every_interval_where_it_lies(tried: RuleSet) -> None:
    html = overview_plot(tried.rules, tried)
    drawn = whiskers(html)
    assert len(drawn) == 2 * len(tried)
    ticks = re.findall(r'class="y" style="bottom:([\d.]+)%">([\d.]+) %<', html)
    (low, at_low), (high, at_high) = [
        (float(text) / 100, float(b) / 100) for b, text in ticks[:: len(ticks) - 1]
    ]
    per_share = (at_high - at_low) / (high - low)

    def confidence(place: float) -> float:
        return low + (place - at_low) / per_share

    expected = []
    for rule in tried.rules:
        assert rule.held_out is not None
        expected.append((rule.confidence,) * 3)  # a dot: it was chosen for being right there
        held = rule.held_out
        assert held.share is not None
        expected.append((*(held.interval or (held.share, held.share)), held.share))
    for (_, bottom, height, dot), (least, most, share) in zip(drawn, expected, strict=True):
        assert confidence(bottom) == pytest.approx(least, abs=1e-3)
        assert confidence(bottom + height) == pytest.approx(most, abs=1e-3)
        assert confidence(bottom + dot * height) == pytest.approx(share, abs=1e-3)
    places = [left for left, *_ in drawn]
    assert places == sorted(places)
    assert html.count("<u title=") == len(tried)


def test_without_held_out_episodes_there_is_one_dot_a_rule(tried: RuleSet) -> None:
    alone = replace(tried, rules=tuple(replace(rule, held_out=None) for rule in tried.rules))
    drawn = whiskers(overview_plot(alone.rules, alone))
    assert [height for _, _, height, _ in drawn] == [0.0] * len(tried)


def test_rules_stand_above_their_names_and_many_rules_above_some(tried: RuleSet) -> None:
    largest = sorted(tried.rules, key=lambda rule: -rule.samples)

    def named(rules: list[Rule], rule_set: RuleSet) -> list[str]:
        return re.findall(r'class="x"[^>]*>([^<]+)<', overview_plot(rules, rule_set))

    names = [f"R{tried.rules.index(rule) + 1}" for rule in largest]
    assert names != sorted(names)
    assert named(largest, tried) == names
    many = replace(
        tried, rules=tuple(replace(tried.rules[0], id=f"0.{node}") for node in range(200))
    )
    backwards = list(reversed(many.rules))
    assert named(backwards, many) == [f"R{201 - place}" for place in range(25, 201, 25)]


def test_what_each_kind_has_to_reach_is_a_line_below_its_rules(tried: RuleSet) -> None:
    line = r'class="least" style="left:([\d.]+)%;width:([\d.]+)%;bottom:([\d.]+)%'
    (alone,) = re.findall(line, overview_plot(tried.rules, tried))
    assert [float(one) for one in alone[:2]] == [0.0, 100.0]
    forbidding = tuple(replace(rule, forbids=(0,)) for rule in tried.rules[:1])
    both = replace(
        tried,
        rules=(*tried.rules, *forbidding),
        thresholds=replace(tried.thresholds, never=0.05),
    )
    html = overview_plot(both.rules, both)
    drawn = [[float(part) for part in one] for one in re.findall(line, html)]
    share = 100 * len(tried) / len(both)
    assert [one[0] for one in drawn] == pytest.approx([0.0, share], abs=0.01)
    assert [one[1] for one in drawn] == pytest.approx([share, 100 - share], abs=0.01)
    assert drawn[0][2] < drawn[1][2]
    assert "the minimum confidence, 85 %, and for rules that forbid 1 − epsilon, 95 %," in html
    assert "those that demand and then those that forbid" in html


def test_names_in_the_overview_are_no_markup(tried: RuleSet) -> None:
    action = replace(tried.actions[0], label_names=("<b>x</b>", '"y"'))
    html = overview_plot(tried.rules, replace(tried, actions=(action,)))
    assert "<b>x" not in html
    assert "&lt;b&gt;x&lt;/b&gt;" in html


def test_enough_counts_the_rules_that_are_certain_by_then() -> None:
    html = enough_plot([0.0, 5.0, 5.0, 12.0, float("inf")])
    (outline,) = re.findall(r"polygon\(([^)]*)\)", html)
    corners = [
        (float(x) / 100 * 13.2, (100 - float(y)) / 100 * 4 * 1.04)
        for x, y in re.findall(r"([\d.]+)% ([\d.]+)%", outline)
    ][1:-1]
    wanted = [(0, 1), (5, 1), (5, 3), (12, 3), (12, 4), (13.2, 4)]
    assert np.allclose(corners, wanted, atol=1e-2)
    assert "Rules that reach it, of 5<" in html
    assert 'aria-label="Of 5 rules 1 reaches the minimum confidence now, and 4 (80 %)' in html
    tips = re.findall(r'<u title="(\d) rules?', html)
    assert tips == sorted(tips)
    assert {"1", "3", "4"} == set(tips)


def test_few_of_many_rules_are_still_seen() -> None:
    html = enough_plot([3.0, 9.0] + [float("inf")] * 1_000)
    (outline,) = re.findall(r"polygon\(([^)]*)\)", html)
    assert min(float(y) for y in re.findall(r"% ([\d.]+)%", outline)) < 10
    assert "of 1,002<" in html


def test_nothing_is_missing_or_nothing_helps() -> None:
    assert "Of 2 rules 2 reach" in enough_plot([0.0, 0.0])
    assert "Of 1 rule 0 reach" in enough_plot([float("inf")])


def test_an_axis_has_few_round_numbers() -> None:
    assert round_ticks(0.0, 1.0, 5) == [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    assert round_ticks(-0.31, 0.3, 4) == [-0.2, 0.0, 0.2]
    assert round_ticks(0, 3274, 8) == [0, 500, 1000, 1500, 2000, 2500, 3000]
    for low, high in ((0.93, 1.0), (1e-7, 3e-7), (-5e4, 1e5)):
        ticks = round_ticks(low, high, 5)
        assert 2 <= len(ticks) <= 6
        assert all(low <= tick <= high * (1 + 1e-9) for tick in ticks)


def test_a_plot_places_and_escapes_what_is_written() -> None:
    across = Axis(Scale(10, 20), [10, 15], ["<ten>", "15"], "a & b")
    upwards = Axis(Scale(0, 4), [1], ["1"])
    html = plot([], across, upwards, label='"seen"', height=50, tips=["<tip>"])
    assert 'style="left:50.00%">15<' in html
    assert 'style="bottom:25.00%">1<' in html
    assert "a &amp; b" in html
    assert 'aria-label="&#34;seen&#34;"' in html
    for raw in ("<ten>", "<tip>"):
        assert raw not in html
    cut = area([(10, 1), (20, 2)], across.scale, upwards.scale, "#123456")
    assert "polygon(0.00% 100%,0.00% 75.00%,100.00% 50.00%,100.00% 100%)" in cut.style


@pytest.mark.parametrize(
    ("low", "high"), [(100, 111), (100, 101), (0.89, 1.0), (0.98, 1.0), (0, 1)]
)
def test_what_is_written_at_a_tick_is_where_it_stands(low: float, high: float) -> None:
    ticks = round_ticks(low, high, 5)
    assert [float(tick_text(tick)) for tick in ticks] == ticks
    assert all(tick == int(tick) for tick in round_ticks(low, high, 5, whole=True))


def test_rules_are_counted_in_whole_numbers() -> None:
    html = enough_plot([0.0] * 9)
    texts = re.findall(r'class="y"[^>]*>([^<]+)<', html)
    assert len(texts) > 1
    assert all(text.isdigit() for text in texts)
