"""Between an environment's own observations and actions and the arrays that agents work on.

Agents see float32 rows and give one column an action dimension; environments take an int, a
vector, a matrix. This is the only place that knows both.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

Actions = NDArray[np.int64] | NDArray[np.float32]


@dataclass(frozen=True)
class SpaceAdapter:
    """The spaces of one environment.

    Attributes:
        observation_space: A Gymnasium space of fixed length.
        action_space: Discrete, MultiDiscrete, MultiBinary or Box.
        n_features: Length d of a flat observation.
        n_dimensions: Number m of action dimensions.
        action_shape: Shape of one action; () for a single discrete one.
        is_discrete: Whether actions are labels.
        is_vector: Whether observations are vectors already.
    """

    observation_space: Any
    action_space: Any
    n_features: int
    n_dimensions: int
    action_shape: tuple[int, ...]
    is_discrete: bool
    is_vector: bool

    @property
    def is_whole(self) -> bool:
        """Whether actions are amounts in whole numbers, of which `native` cuts the rest off."""
        return not self.is_discrete and np.issubdtype(self.action_space.dtype, np.integer)

    def misfit(self, observation: Any) -> str:
        """How many numbers an observation has, where it is of another space.

        Args:
            observation: As the environment gives it.

        Returns:
            As "8 numbers and not 4"; "" where the number is right, or what came is none at all,
            as of a sensor that fails.
        """
        from sarl_core.shielding.readers import state_vector

        vector = state_vector(observation, None if self.is_vector else self.observation_space)
        if isinstance(vector, np.ndarray) and vector.dtype.kind in "biuf":
            size = vector.size
            return "" if size == self.n_features else f"{size} numbers and not {self.n_features}"
        if isinstance(vector, (dict, tuple)):
            return f"parts that are not those of {type(self.observation_space).__name__}"
        return ""

    def flat(self, observation: Any) -> NDArray[np.float32]:
        """Make one observation a vector.

        Args:
            observation: As the environment gives it.

        Returns:
            Shape (d,), float32; all NaN where it is no observation of the space.
        """
        from sarl_core.shielding.readers import state_vector

        vector = state_vector(observation, None if self.is_vector else self.observation_space)
        whole = type(vector) is np.ndarray and vector.shape == (self.n_features,)
        if whole and vector.dtype == np.float32:
            return cast("NDArray[np.float32]", vector)  # the text costs nothing at each step
        return np.full(self.n_features, np.nan, dtype=np.float32)

    def shaped(self, columns: Actions) -> Actions:
        """Give actions the environment's form, as the shield takes them.

        Args:
            columns: Shape (B, m).

        Returns:
            (B,) for a single discrete action, else (B, *action_shape).
        """
        return columns.reshape(len(columns), *self.action_shape)

    def columns(self, actions: Actions) -> Actions:
        """Undo `shaped`.

        Args:
            actions: Shape (B,) or (B, *action_shape).

        Returns:
            Shape (B, m).
        """
        return actions.reshape(len(actions), -1)

    def native(self, action: Any) -> Any:
        """Make one action what ``env.step`` takes.

        Args:
            action: A scalar, or an array of the action's shape.

        Returns:
            An int, or a fresh array of the space's dtype, so that an environment that changes
            it in place changes no record.
        """
        if self.action_shape == () and self.is_discrete:
            return int(action)
        space = self.action_space
        result = np.array(action, dtype=space.dtype)
        if result.dtype == np.float64:
            # A float32 bound made float64 may lie a hair outside.
            np.clip(result, space.low, space.high, out=result)
        return result


def adapt(env: Any) -> SpaceAdapter:
    """Read the spaces of an environment that `describe_environment` accepted.

    Args:
        env: A ``gymnasium.Env``.

    Returns:
        Its adapter.
    """
    from gymnasium.spaces import Box, utils

    observations, actions = env.observation_space, env.action_space
    shape = tuple(int(size) for size in actions.shape or ())
    return SpaceAdapter(
        observation_space=observations,
        action_space=actions,
        n_features=int(utils.flatdim(observations)),
        n_dimensions=int(np.prod(shape)),
        action_shape=shape,
        is_discrete=not isinstance(actions, Box),
        is_vector=isinstance(observations, Box) and len(observations.shape) == 1,
    )


def label_counts(space: Any) -> tuple[int, ...]:
    """Number of labels of each discrete action dimension.

    Args:
        space: An action space.

    Returns:
        One number a dimension; () for continuous actions.
    """
    from gymnasium import spaces

    if isinstance(space, spaces.Discrete):
        return (int(space.n),)
    if isinstance(space, spaces.MultiDiscrete):
        return tuple(int(n) for n in space.nvec.reshape(-1))
    if isinstance(space, spaces.MultiBinary):
        return (2,) * int(np.prod(space.shape))
    return ()
