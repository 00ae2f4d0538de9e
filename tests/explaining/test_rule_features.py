from __future__ import annotations

import math
import re

import numpy as np
import pytest

from sarl_core.demonstrations.dataset import Feature
from sarl_core.explaining.html.rule_features import MOST, features_html
from sarl_core.explaining.tables.rule_evidence import FeatureEvidence
from sarl_core.explaining.ticks import round_ticks
from sarl_core.mining.rules import Bounds


def evidence(
    low: float = -math.inf,
    high: float = math.inf,
    *,
    at_rule: tuple[float, ...] = (0, 0, 1.0, 0),
    infinite: float = 0.0,
) -> FeatureEvidence:
    """Four bins from 0 to 8."""
    return FeatureEvidence(
        0,
        Bounds(0, low, high),
        np.linspace(0.0, 8.0, 5),
        np.array([0.5, 0.25, 0.25, 0.0]),
        np.array(at_rule, dtype=float),
        infinite,
    )


HEIGHT = Feature("height", "m")


def drawn(one: FeatureEvidence, feature: Feature = HEIGHT) -> str:
    return features_html([one], [feature], "#0072B2")


def outlines(html: str) -> list[list[tuple[float, float]]]:
    """The corners of each histogram, in percent from the left and from above."""
    return [
        [(float(x), float(y)) for x, y in re.findall(r"([\d.]+)% ([\d.]+)%", f"{corners},")]
        for corners in re.findall(r"clip-path:polygon\(0.00% 100%,([^)]*)\)", html)
    ]


def test_bars_stand_over_their_bins_as_high_as_their_shares() -> None:
    everywhere, at_rule = outlines(drawn(evidence(2.0)))
    assert [x for x, _ in everywhere] == [0, 25, 25, 50, 50, 75, 75, 100, 100]
    heights = [100 - y for _, y in everywhere[:-1:2]]
    assert heights[0] == pytest.approx(2 * heights[1])
    assert heights[1] == heights[2] > heights[3] == 0
    assert [100 - y for _, y in at_rule[:-1:2]] == pytest.approx([0, 0, 2 * heights[0], 0], abs=0.1)


@pytest.mark.parametrize(
    ("low", "high", "shade", "lines"),
    [
        (2.0, 6.0, ("25.00%", "50.00%"), ["25.00%", "75.00%"]),
        (2.0, math.inf, ("25.00%", "75.00%"), ["25.00%"]),
        (-math.inf, 6.0, ("0.00%", "75.00%"), ["75.00%"]),
    ],
)
def test_the_interval_is_shaded_and_its_bounds_are_lines(
    low: float, high: float, shade: tuple[str, str], lines: list[str]
) -> None:
    html = drawn(evidence(low, high))
    assert re.findall(r'class="asked" style="left:([^;]+);width:([^"]+)"', html) == [shade]
    assert re.findall(r'class="bound" style="left:([^"]+)"', html) == lines


def test_every_bin_says_what_is_in_it_and_an_empty_one_keeps_its_room() -> None:
    html = drawn(evidence(4.0, 6.0))
    told = re.findall(r'<u title="([^"]+)"', html)
    assert told == [
        "0 to 2 m: 50 % of all states, 0 % of those of the rule",
        "2 to 4 m: 25 % of all states, 0 % of those of the rule",
        "4 to 6 m: 25 % of all states, 100 % of those of the rule",
    ]
    assert html.count("<u") == 4


def test_states_that_no_bin_can_hold_are_told() -> None:
    assert "infinite" not in drawn(evidence(2.0))
    assert "(infinite in 12 % of all states, drawn at the ends)" in drawn(
        evidence(2.0, infinite=0.12)
    )


def test_a_figure_is_told_in_words_and_in_signs() -> None:
    html = drawn(evidence(4.0))
    assert "<figcaption>height &gt; 4 m</figcaption>" in html
    assert (
        'aria-label="height of all states and those of the rule, from 0 to 8 m; '
        'the rule asks that the height is above 4 m"' in html
    )


def test_a_rule_that_no_state_reaches_has_one_histogram() -> None:
    html = drawn(evidence(4.0, at_rule=(0, 0, 0, 0)))
    assert len(outlines(html)) == 1
    assert "of the rule" not in html


def test_names_and_units_are_escaped() -> None:
    html = drawn(evidence(4.0), Feature('<b>"x"', "<i>m&"))
    for raw in ('<b>"x"', "<i>m", "m&<"):
        assert raw not in html
    assert "&lt;b&gt;&#34;x&#34;" in html
    assert "&lt;i&gt;m&amp;" in html


def test_no_more_figures_than_can_be_looked_at() -> None:
    many = [evidence(4.0)] * (MOST + 1)
    html = features_html(many, [HEIGHT], "#0072B2")
    assert html.count("<figure>") == MOST
    assert f"the first {MOST} of {MOST + 1} features" in html


@pytest.mark.parametrize(
    ("low", "high", "most", "ticks"),
    [
        (0.0, 1.0, 4, [0, 0.25, 0.5, 0.75, 1]),
        (-0.78, 0.41, 5, [-0.75, -0.5, -0.25, 0, 0.25]),
        (0.0, 0.00031, 3, [0, 0.0002]),
        (11.0, 1250.0, 5, [250, 500, 750, 1000, 1250]),
    ],
)
def test_ticks_are_round_numbers(low: float, high: float, most: int, ticks: list[float]) -> None:
    assert round_ticks(low, high, most) == ticks
