"""The motorway: what its features say is what is on the road, and its driver looks at them."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from sarl_core.agents.driver import Driver
from sarl_core.environments.description import describe_environment, make_environment
from sarl_core.errors import InputError
from sarl_core.rendering.camera import no_display, picture_of
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.trial import make_agent

NAMES = describe_environment("Driving-v0").feature_names


@pytest.fixture
def road():
    env = make_environment("Driving-v0")
    env.reset(seed=0)
    yield env
    env.close()


def features(env) -> dict[str, float]:
    observed = env.env.observation(None)
    assert observed in env.observation_space
    return dict(zip(NAMES, observed.tolist(), strict=True))


def place(env, lane: int, ahead: float, speed: float) -> None:
    """Empty the road, but for the own vehicle in the middle lane and another one."""
    scene = env.unwrapped
    own, other = scene.vehicle, scene.road.vehicles[1]
    scene.road.vehicles = [own, other]
    for vehicle, index, along in ((own, 1, 500.0), (other, lane, 500.0 + ahead)):
        vehicle.lane_index = vehicle.target_lane_index = ("0", "1", index)
        vehicle.lane = scene.road.network.get_lane(vehicle.lane_index)
        vehicle.position = vehicle.lane.position(along, 0)
    own.speed, other.speed = 25.0, speed


def test_who_is_ahead_is_told_by_gap_and_time(road):
    place(road, lane=1, ahead=45.0, speed=20.0)
    seen = features(road)
    assert seen["gap ahead"] == pytest.approx(40.0)  # bumper to bumper, vehicles of 5 m
    assert seen["time to collision ahead"] == pytest.approx(8.0)
    assert seen["gap ahead on the left"] == 100.0
    assert seen["room on the left"] == seen["room on the right"] == 100.0


def test_who_comes_from_behind_is_told_in_the_lane_beside(road):
    place(road, lane=0, ahead=-35.0, speed=30.0)
    seen = features(road)
    assert seen["room on the left"] == pytest.approx(30.0)
    assert seen["time to collision on the left"] == pytest.approx(6.0)
    assert seen["gap ahead on the left"] == seen["room on the right"] == 100.0


def test_who_changes_into_a_lane_is_in_it(road):
    place(road, lane=2, ahead=20.0, speed=20.0)
    assert features(road)["gap ahead"] == 100.0
    road.unwrapped.road.vehicles[1].target_lane_index = ("0", "1", 1)
    assert features(road)["gap ahead"] == pytest.approx(15.0)


def test_a_lane_that_is_not_there_offers_no_room(road):
    road.unwrapped.vehicle.target_lane_index = ("0", "1", 0)
    seen = features(road)
    assert [value for name, value in seen.items() if name.endswith("on the left")] == [0.0] * 3


def test_the_driver_changes_to_the_lane_with_room_and_brakes_where_there_is_none():
    clear, full, gone = [100.0, 100.0, 20.0], [3.0, 3.0, 0.5], [0.0] * 3
    scenes = [
        [25, 15, 4, *clear, *full],
        [25, 15, 4, *gone, *clear],
        [25, 15, 4, *full, *gone],
        [25, 100, 20, *full, *full],
        [20, 100, 20, *full, *full],
        [20, 15, 4, 20, 7, 3, *gone],  # too slow to brake: the lane that is just wide enough
    ]
    chosen = Driver().act(np.array(scenes, dtype=np.float32), None)
    words = describe_environment("Driving-v0").label_names[0]
    assert [words[label] for label in chosen[:, 0]] == [
        "change to the left lane",
        "change to the right lane",
        "slower",
        "keep on",
        "faster",
        "change to the left lane",
    ]


def test_the_shipped_expert_of_the_motorway_arrives():
    played = rollout("Driving-v0", make_agent("expert", "Driving-v0"), episodes=2, seed=0)
    assert played.lengths.tolist() == [30, 30]


def test_a_picture_of_the_road_is_drawn_without_a_screen():
    with no_display():
        env = make_environment("Driving-v0", render_mode="rgb_array")
        env.reset(seed=0)
        assert len(np.unique(picture_of(env, "Driving-v0"))) > 3
        env.close()


def test_an_end_on_the_motorway_is_a_crash():
    played = rollout("Driving-v0", "novice", episodes=3, seed=0)
    shortened = played.lengths < 30
    assert shortened.any()
    assert played.failed.tolist() == shortened.tolist()


def test_who_lacks_the_simulator_is_told_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "highway_env", None)
    with pytest.raises(InputError, match=r"not installed .*sarl-explorer\[driving\]"):
        make_environment("Driving-v0")
