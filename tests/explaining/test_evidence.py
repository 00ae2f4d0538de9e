"""How sure a rule is, in words, tables and figures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core import mine_rules
from sarl_core.explaining import evidence_figures as figures
from sarl_core.explaining.evidence_tables import (
    enough_columns,
    held_out_columns,
    pair_columns,
    stability_columns,
)
from sarl_core.explaining.evidence_words import (
    band_text,
    decimal_text,
    evidence_bar,
    evidence_text,
    held_out_text,
    intervals_text,
    more_text,
    stability_text,
    verdict_counts,
)
from sarl_core.mining.contradictions import EpisodeContradictions, find_contradictions
from sarl_core.mining.evidence import HeldOut, wilson
from sarl_core.mining.holding_out import hold_out, more_episodes, with_held_out
from sarl_core.mining.learning_curve import LearningCurve
from sarl_core.mining.rules import Rule
from sarl_core.mining.stability import Band, RuleStability, Stability


def rule_of(samples, correct, held=None, name="0.1"):
    confidence = correct / samples if samples else 0.0
    held = None if held is None else HeldOut(*held)
    return Rule(name, 0, (), 0, 0.1, confidence, 1.0, samples, held_out=held)


@pytest.fixture(scope="module")
def tried(lander_like):
    split = hold_out(lander_like, 0.25)
    return with_held_out(mine_rules(split.mined, supp_min=0.01, conf_min=0.85), split.held_out)


def test_a_rule_says_its_shares_and_counts():
    assert evidence_text(rule_of(412, 400, (96, 87))) == "0.97 of 412, held out 0.91 of 96"
    assert evidence_text(rule_of(412, 400)) == "0.97 of 412"
    assert evidence_text(rule_of(1412, 1412, (0, 0))) == "1 of 1,412, held out no states"
    assert held_out_text(rule_of(10, 9)) == ""
    assert evidence_text(rule_of(0, 0)) == "no states"


def test_its_intervals_are_wilsons():
    low, high = wilson(400, 412)
    assert intervals_text(rule_of(412, 400)) == f"95 % interval {low:.2f} to {high:.2f}"
    low, high = wilson(87, 96)
    told = intervals_text(rule_of(412, 400, (96, 87)))
    assert told.endswith(f", held out {low:.2f} to {high:.2f}")
    assert intervals_text(rule_of(0, 0)) == ""


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0"),
        (1.0, "1"),
        (0.5, "0.50"),
        (0.999, "0.999"),
        (0.99996, "> 0.9999"),
        (0.004, "0.004"),
        (0.00001, "< 0.0001"),
    ],
)
def test_a_share_never_rounds_to_all_or_nothing(share, text):
    assert decimal_text(share) == text


@pytest.mark.parametrize(
    ("more", "text"),
    [
        (0.0, "enough"),
        (1.0, "1 more episode"),
        (1234.0, "1,234 more episodes"),
        (float("inf"), "never at this rate"),
    ],
)
def test_what_is_missing_is_said(more, text):
    assert more_text(more) == text


def test_a_band_and_a_return_are_said():
    assert band_text(Band(0, ">", 0.0213, 0.018, 0.025, 9), "angle", "rad") == (
        "angle > 0.0213 rad (0.018 to 0.025)"
    )
    assert band_text(Band(0, "<=", 2.0, float("nan"), float("nan"), 0), "speed") == (
        "speed ≤ 2 (not asked again)"
    )
    assert stability_text(RuleStability("0.1", 0.9, 0.8, ()), 30) == "came back in 27 of 30 rounds"


def test_the_bar_marks_the_threshold_and_stays_within_its_scale():
    bar = evidence_bar(rule_of(412, 400, (96, 60)), 0.95)
    places = [float(part.split("%")[0]) for part in bar.split('style="left:')[1:]]
    assert all(0 <= place <= 100 for place in places)
    assert bar.count('class="m"') == 2
    assert "held out" in bar
    assert "#D55E00" in bar  # too low
    assert evidence_bar(rule_of(0, 0), 0.95) == ""
    assert "held out" not in evidence_bar(rule_of(412, 400), 0.95)


def test_columns_hold_what_was_counted(tried):
    columns = held_out_columns(tried.rules, 0.85)
    assert list(columns) == ["Held out", "Verdict", "Lower bound"]
    for rule, text, bound in zip(
        tried.rules, columns["Held out"], columns["Lower bound"], strict=True
    ):
        assert text.endswith(f" of {rule.held_out.samples}")
        assert bound == wilson(rule.held_out.correct, rule.held_out.samples).low
    counts = verdict_counts(tried.rules, 0.85)
    words = [columns["Verdict"].count(word) for word in ("too low", "open", "reached")]
    assert words == [counts["below"], counts["open"], counts["reached"]]
    assert held_out_columns([replace(rule, held_out=None) for rule in tried.rules], 0.85) == {}


def test_tables_have_a_row_a_rule(tried):
    missing = [more_episodes(rule, 20, 0.85) for rule in tried.rules]
    columns = enough_columns(tried.rules, tried, missing, 0.85)
    assert columns["Still missing"] == [more_text(more) for more in missing]
    one = tuple(RuleStability(rule.id, 0.5, 0.4, ()) for rule in tried.rules)
    stable = stability_columns(tried.rules, tried, Stability(4, 0.5, one))
    assert {len(values) for values in (*columns.values(), *stable.values())} == {len(tried)}


def test_pairs_of_states_differ_and_the_nearest_come_first(lander_like):
    found = find_contradictions(lander_like, reach=1.0)
    columns = pair_columns(lander_like, found, most=30)
    pairs = [
        frozenset(pair)
        for pair in zip(
            zip(columns["Episode"], columns["Step"], strict=True),
            zip(columns["Other episode"], columns["Other step"], strict=True),
            strict=True,
        )
    ]
    assert len(set(pairs)) == len(pairs)
    assert len(columns["Did"]) == 30
    assert columns["Distance"] == sorted(columns["Distance"])
    for episode, step, other, there, did, did_there in zip(
        columns["Episode"],
        columns["Step"],
        columns["Other episode"],
        columns["Other step"],
        columns["Did"],
        columns["Did there"],
        strict=True,
    ):
        assert episode != other
        assert did != did_there
        rows = [
            np.flatnonzero((lander_like.episodes == e) & (lander_like.steps == s))[0]
            for e, s in ((episode, step), (other, there))
        ]
        assert [str(lander_like.actions[row]) for row in rows] == [did, did_there]


def test_the_curve_draws_mean_and_range():
    values = np.array([[1.0, 2.0, np.nan], [3.0, 2.0, np.nan]])
    curve = LearningCurve(np.array([1, 5, 9]), values, values, values, values, "not yet used")
    for layer in figures.CURVE_TITLES:
        band, line = figures.curve_figure(curve, layer).data
        assert list(line.x) == [1, 5]
        assert list(line.y) == [2.0, 2.0]
        assert list(band.y) == [3.0, 2.0, 2.0, 1.0]
    nothing = np.full((2, 3), np.nan)
    empty = LearningCurve(np.array([1, 5, 9]), values, values, values, nothing, "not yet used")
    assert len(figures.curve_figure(empty, "fidelity").data[1].x) == 0


def test_episodes_are_bars_in_their_order():
    some = [EpisodeContradictions(7, 100, 1, 30, 31), EpisodeContradictions(3, 50, 0, 1, 1)]
    bars = figures.contradictions_figure(some).data[0]
    assert list(bars.x) == ["7", "3"]
    assert list(bars.y) == [0.31, 0.02]
