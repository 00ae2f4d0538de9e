"""The driver who demonstrates on the motorway: a few lines of arithmetic, no network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_LEFT, _STAY, _RIGHT, _FASTER, _SLOWER = range(5)

_SLOWEST = 21.0  # m/s; the vehicle does not brake below 20
_CLOSE, _SOON = 20.0, 6.0  # metres and seconds ahead at which something must be done
_CLOSE_AT_SLOWEST, _SOON_AT_SLOWEST = 30.0, 12.0  # where braking is no way out any more
_BRAKING_GAP, _BRAKING_TIME = 12.0, 3.0  # below which braking comes too late
_ROOM, _TIME = 8.0, 2.5  # what a lane must offer beside and behind
_WORTH, _LATER = 40.0, 8.0  # metres and seconds, which make it better than braking
_ESCAPE = 6.0  # metres of room that do where nothing else helps
_CRUISE, _CLEAR, _CLEAR_TIME = 24.0, 45.0, 12.0


@dataclass(frozen=True)
class Driver:
    """Keeps its lane while it is clear, brakes while that is enough, and changes lanes in time.

    Attributes:
        name: What it is called on screen.
    """

    name: str = "expert"

    @property
    def n_uniforms(self) -> int:
        """None: the same scene, the same action."""
        return 0

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> NDArray[np.int64]:
        """See `Agent.act`; observations of Driving-v0, shape (B, 9)."""
        speed, gap, time, *sides = observations.T
        lanes = _SideLane(*sides[:3]), _SideLane(*sides[3:])
        fast = speed > _SLOWEST
        clear = (time >= np.where(fast, _SOON, _SOON_AT_SLOWEST)) & (
            gap >= np.where(fast, _CLOSE, _CLOSE_AT_SLOWEST)
        )
        brakes = fast & (time > _BRAKING_TIME) & (gap > _BRAKING_GAP)
        left, right = (
            (lane.room > _ROOM)
            & (lane.time > np.where(brakes, _LATER, _TIME))
            & (lane.gap_ahead > _WORTH)
            for lane in lanes
        )
        escape_left, escape_right = (
            (lane.room > _ESCAPE) & (lane.time > _TIME) & ~brakes for lane in lanes
        )
        speeds_up = (time > _CLEAR_TIME) & (gap > _CLEAR) & (speed < _CRUISE)
        chosen = np.select(
            [clear & speeds_up, clear, left, right, escape_left, escape_right],
            [_FASTER, _STAY, _LEFT, _RIGHT, _LEFT, _RIGHT],
            _SLOWER,
        )
        return chosen.astype(np.int64)[:, None]


class _SideLane(NamedTuple):
    """What a driver sees of a lane beside, each shape (B,); zeros where there is none."""

    gap_ahead: NDArray[np.float32]
    room: NDArray[np.float32]
    time: NDArray[np.float32]
