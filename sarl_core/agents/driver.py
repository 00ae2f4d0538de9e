"""The driver who demonstrates on the motorway: a few lines of arithmetic, no network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_LEFT, _STAY, _RIGHT, _FASTER, _SLOWER = range(5)

_SOON, _CLOSE = 6.0, 25.0  # seconds and metres ahead at which something must be done
_TIME, _ROOM, _WORTH = 4.0, 8.0, 40.0  # what a lane beside must offer, to be better than braking
_ESCAPE_TIME, _ESCAPE_ROOM = 2.5, 6.0  # what does where braking is no way out any more
_SLOWEST = 21.0  # m/s; the vehicle does not brake below 20
_CRUISE, _CLEAR, _CLEAR_TIME = 24.0, 45.0, 12.0


@dataclass(frozen=True)
class Driver:
    """Keeps its lane while it is clear, else takes a better one, else brakes, else escapes.

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
        left, right = _SideLane(*sides[:3]), _SideLane(*sides[3:])
        clear = (time >= _SOON) & (gap >= _CLOSE)
        speeds_up = (time > _CLEAR_TIME) & (gap > _CLEAR) & (speed < _CRUISE)
        chosen = np.select(
            [
                clear & speeds_up,
                clear,
                left.is_better,
                right.is_better,
                speed > _SLOWEST,
                left.is_a_way_out,
                right.is_a_way_out,
            ],
            [_FASTER, _STAY, _LEFT, _RIGHT, _SLOWER, _LEFT, _RIGHT],
            _SLOWER,
        )
        return chosen.astype(np.int64)[:, None]


class _SideLane(NamedTuple):
    """What a driver sees of a lane beside, each shape (B,); zeros where there is none."""

    gap_ahead: NDArray[np.float32]
    room: NDArray[np.float32]
    time: NDArray[np.float32]

    @property
    def is_better(self) -> NDArray[np.bool_]:
        """Whether to change rather than to brake."""
        return (self.room > _ROOM) & (self.time > _TIME) & (self.gap_ahead > _WORTH)

    @property
    def is_a_way_out(self) -> NDArray[np.bool_]:
        """Whether it takes a vehicle that can brake no more."""
        return (self.room > _ESCAPE_ROOM) & (self.time > _ESCAPE_TIME)
