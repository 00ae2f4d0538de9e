"""The epsilons a person can choose: steps of the slider, and the grid of the figures."""

from __future__ import annotations

USUAL_EPSILON = 0.05
EPSILON_STEPS: tuple[float, ...] = (
    0.001,
    0.002,
    0.005,
    *(step / 100 for step in range(1, 20)),
    *(step / 20 for step in range(4, 20)),
)
FINE_EPSILONS: tuple[float, ...] = (
    0.002,
    0.005,
    0.01,
    0.015,
    *(step / 100 for step in range(2, 11)),
    *(step / 100 for step in range(12, 21, 2)),
    *(step / 20 for step in range(5, 11)),
)
