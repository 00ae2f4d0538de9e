"""One picture of one step of a recorded episode, without keeping any other picture.

A thousand frames of 600 x 400 take 720 MB. Stepping the environment again with the recorded
actions gives the same states (the same seed, the same actions), and takes milliseconds.
"""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.environments import make_environment
from sarl_core.errors import InputError
from sarl_core.rollouts.spaces import adapt
from sarl_core.rollouts.steps import StepTable


def still(env_id: str, seed: int, steps: StepTable, row: int) -> NDArray[np.uint8]:
    """The picture of the state in which a step was decided.

    Args:
        env_id: Environment of the episode.
        seed: Seed of the episode.
        steps: Of this one episode, from its first step on.
        row: Which of them; the picture is taken before its action.

    Returns:
        Shape (height, width, 3).

    Raises:
        InputError: If the environment draws no pictures, or there is no such step.
    """
    if not 0 <= row < len(steps):
        raise InputError(f"there is no step {row}; choose from 0 to {len(steps) - 1}")
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")  # there may be no display
    env = make_environment(env_id, render_mode="rgb_array")
    try:
        adapter = adapt(env)
        env.reset(seed=seed)
        for action in adapter.shaped(steps.executed[:row]):
            env.step(adapter.native(action))
        picture = env.render()
    finally:
        env.close()
    picture = np.asarray(picture) if picture is not None else np.zeros(0)
    if picture.ndim != 3 or picture.shape[2] != 3:
        raise InputError(f"{env_id} draws no pictures; choose another environment")
    return np.asarray(picture, dtype=np.uint8)
