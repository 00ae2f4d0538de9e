"""Playing one episode before the camera, with or without a screen."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.environments.description import (
    describe_environment,
    make_environment,
    steps_a_second,
)
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, WorkError, require_whole
from sarl_core.rendering.film import Film
from sarl_core.rollouts.episodes import Episodes, run_seeds
from sarl_core.rollouts.player import View

if TYPE_CHECKING:
    from sarl_core.shielding.shield import Shield

MAX_STEPS = 5_000  # of one picture; where an environment sets itself no limit

_DEFAULT_FPS = 30.0  # where an environment does not say


def picture_speed(env_id: EnvironmentOrId, max_steps: int | None = None) -> tuple[float, int]:
    """Refuse an environment without pictures; of one with, say how fast and how long it runs.

    Args:
        env_id: What ``gymnasium.make`` takes.
        max_steps: An episode that has not ended by then is cut off; `MAX_STEPS` where None.

    Returns:
        Pictures a second, and the most steps of an episode.

    Raises:
        InputError: If it draws no pictures, or there are to be no steps.
    """
    most = MAX_STEPS if max_steps is None else max_steps
    require_whole("max_steps", most, 1)
    describe_environment(env_id)
    env = make_environment(env_id)
    modes, fps = env.metadata.get("render_modes", []), steps_a_second(env)
    limit = getattr(env.spec, "max_episode_steps", None) or most
    env.close()
    if "rgb_array" not in modes:
        raise InputError(
            f"{env_id} draws no pictures (it has no render mode rgb_array); "
            "choose another environment"
        )
    return fps or _DEFAULT_FPS, min(limit, most)


def film_episode(
    env_id: EnvironmentOrId,
    agent: Agent,
    shield: Shield | None,
    seed: int,
    film: Film,
    limit: int,
    progress: Callable[[int, int], None],
) -> Episodes:
    """Play one episode, and film it.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: Chooses the actions.
        shield: Checks them, or None.
        seed: Of the episode.
        film: Gets a picture before each step, and one of the last state.
        limit: An episode that has not ended by then is cut off.
        progress: Called with (steps done, most steps); may raise to stop.

    Returns:
        The one episode, with its steps.

    Raises:
        InputError: If the pictures are of another kind, or the shield does not fit.
        WorkError: If drawing fails.
    """

    def observer(view: View) -> None:
        film.add(picture_of(view.env, str(env_id)))
        if view.step:
            progress(view.step, limit)

    with no_display():
        episodes = run_seeds(
            env_id,
            agent,
            shield,
            np.array([seed]),
            max_steps=limit,
            observer=observer,
            render_mode="rgb_array",
        )
    progress(limit, limit)
    return episodes


def picture_of(env: Any, env_id: str) -> NDArray[np.uint8]:
    """Draw the state that an environment is in.

    Args:
        env: Made with the render mode rgb_array.
        env_id: Its name.

    Returns:
        Shape (height, width, 3).

    Raises:
        InputError: If the pictures are of another kind.
        WorkError: If drawing fails.
    """
    import gymnasium

    try:
        picture = np.asarray(env.render())
    except gymnasium.error.Error as error:
        raise WorkError(f"{env_id} cannot be drawn ({error}); install what it asks for") from error
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8:
        raise InputError(
            f"{env_id} draws no pictures of three colours (it gives {picture.dtype} "
            f"{picture.shape}); choose another environment"
        )
    return picture


@contextmanager
def no_display() -> Iterator[None]:
    """Let pygame draw where there is no screen and no sound; leaves the environment as it was."""
    wanted = {"PYGAME_HIDE_SUPPORT_PROMPT": "1", "SDL_AUDIODRIVER": "dummy"}
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        wanted["SDL_VIDEODRIVER"] = "offscreen"  # with "dummy", highway-env draws nothing
    added = {name: value for name, value in wanted.items() if name not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)
