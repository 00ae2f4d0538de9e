from __future__ import annotations

import numpy as np
import pytest

from sarl_core import Demonstrations


@pytest.fixture(scope="session")
def two_torques() -> Demonstrations:
    """Six hundred steps with two continuous action dimensions."""
    rng = np.random.default_rng(3)
    observations = rng.normal(size=(600, 3)).astype(np.float32)
    actions = np.clip(observations[:, :2] + 0.1 * rng.normal(size=(600, 2)), -2, 2)
    return Demonstrations(
        observations,
        actions.astype(np.float32),
        np.repeat(np.arange(6), 100),
        action_names=("hip", "knee"),
        action_low=(-2.0, -2.0),
        action_high=(2.0, 2.0),
        bounds_from="action space",
    )
