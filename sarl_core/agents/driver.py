"""The driver who demonstrates on the motorway: a few lines of arithmetic, no network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_LEFT, _STAY, _RIGHT, _FASTER, _SLOWER = range(5)

_CLOSE, _SOON = 20.0, 6.0  # metres and seconds ahead at which something must be done
_SOON_AT_SLOWEST = 12.0  # seconds, where braking is no way out any more
_BRAKING_GAP, _BRAKING_TIME = 12.0, 3.0  # below which braking comes too late
_SLOWEST = 21.0  # m/s; the vehicle does not brake below 20
_ROOM, _LATER = 15.0, 8.0  # what a lane must offer more, before it is taken in place of braking
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
        """See `Agent.act`; observations of Driving-v0, shape (B, 14)."""
        speed, _, to_the_left, to_the_right, gap, time, *sides = observations.T
        left, right = _SideLane(to_the_left, *sides[:4]), _SideLane(to_the_right, *sides[4:])
        brakes = speed > _SLOWEST
        clear = (time >= np.where(brakes, _SOON, _SOON_AT_SLOWEST)) & (gap >= _CLOSE)
        brakes &= (time > _BRAKING_TIME) & (gap > _BRAKING_GAP)
        can_left, can_right = (
            lane.open
            & np.where(
                brakes,
                (lane.time_ahead > _LATER) & (lane.gap_ahead > gap + _ROOM),
                lane.gap_ahead > gap,
            )
            for lane in (left, right)
        )
        left_first = left.gap_ahead >= right.gap_ahead
        speeds_up = (time > _CLEAR_TIME) & (gap > _CLEAR) & (speed < _CRUISE)
        chosen = np.select(
            [clear & speeds_up, clear, can_left & (left_first | ~can_right), can_right],
            [_FASTER, _STAY, _LEFT, _RIGHT],
            _SLOWER,
        )
        return chosen.astype(np.int64)[:, None]


class _SideLane(NamedTuple):
    """What a driver sees of a lane beside, each shape (B,)."""

    lanes: NDArray[np.float32]
    gap_ahead: NDArray[np.float32]
    time_ahead: NDArray[np.float32]
    gap_behind: NDArray[np.float32]
    time_behind: NDArray[np.float32]

    @property
    def open(self) -> NDArray[np.bool_]:
        """Whether there is such a lane, and room in it."""
        return (
            (self.lanes > 0)
            & (self.gap_ahead > 8.0)
            & (self.time_ahead > 2.5)
            & (self.gap_behind > 6.0)
            & (self.time_behind > 2.5)
        )
