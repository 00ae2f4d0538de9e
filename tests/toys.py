"""Small environments with every kind of space, registered for these tests."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces


class Toy(gymnasium.Env[Any, Any]):
    """Random observations; the reward is the sum of the action; refuses a foreign action."""

    def __init__(self, **kwargs: Any):
        observations, actions, steps = (kwargs[k] for k in ("observations", "actions", "steps"))
        self.observation_space, self.action_space = observations, actions
        self.steps = steps
        self.metadata = {"render_modes": []}

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.observation_space.seed(int(self.np_random.integers(2**31)))
        self.left = int(self.np_random.integers(1, self.steps + 1))
        return self.observation_space.sample(), {}

    def step(self, action: Any) -> Any:
        assert self.action_space.contains(action), repr(action)
        reward = float(np.sum(action))
        if isinstance(action, np.ndarray):
            action *= 0  # an environment may spoil what it was given
        self.left -= 1
        return self.observation_space.sample(), reward, self.left == 0, False, {}


TOYS = {
    "toy/Offset-v0": (spaces.Discrete(5), spaces.Discrete(3, start=-1)),
    "toy/MultiDiscrete-v0": (
        spaces.Dict({"place": spaces.Box(-1, 1, (2,)), "room": spaces.Discrete(3)}),
        spaces.MultiDiscrete([3, 2]),
    ),
    "toy/MultiBinary-v0": (
        spaces.Tuple((spaces.Discrete(2), spaces.Box(0, 1, (1,)))),
        spaces.MultiBinary(3),
    ),
    "toy/Matrix-v0": (spaces.Box(-1, 1, (3,)), spaces.Box(-2, 2, (2, 2))),
    "toy/Precise-v0": (
        spaces.Box(-1, 1, (3,), np.float64),
        spaces.Box(-0.1, 0.1, (2,), np.float64),
    ),
    "toy/Whole-v0": (spaces.Box(-1, 1, (3,)), spaces.Box(-1, 2, (2,), np.int32)),
    "toy/Open-v0": (
        spaces.Box(-1, 1, (3,)),
        spaces.Box(
            np.array([-np.inf, 1, -np.inf], np.float32), np.array([np.inf, np.inf, 2], np.float32)
        ),
    ),
}
for name, (observations, actions) in TOYS.items():
    gymnasium.register(
        name,
        entry_point=Toy,
        kwargs={"observations": observations, "actions": actions, "steps": 40},
    )
gymnasium.register(
    "toy/Endless-v0",
    entry_point=Toy,
    kwargs={"observations": spaces.Box(-1, 1, (1,)), "actions": spaces.Discrete(2), "steps": 10**9},
)
