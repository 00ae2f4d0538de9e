"""How sure a rule is, in words, tables and figures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core import mine_rules
from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.figures import evidence as figures
from sarl_core.explaining.html.evidence_bar import evidence_bar
from sarl_core.explaining.tables.evidence import (
    enough_columns,
    held_out_columns,
    pair_columns,
    stability_columns,
)
from sarl_core.explaining.words.evidence import (
    band_text,
    episodes_text,
    evidence_text,
    held_out_interval_text,
    held_out_text,
    influence_text,
    more_text,
    never_text,
    range_text,
    remedy_text,
    shortfall_text,
    verdict_counts,
)
from sarl_core.mining.evidence import HeldOut, Interval
from sarl_core.mining.rules import Rule
from sarl_core.mining.validation.contradictions import EpisodeContradictions, find_contradictions
from sarl_core.mining.validation.episode_counts import Influence
from sarl_core.mining.validation.holding_out import (
    Shortfall,
    hold_out,
    more_episodes,
    with_held_out,
)
from sarl_core.mining.validation.learning_curve import MiningCurve
from sarl_core.mining.validation.stability import Band, RuleStability, Stability


def rule_of(samples, correct, held=None, name="0.1"):
    confidence = correct / samples if samples else 0.0
    held = None if held is None else HeldOut(*held)
    return Rule(name, 0, (), 0, 0.1, confidence, 1.0, samples, held_out=held)


@pytest.fixture(scope="module")
def tried(lander_like):
    split = hold_out(lander_like, 0.25)
    return with_held_out(mine_rules(split.mined, supp_min=0.01, conf_min=0.85), split.held_out)


SURE = (96, 87, 14, 0.912, 0.78, 0.991)


def test_a_rule_says_its_shares_and_counts():
    assert evidence_text(rule_of(412, 400, SURE)) == (
        "97.1 % of 412 states; held out: 91.2 % in 14 episodes (96 states)"
    )
    assert evidence_text(rule_of(412, 400)) == "97.1 % of 412 states"
    nothing = rule_of(1412, 1412, (0, 0, 0, None, None, None))
    assert evidence_text(nothing) == "100 % of 1,412 states; held out: no states"
    older = rule_of(412, 400, (96, 87, 0, None, None, None))
    assert evidence_text(older) == "97.1 % of 412 states; held out: 90.6 % of 96 states"
    assert held_out_text(None) == ""
    assert evidence_text(rule_of(0, 0)) == "no states"


def test_an_interval_is_said_or_why_there_is_none():
    assert held_out_interval_text(HeldOut(*SURE)) == "78 to 99.1 %"
    assert held_out_interval_text(HeldOut(4, 4, 4, 1.0, None, None)) == "too few episodes"
    assert held_out_interval_text(None) == ""
    assert range_text(Interval(0.0, 1.0)) == "0 to 100 %"
    assert range_text(Interval(0.5, 0.99996)) == "50 to > 99.99 %"
    assert range_text(Interval(0.496, 0.502)) == "49.60 to 50.20 %"
    assert range_text(Interval(0.5, 0.5)) == "50 to 50 %"


@pytest.mark.parametrize(
    ("held", "told"),
    [
        (
            SURE,
            "In 14 episodes that it was not mined from, it was right in 91.2 % of its states on "
            "average, and between 78 and 99.1 % is what that can tell.",
        ),
        (
            (8, 7, 3, 0.88, None, None),
            "In 3 episodes that it was not mined from, it was right in 88 % of its states on "
            "average; that is too few to say more.",
        ),
        (
            (1, 1, 1, 1.0, None, None),
            "In 1 episode that it was not mined from, it was right in 100 % of its states on "
            "average; one is too few to say more.",
        ),
        (
            (0, 0, 0, None, None, None),
            "There was no state for it in the episodes that it was not mined from.",
        ),
        (
            (96, 87, 0, None, None, None),
            "Of 96 states that it was not mined from, it was right in 90.6 %; the file does not "
            "say in how many episodes.",
        ),
    ],
)
def test_other_episodes_are_told_as_a_sentence(held, told):
    assert episodes_text(HeldOut(*held), what="it was right") == told


def test_an_episode_that_moves_a_number_is_named():
    assert influence_text(Influence(41, 1000, 0.97, 0.71)) == (
        "without episode 41 (1,000 steps) it would be 71 % instead of 97 %"
    )
    assert influence_text(Influence(41, 1000, 0.97, 0.975)) == ""
    assert influence_text(None) == ""


@pytest.mark.parametrize(
    ("more", "text"),
    [
        (0.0, "enough"),
        (1.0, "1 more episode"),
        (1234.0, "1,234 more episodes"),
        (float("inf"), "never at this rate"),
        (float("nan"), "too few episodes to say"),
    ],
)
def test_what_is_missing_is_said(more, text):
    assert more_text(more) == text


def test_a_band_and_a_return_are_said():
    assert band_text(Band(0, ">", 0.0213, 0.018, 0.025, 9), Feature("angle", "rad")) == (
        "angle > 0.0213 rad (0.018 to 0.025)"
    )
    assert band_text(Band(0, "<=", 2.0, float("nan"), float("nan"), 0), Feature("speed")) == (
        "speed ≤ 2 (not asked again)"
    )


def test_rules_below_a_lower_bound_are_told_by_their_reason():
    assert shortfall_text(Shortfall(0.8, 12, 2, 4, 3, 0.84)) == (
        "2 of 9 rules reach 80 %; 4 were met in too few held-out episodes to show that even if "
        "never wrong, and 3 were not right often enough"
    )
    assert shortfall_text(Shortfall(0.8, 12, 1, 1, 1, 0.84)) == (
        "1 of 3 rules reaches 80 %; 1 was met in too few held-out episodes to show that even if "
        "never wrong, and 1 was not right often enough"
    )
    assert shortfall_text(Shortfall(0.8, 12, 2, 0, 0, 0.84)) == "2 of 2 rules reach 80 %"


@pytest.mark.parametrize(
    ("found", "there", "expected"),
    [
        (
            Shortfall(0.9, 12, 0, 8, 0, 0.781),
            62,
            "12 held-out episodes can show at most 87.8 %, even of a rule that is never wrong; "
            "hold out at least 15 of the 62 (25 %), or ask for less: the best of these rules "
            "shows 78.1 %",
        ),
        (
            Shortfall(0.9, 12, 0, 8, 0, 0.781),
            29,
            "12 held-out episodes can show at most 87.8 %, even of a rule that is never wrong, "
            "and 90 % takes at least 15: too many of the 29 there are; demonstrate more, or ask "
            "for less: the best of these rules shows 78.1 %",
        ),
        (
            Shortfall(1.0, 12, 0, 8, 0, 0.781),
            62,
            "12 held-out episodes can show at most 87.8 %, even of a rule that is never wrong, "
            "and no number of them can show 100 %; ask for less: the best of these rules shows "
            "78.1 %",
        ),
        (
            Shortfall(0.5, 3, 0, 8, 0, 0.0),
            62,
            "3 held-out episodes can show nothing of a rule; hold out at least 5 of the 62 (9 %)",
        ),
        (
            Shortfall(0.8, 12, 0, 2, 6, 0.781),
            62,
            "the best of these rules shows 78.1 %; ask for less, or hold out more episodes, so "
            "that each rule is met in more of those held out",
        ),
        (
            Shortfall(0.8, 12, 0, 8, 0, 0.0),
            20,
            "demonstrate more episodes, so that each rule is met in more of those held out",
        ),
        (Shortfall(0.8, 12, 1, 2, 6, 0.81), 62, ""),
        (Shortfall(0.9, 12, 0, 0, 0, 0.0), 62, ""),
    ],
)
def test_what_to_do_where_no_rule_reaches_a_lower_bound(found, there, expected):
    assert remedy_text(found, there) == expected


def test_what_to_do_is_written_as_it_is_typed():
    told = remedy_text(Shortfall(0.9, 12, 0, 8, 0, 0.7899), 62, in_command=True)
    assert "hold out at least 15 of the 62 (--hold-out 0.25), or" in told
    assert told.endswith("shows 79.0 % (--lower-bound 0.78)")


def test_where_no_number_of_episodes_helps_that_is_said():
    never, unknown = float("inf"), float("nan")
    assert never_text([never, unknown, never]) == (
        "No rule would reach it: 2 never do at this rate, and 1 was met in too few held-out "
        "episodes to say."
    )
    assert never_text([unknown] * 2) == (
        "No rule would reach it: 2 were met in too few held-out episodes to say."
    )
    assert never_text([never, 12.0]) == never_text([0.0]) == ""


def test_the_bar_marks_the_threshold_and_stays_within_its_scale():
    bar = evidence_bar(rule_of(412, 400, (96, 60, 14, 0.62, 0.5, 0.75)), 0.95)
    places = [float(part.split("%")[0]) for part in bar.split('style="left:')[1:]]
    assert all(0 <= place <= 100 for place in places)
    assert bar.count('class="m"') == 2
    assert "held out" in bar
    assert "#D55E00" in bar  # too low
    assert bar.count('class="w"') == 1  # of what it was mined from there is none
    assert 'class="w"' not in evidence_bar(rule_of(412, 400, (9, 6, 3, 0.6, None, None)), 0.95)
    assert evidence_bar(rule_of(0, 0), 0.95) == ""
    assert "held out" not in evidence_bar(rule_of(412, 400), 0.95)


def test_columns_hold_what_was_counted(tried):
    columns = held_out_columns(tried.rules, tried.thresholds)
    assert list(columns) == ["Held out", "Verdict", "Lower bound"]
    for rule, text, bound in zip(
        tried.rules, columns["Held out"], columns["Lower bound"], strict=True
    ):
        assert text.endswith(("episodes", "episode", "no states"))
        low = rule.held_out.low
        assert bound == (low if low is None else pytest.approx(100 * low))
    counts = verdict_counts(tried.rules, tried.thresholds)
    said = ("too low", "open", "reached", "too few episodes")
    words = [columns["Verdict"].count(word) for word in said]
    assert words == [counts[name] for name in ("below", "open", "reached", "unknown")]
    assert (
        held_out_columns([replace(rule, held_out=None) for rule in tried.rules], tried.thresholds)
        == {}
    )


def test_tables_have_a_row_a_rule(tried):
    missing = more_episodes(tried.rules, 20, tried.thresholds)
    moved = [Influence(3, 100, 0.9, 0.8)] * len(tried)
    columns = enough_columns(tried.rules, tried, missing, moved)
    assert columns["Rule"] == [f"R{place}" for place in range(1, len(tried) + 1)]
    assert columns["Held out"] == [held_out_text(rule.held_out) for rule in tried.rules]
    assert columns["Still missing"] == [more_text(more) for more in missing]
    assert set(columns["Moved most by"]) == {"episode 3: 80 % without it"}
    one = tuple(RuleStability(rule.id, 0.5, 0.4, ()) for rule in tried.rules)
    stable = stability_columns(tried.rules, tried, Stability(4, 0.5, one))
    assert set(stable["Comes back"]) == {50.0}
    assert set(stable["Overlap"]) == {40.0}
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
    curve = MiningCurve(np.array([1, 5, 9]), values, values, values, values, "not yet used")
    for layer in figures.CURVE_TITLES:
        band, line = figures.curve_figure(curve, layer).data
        assert list(line.x) == [1, 5]
        assert list(line.y) == [2.0, 2.0]
        assert list(band.y) == [3.0, 2.0, 2.0, 1.0]
    nothing = np.full((2, 3), np.nan)
    empty = MiningCurve(np.array([1, 5, 9]), values, values, values, nothing, "not yet used")
    assert len(figures.curve_figure(empty, "fidelity").data[1].x) == 0


def test_episodes_are_bars_in_their_order():
    some = [EpisodeContradictions(7, 100, 1, 30, 31), EpisodeContradictions(3, 50, 0, 1, 1)]
    bars = figures.contradictions_figure(some).data[0]
    assert list(bars.x) == ["7", "3"]
    assert list(bars.y) == [0.31, 0.02]
