from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sarl_core import PolicyTree, mine_rules
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.landscape import PAPER_CONFIDENCES, PAPER_SUPPORTS
from sarl_core.mining.thresholds.steps import (
    CONFIDENCE_STEPS,
    FINE_CONFIDENCES,
    FINE_SUPPORTS,
    SUPPORT_STEPS,
    neat_between,
    neat_jumps,
    neat_point,
    with_step,
)


def ids(trees: tuple[PolicyTree, ...], at: Thresholds) -> set[str]:
    return {
        rule.id for rule in mine_rules(trees, supp_min=at.support, conf_min=at.confidence).rules
    }


@pytest.mark.parametrize("steps", [SUPPORT_STEPS, CONFIDENCE_STEPS])
def test_steps_ascend_from_none_to_all(steps: tuple[float, ...]) -> None:
    assert steps[0] == 0.0
    assert steps[-1] == 1.0
    assert list(steps) == sorted(set(steps))


def test_every_cell_of_the_maps_and_every_named_setting_is_a_step() -> None:
    assert {*FINE_SUPPORTS, *PAPER_SUPPORTS.tolist(), 0.005} <= set(SUPPORT_STEPS)
    assert {*FINE_CONFIDENCES, *PAPER_CONFIDENCES.tolist(), 0.95} <= set(CONFIDENCE_STEPS)


def test_a_step_is_added_in_its_place_and_only_once() -> None:
    assert with_step((0.0, 0.5, 1.0), 0.25) == (0.0, 0.25, 0.5, 1.0)
    assert with_step((0.0, 0.5, 1.0), 0.5) == (0.0, 0.5, 1.0)


@given(st.floats(0, 1), st.floats(0, 1))
def test_a_neat_number_lies_in_its_interval(one: float, other: float) -> None:
    low, high = sorted((one, other))
    if low < high:
        assert low < neat_between(low, high) <= high


def test_a_neat_number_has_few_decimals() -> None:
    assert neat_between(74 / 15000, 75 / 15000, decimals=3) == 0.005
    assert neat_between(0.123456, 0.129, decimals=2) == 0.129


@pytest.mark.parametrize(
    ("support", "confidence"), [(0.005, 0.95), (0.0, 1.0), (0.02, 0.5), (0.3, 0.2), (0.0105, 0.9)]
)
def test_jumps_change_the_rules_and_not_before(
    lander_trees: tuple[PolicyTree, ...], support: float, confidence: float
) -> None:
    here = Thresholds(support, confidence)
    jumps = neat_jumps(lander_trees, here)
    for name, value in jumps._asdict().items():
        if value is None:
            continue
        axis, side = name.split("_")
        moved = Thresholds(value, confidence) if axis == "support" else Thresholds(support, value)
        assert (value < getattr(here, axis)) == (side == "below")
        assert ids(lander_trees, moved) != ids(lander_trees, here), name
        # Halfway there nothing has changed, unless the jump rounds to fewer decimals.
        edge = math.nextafter(getattr(here, axis), value)
        near = Thresholds(edge, confidence) if axis == "support" else Thresholds(support, edge)
        assert ids(lander_trees, near) in (ids(lander_trees, here), ids(lander_trees, moved))


def test_a_neat_point_gives_the_same_rules(lander_trees: tuple[PolicyTree, ...]) -> None:
    awkward = Thresholds(13 / 2000, 0.8571428571428571)
    neat = neat_point(lander_trees, awkward)
    assert ids(lander_trees, neat) == ids(lander_trees, awkward)
    assert neat.support <= awkward.support
    assert len(repr(neat.confidence)) < len(repr(awkward.confidence))
