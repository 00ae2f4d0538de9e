"""Playing one episode before the camera, with or without a screen."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent, order_notes
from sarl_core.agents.spaces import SpaceAdapter
from sarl_core.environments.description import describe_environment, make_environment
from sarl_core.errors import InputError, WorkError
from sarl_core.rendering.film import Film
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.flips import count_flips
from sarl_core.rollouts.player import added, check_environment
from sarl_core.rollouts.steps import StepTable

if TYPE_CHECKING:
    from sarl_core.shielding.shield import Shield

MAX_STEPS = 5_000  # of one picture; where an environment sets itself no limit

_DEFAULT_FPS = 30.0  # where an environment does not say


def picture_speed(env_id: str, max_steps: int | None = None) -> tuple[float, int]:
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
    if most < 1:
        raise InputError(f"max_steps is {most} and must be at least 1; give a larger one")
    describe_environment(env_id)
    env = make_environment(env_id)
    modes, fps = env.metadata.get("render_modes", []), env.metadata.get("render_fps")
    limit = getattr(env.spec, "max_episode_steps", None) or most
    env.close()
    if "rgb_array" not in modes:
        raise InputError(
            f"{env_id} draws no pictures (it has no render mode rgb_array); "
            "choose another environment"
        )
    return float(fps) if fps else _DEFAULT_FPS, min(limit, most)


class _Row(NamedTuple):
    """One step, with the columns of a `StepTable`."""

    episode: int
    step: int
    observation: NDArray[np.float32]
    proposed: Any
    executed: Any
    rules: list[int]
    intervened: bool
    margin: float
    reward: float
    outside: bool
    invalid: str | None


def film_episode(
    env_id: str,
    agent: Agent,
    shield: Shield | None,
    seed: int,
    film: Film,
    limit: int,
    told: Callable[[int, int], None],
) -> Episodes:
    """Play one episode in the wrapped environment, and film it.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: Chooses the actions.
        shield: Checks them, or None.
        seed: Of the episode.
        film: Gets a picture before each step, and one of the last state.
        limit: An episode that has not ended by then is cut off.
        told: Called with (steps done, most steps); may raise to stop.

    Returns:
        The one episode, with its steps.

    Raises:
        InputError: If the pictures are of another kind, or the shield does not fit.
        WorkError: If drawing fails.
    """
    adapter, shield, notes = check_environment(env_id, shield)
    notes = (*notes, *order_notes(agent, env_id))
    generator = np.random.default_rng(seed)
    rows: list[_Row] = []
    with _no_display(), _drawing(env_id, shield) as env:
        observation, _ = env.reset(seed=seed)
        terminated = truncated = False
        cost = float("nan")
        while not (terminated or truncated):
            film.add(_picture(env, env_id))
            row, observation, terminated, truncated, info = _film_step(
                env, adapter, agent, generator, observation, len(rows)
            )
            rows.append(row)
            if "cost" in info:
                cost = added(cost, info["cost"])
            told(len(rows), limit)
            if len(rows) >= limit:
                break
        film.add(_picture(env, env_id))
        told(limit, limit)
    steps = _table(rows, adapter)
    return Episodes(
        env_id=env_id,
        agent=agent.name,
        seeds=np.array([seed]),
        returns=np.array([np.cumsum(steps.reward)[-1]]),
        lengths=np.array([len(rows)]),
        interventions=np.array([int(steps.intervened.sum())]),
        covered=np.array([int(steps.covered.sum())]),
        terminated=np.array([bool(terminated)]),
        truncated=np.array([not terminated]),
        cut=np.array([not (terminated or truncated)]),
        last_rewards=steps.reward[-1:].copy(),
        steps=steps,
        outside=np.array([int(steps.outside.sum())]),
        withheld=np.array([int((steps.outside & ~steps.intervened).sum())]),
        flips=count_flips(steps.intervened, steps.episode),
        freedom=np.array([1.0 if shield is None else _freedom(shield, steps)]),
        costs=np.array([cost]),
        notes=notes,
        invalid=np.array([int(steps.is_invalid.sum())])
        if shield is not None and shield.on_invalid == "pass"
        else None,
    )


def _freedom(shield: Shield, steps: StepTable) -> float:
    return float(shield.freedom(steps.observation, steps.rules).mean())


def _film_step(
    env: Any,
    adapter: SpaceAdapter,
    agent: Agent,
    generator: np.random.Generator,
    observation: Any,
    step: int,
) -> tuple[_Row, Any, bool, bool, dict[str, Any]]:
    state = np.array(adapter.flat(observation))
    uniforms = generator.random((1, agent.n_uniforms)) if agent.n_uniforms else None
    proposed = agent.act(state[None], uniforms)
    following, reward, terminated, truncated, info = env.step(
        adapter.native(adapter.shaped(proposed)[0])
    )
    record = info.get("shield")
    if record is None:
        rules = [-1] * adapter.n_dimensions
        action = proposed[0]
        row = _Row(0, step, state, action, action, rules, False, np.inf, float(reward), False, None)
    else:
        rules = [-1 if rule is None else rule for rule in record.rules]
        row = _Row(
            0,
            step,
            state,
            record.proposed,
            record.executed,
            rules,
            record.intervened,
            record.margin,
            float(reward),
            record.outside,
            record.invalid,
        )
    return row, following, bool(terminated), bool(truncated), info


def _table(rows: list[_Row], adapter: SpaceAdapter) -> StepTable:
    columns = _Row(*(list(column) for column in zip(*rows, strict=True)))  # type: ignore[arg-type]
    kind = np.int64 if adapter.is_discrete else np.float32

    def actions(values: Any) -> Any:
        return np.array([np.asarray(value).reshape(-1) for value in values], dtype=kind)

    return StepTable(
        episode=np.array(columns.episode, dtype=np.int64),
        step=np.array(columns.step, dtype=np.int64),
        observation=np.array(columns.observation, dtype=np.float32),
        proposed=actions(columns.proposed),
        executed=actions(columns.executed),
        rules=np.array(columns.rules, dtype=np.int64),
        intervened=np.array(columns.intervened, dtype=np.bool_),
        margin=np.array(columns.margin, dtype=np.float64),
        reward=np.array(columns.reward, dtype=np.float64),
        outside=np.array(columns.outside, dtype=np.bool_),
        invalid=np.array(columns.invalid, dtype=np.object_),
    )


@contextmanager
def _drawing(env_id: str, shield: Shield | None) -> Iterator[Any]:
    """The environment, shielded where there is a shield, closed at the end."""
    env = make_environment(env_id, render_mode="rgb_array")
    try:
        if shield is not None:
            from sarl_core.shielding.wrappers import ShieldedEnv

            env = ShieldedEnv(env, shield)
        yield env
    finally:
        env.close()


def _picture(env: Any, env_id: str) -> NDArray[np.uint8]:
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
def _no_display() -> Iterator[None]:
    """Let pygame draw where there is no screen and no sound; leaves the environment as it was."""
    wanted = {"PYGAME_HIDE_SUPPORT_PROMPT": "1", "SDL_AUDIODRIVER": "dummy"}
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        wanted["SDL_VIDEODRIVER"] = "dummy"
    added = {name: value for name, value in wanted.items() if name not in os.environ}
    os.environ.update(added)
    try:
        yield
    finally:
        for name in added:
            os.environ.pop(name, None)
