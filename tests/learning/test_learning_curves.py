"""The record of learning: what it says at any step, and that it survives a file."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sarl_core.documents import MisfitError, conformed
from sarl_core.learning.curves import NO_EPISODES, Columns, LearningEpisodes, Trial


@pytest.fixture
def curve() -> LearningEpisodes:
    return Columns(
        **{
            "ends": [10, 20, 20, 35],
            "returns": [1.0, 2.0, 6.0, -3.5],
            "lengths": [10, 10, 8, 15],
            "crashed": [True, False, True, True],
            "interventions": [5, 0, 4, 3],
            "covered": [10, 10, 8, 15],
            "shielded": [True, True, True, False],
        }
    ).read()


def test_crashes_are_counted_up_to_and_with_a_step(curve: LearningEpisodes) -> None:
    steps = np.array([0, 9, 10, 19, 20, 34, 35, 99])
    assert curve.crashes_at(steps).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert curve.crashes == 3


def test_bins_hold_the_episodes_that_ended_in_them(curve: LearningEpisodes) -> None:
    bins = curve.binned(np.array([0, 10, 20, 30, 40]))
    np.testing.assert_array_equal(bins.returns, [1.0, 4.0, np.nan, -3.5])
    np.testing.assert_allclose(bins.interventions, [0.5, 4 / 18, np.nan, 0.2])


def test_episodes_outside_of_the_bins_are_left_out(curve: LearningEpisodes) -> None:
    assert curve.binned(np.array([10, 30])).returns.tolist() == [4.0]


def test_changes_are_counted_by_steps_and_not_by_episodes(curve: LearningEpisodes) -> None:
    assert curve.intervention_rate == 12 / 43
    assert np.isnan(NO_EPISODES.intervention_rate)


def test_a_curve_survives_json_and_nobody_changes_it(curve: LearningEpisodes) -> None:
    again = Columns(**json.loads(json.dumps(curve.to_dict()))).read()
    assert again.to_dict() == curve.to_dict()
    assert again.ends.dtype == np.int64
    assert again.crashed.dtype == np.bool_
    with pytest.raises(ValueError, match="read-only"):
        again.returns[0] = 0.0


def test_its_size_is_seen_at_a_glance(curve: LearningEpisodes) -> None:
    assert repr(curve) == "LearningEpisodes(episodes=4, steps=35, crashes=3)"
    assert repr(NO_EPISODES) == "LearningEpisodes(episodes=0, steps=0, crashes=0)"


@pytest.mark.parametrize(
    "damage",
    [{"ends": None}, {"returns": ["?"] * 4}, {"lengths": [1]}, {"ends": [[1, 2, 3, 4]]}],
)
def test_a_damaged_curve_is_refused(curve: LearningEpisodes, damage: dict[str, object]) -> None:
    with pytest.raises(MisfitError, match="|".join([*damage, "equally long"])):
        conformed({**curve.to_dict(), **damage}, Columns).read()
    with pytest.raises(MisfitError, match="'returns' is missing"):
        conformed({"ends": []}, Columns)


def test_a_trial_survives_json_and_is_refused_when_damaged() -> None:
    trial = Trial((1.0, 3.0), 1, 0.25, 1.0)
    assert (trial.mean, trial.crash_rate) == (2.0, 0.5)
    assert conformed(json.loads(json.dumps(trial.to_dict())), Trial) == trial
    for damage in ({"returns": 3}, {"crashes": None}, {"coverage": "all"}):
        with pytest.raises(MisfitError, match=next(iter(damage))):
            conformed({**trial.to_dict(), **damage}, Trial)
