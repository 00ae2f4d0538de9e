"""Driving on a motorway: highway-env's task, with what a driver looks at as its features.

The simulator is Eleurent's `highway-env` (https://github.com/Farama-Foundation/HighwayEnv), which
tells positions and speeds of the vehicles around in a table. Nobody reads a rule about "vehicle 3:
vx"; here the same scene is told as gaps and times to collision in the three lanes that matter.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

ENV_ID = "Driving-v0"

N_FEATURES = 9
FAR = 100.0  # metres; further away is nobody
LONG = 20.0  # seconds; later is never
_VEHICLE_LENGTH = 5.0


class TrafficFeatures(gymnasium.ObservationWrapper[NDArray[np.float32], Any, Any]):
    """Gaps and times to collision in the own lane and in the lanes beside it.

    The features are called as `describe_environment("Driving-v0")` says, shape (9,): speed, gap and
    time to collision ahead; then, on the left and on the right, the gap ahead, the room (the
    smaller of the gaps ahead and behind) and the time to collision (the sooner of the two).

    A gap is counted from bumper to bumper, up to 100 m; a time to collision is the gap over the
    speed at which it closes, up to 20 s. Where there is no lane, all three are 0. While the vehicle
    changes lanes, "ahead" is the nearer of who is ahead in the lane that it leaves and in the lane
    that it aims at.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        """Wrap an environment of highway-env with parallel lanes.

        Args:
            env: As ``gymnasium.make("highway_env:highway-fast-v0")``.
        """
        super().__init__(env)
        beside = [FAR, FAR, LONG]
        high = np.array([np.inf, FAR, LONG, *beside, *beside], dtype=np.float32)
        low = np.array([-np.inf, *[0.0] * (N_FEATURES - 1)], dtype=np.float32)
        self.observation_space = spaces.Box(low, high)

    def observation(self, observation: Any) -> NDArray[np.float32]:
        """The features of the present scene, shape (14,), whatever the simulator's own table."""
        own, road = self.get_wrapper_attr("vehicle"), self.get_wrapper_attr("road")
        start, end, aimed_at = own.target_lane_index
        lanes = road.network.graph[start][end]

        def traffic(lane: int) -> tuple[_Gap, _Gap]:
            """Who is ahead, and who is behind."""
            ahead, behind = _neighbours(road, own, (start, end, lane))
            return _gap(own, ahead), _gap(behind, own)

        def beside(lane: int) -> list[float]:
            """Gap ahead, room, time to collision."""
            if not 0 <= lane < len(lanes):
                return [0.0] * 3
            ahead, behind = traffic(lane)
            return [ahead.metres, *map(min, ahead, behind)]

        ahead = map(min, traffic(own.lane_index[2])[0], traffic(aimed_at)[0])
        return np.array(
            [own.speed, *ahead, *beside(aimed_at - 1), *beside(aimed_at + 1)], dtype=np.float32
        )


class _Gap(NamedTuple):
    """Between two vehicles: from bumper to bumper, and until it is closed (s)."""

    metres: float
    seconds: float


def _neighbours(road: Any, own: Any, index: tuple[str, str, int]) -> tuple[Any, Any]:
    """Who is next ahead and next behind in a lane; who changes into it is in it already."""
    lane = road.network.get_lane(index)
    place = lane.local_coordinates(own.position)[0]
    ahead = behind = None
    nearest_ahead, nearest_behind = np.inf, -np.inf
    for vehicle in road.vehicles:
        along, aside = lane.local_coordinates(vehicle.position)
        if vehicle is own or not (
            vehicle.target_lane_index == index
            or lane.on_lane(vehicle.position, along, aside, margin=1)
        ):
            continue
        if 0.0 <= along - place < nearest_ahead:
            ahead, nearest_ahead = vehicle, along - place
        elif nearest_behind < along - place < 0.0:
            behind, nearest_behind = vehicle, along - place
    return ahead, behind


def _gap(follower: Any, leader: Any) -> _Gap:
    if follower is None or leader is None:
        return _Gap(FAR, LONG)
    metres = max(float(leader.position[0] - follower.position[0]) - _VEHICLE_LENGTH, 0.0)
    closing = float(follower.speed - leader.speed)
    if metres >= FAR or closing <= 0.0:
        return _Gap(min(metres, FAR), LONG)
    return _Gap(metres, min(metres / closing, LONG))


def make_driving(**arguments: Any) -> gymnasium.Env[Any, Any]:
    """The task as ``gymnasium.make("Driving-v0")`` makes it.

    Args:
        arguments: Of `highway-env`'s own environment: `render_mode`, `config`.

    Returns:
        Three lanes, 20 vehicles, 30 decisions of a second each.
    """
    # The simulator's own table is made each step and not looked at; the smallest is the fastest.
    config = {"observation": {"type": "Kinematics", "vehicles_count": 1, "normalize": False}}
    arguments["config"] = config | arguments.get("config", {})
    made = gymnasium.make("highway_env:highway-fast-v0", disable_env_checker=True, **arguments)
    return TrafficFeatures(made)


if ENV_ID not in gymnasium.registry:
    gymnasium.register(ENV_ID, make_driving, disable_env_checker=True)
