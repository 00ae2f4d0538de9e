"""An episode as a moving picture: rendered once, looked at step by step, saved as GIF or MP4."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.environments import describe_environment, make_environment
from sarl_core.errors import InputError, WorkError
from sarl_core.rollouts.agents import Agent, make_agent
from sarl_core.rollouts.canvas import OVERLAY_COLOURS
from sarl_core.rollouts.encoding import encode_gif, encode_mp4, gif_bytes
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.files import whole_file
from sarl_core.rollouts.film import Film, Palette
from sarl_core.rollouts.overlay import Panel, side_by_side_picture
from sarl_core.rollouts.progress import Progress, report
from sarl_core.rollouts.spaces import SpaceAdapter, adapt
from sarl_core.rollouts.steps import StepTable

if TYPE_CHECKING:
    from sarl_core.mining.rules import RuleSet
    from sarl_core.shielding.shield import Shield

__all__ = ["Replay", "encode_gif", "encode_mp4", "render_episode", "side_by_side"]

MAX_STEPS = 5_000  # of one picture; where an environment sets itself no limit

_DEFAULT_FPS = 30.0  # where an environment does not say

DescribeRule = Callable[[int], str]


@dataclass(frozen=True, eq=False)
class Replay:
    """One episode, or two side by side, ready to be looked at or saved.

    Attributes:
        episodes: One `Episodes` of a single episode, with its steps, for each panel.
        panels: What is drawn, in the order of `episodes`.
        fps: Pictures a second, real time.
    """

    episodes: tuple[Episodes, ...]
    panels: tuple[Panel, ...]
    fps: float

    def __len__(self) -> int:
        """Number of pictures: one before each step, and the last state."""
        return 1 + max(len(panel.steps) for panel in self.panels)

    @property
    def seconds(self) -> float:
        """How long it runs."""
        return len(self) / self.fps

    def frame(self, number: int) -> NDArray[np.uint8]:
        """The picture in which step `number` is decided; its text is about exactly that step.

        Args:
            number: 0 to the number of steps; there, the last state.

        Returns:
            Shape (height, width, 3).
        """
        return self._coloured(side_by_side_picture(self.panels, number, held=False))

    def animation(self) -> Iterator[NDArray[np.uint8]]:
        """The pictures as they are saved: each text stays for a moment, to be read."""
        for number in range(len(self)):
            yield self._coloured(side_by_side_picture(self.panels, number, held=True))

    @cached_property
    def _colours(self) -> NDArray[np.uint8]:
        return self.panels[0].film.palette.colours

    def _coloured(self, indexes: NDArray[np.uint8]) -> NDArray[np.uint8]:
        return np.asarray(self._colours[indexes])

    def gif(self, *, progress: Progress | None = None) -> bytes:
        """Encode as a GIF; done once, however often it is asked for.

        Args:
            progress: Called with (pictures done, in all); returning False stops.

        Returns:
            The file's content.
        """
        if "_gif" not in self.__dict__:
            self.__dict__["_gif"] = gif_bytes(
                len(self), lambda number: side_by_side_picture(self.panels, number, held=True),
                self._colours, self.fps, progress=progress,
            )
        content: bytes = self.__dict__["_gif"]
        return content

    def save(self, path: str | Path, *, progress: Progress | None = None) -> None:
        """Write `.gif` or `.mp4`, by the name's ending.

        Args:
            path: The file; it appears whole or not at all.
            progress: Called with (pictures done, in all); returning False stops.

        Raises:
            InputError: If the ending is another, or the folder does not exist.
            WorkError: If it cannot be written.
        """
        target = Path(path)
        check_picture_path(target)
        if target.suffix.lower() == ".mp4":
            encode_mp4(self.animation(), self.fps, target, count=len(self), progress=progress)
            return
        with whole_file(target) as unfinished:
            unfinished.write_bytes(self.gif(progress=progress))


def check_picture_path(path: Path) -> None:
    """Refuse a file name that no picture can be saved under, before long work begins.

    Args:
        path: The file to write.

    Raises:
        InputError: If it ends neither in .gif nor .mp4, or its folder does not exist.
    """
    if path.suffix.lower() not in (".gif", ".mp4"):
        raise InputError(f"{path} is neither a .gif nor a .mp4; give it one of these endings")
    if not path.parent.is_dir():
        raise InputError(f"the folder {path.parent} does not exist; make it or choose another")


def render_episode(
    env_id: str,
    agent: str | Path | Agent,
    *,
    shield: Shield | None = None,
    seed: int = 0,
    stochastic: bool = False,
    describe_rule: DescribeRule | None = None,
    progress: Progress | None = None,
) -> Replay:
    """Render one episode, the same as `rollout` plays it with that seed.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: An agent, or what `make_agent` takes.
        shield: Checks every action; None for none.
        seed: Of the episode.
        stochastic: Whether a trained policy is sampled.
        describe_rule: A sentence for the index of a rule; its conditions where not given.
        progress: Called with (steps done, most steps); returning False stops.

    Returns:
        The replay.

    Raises:
        InputError: If something does not fit, or the environment draws no pictures.
        WorkError: If drawing fails.
        CancelledError: If `progress` returned False.
    """
    return _replay(env_id, agent, (shield,), seed, stochastic, describe_rule, progress)


def side_by_side(
    env_id: str,
    agent: str | Path | Agent,
    shield: Shield,
    *,
    seed: int = 0,
    stochastic: bool = False,
    describe_rule: DescribeRule | None = None,
    progress: Progress | None = None,
) -> Replay:
    """Render an agent with the shield (left) and without (right), on one seed.

    The shorter episode stays on its last state and says how it ended.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: An agent, or what `make_agent` takes.
        shield: Of the left panel.
        seed: Of both episodes.
        stochastic: Whether a trained policy is sampled.
        describe_rule: A sentence for the index of a rule; its conditions where not given.
        progress: Called with (steps done, most steps); returning False stops.

    Returns:
        The replay; `episodes` holds the shielded one first.

    Raises:
        InputError: If something does not fit, or the environment draws no pictures.
        WorkError: If drawing fails.
        CancelledError: If `progress` returned False.
    """
    return _replay(env_id, agent, (shield, None), seed, stochastic, describe_rule, progress)


def _replay(
    env_id: str, agent: str | Path | Agent, shields: tuple[Shield | None, ...], seed: int,
    stochastic: bool, describe_rule: DescribeRule | None, progress: Progress | None,
) -> Replay:
    if seed < 0:
        raise InputError(f"seed is {seed} and must be at least 0; give a larger one")
    actor = make_agent(agent, env_id, stochastic=stochastic, seed=seed)
    fps, limit = _check_draws(env_id)
    palette = Palette(OVERLAY_COLOURS)
    episodes: list[Episodes] = []
    panels: list[Panel] = []
    for part, shield in enumerate(shields):
        def told(done: int, total: int, part: int = part) -> None:
            report(progress, done + part * total, total * len(shields))

        film = Film(palette)
        episode = _film_episode(env_id, actor, shield, seed, film, limit, told)
        assert episode.steps is not None
        episodes.append(episode)
        describe = describe_rule
        if describe is None and shield is not None:
            describe = plain_descriptions(shield.rule_set)
        ending = "" if len(shields) == 1 and shield is None else (
            ", shielded" if shield is not None else ", unshielded")
        panels.append(Panel(
            title=f"{actor.name}{ending}",
            subtitle=f"{env_id.rsplit(':', 1)[-1]} · seed {seed}",
            film=film, steps=episode.steps, shielded=shield is not None,
            describe_rule=describe or str, description=describe_environment(env_id), fps=fps,
        ))
    return Replay(tuple(episodes), tuple(panels), fps)


def plain_descriptions(rule_set: RuleSet) -> DescribeRule:
    """Sentences for rules, from names and bounds alone.

    Args:
        rule_set: The rules.

    Returns:
        A function from the index of a rule to "If angle ≤ 0.1: fire main engine".
    """
    def describe(index: int) -> str:
        rule = rule_set.rules[index]
        parts = []
        for feature, low, high in rule.bounds:
            name = rule_set.source.features[feature].name
            left = f"{_short(low)} < " if np.isfinite(low) and np.isfinite(high) else ""
            right = f" ≤ {_short(high)}" if np.isfinite(high) else f" > {_short(low)}"
            parts.append(f"{left}{name}{right}")
        action = rule_set.actions[rule.dimension]
        conclusion = action.label_names[rule.action]
        if len(rule_set.actions) > 1 or action.is_interval:
            conclusion = f"{action.name} {conclusion}"
        return f"If {' and '.join(parts)}: {conclusion}" if parts else f"Always: {conclusion}"

    return describe


def _short(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


def _check_draws(env_id: str) -> tuple[float, int]:
    """Refuse an environment without pictures; of one with, give the speed and most steps."""
    describe_environment(env_id)
    env = make_environment(env_id)
    modes, fps = env.metadata.get("render_modes", []), env.metadata.get("render_fps")
    limit = getattr(env.spec, "max_episode_steps", None) or MAX_STEPS
    env.close()
    if "rgb_array" not in modes:
        raise InputError(
            f"{env_id} draws no pictures (it has no render mode rgb_array); "
            "choose another environment"
        )
    return float(fps) if fps else _DEFAULT_FPS, min(limit, MAX_STEPS)


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


def _film_episode(
    env_id: str, agent: Agent, shield: Shield | None, seed: int, film: Film, limit: int,
    told: Callable[[int, int], None],
) -> Episodes:
    """Play one episode in the wrapped environment, and film it."""
    generator = np.random.default_rng(seed)
    rows: list[_Row] = []
    with _no_display(), _drawing(env_id, shield) as env:
        adapter = adapt(env)
        observation, _ = env.reset(seed=seed)
        terminated = truncated = False
        while not (terminated or truncated):
            film.add(_picture(env, env_id))
            row, observation, terminated, truncated = _film_step(
                env, adapter, agent, generator, observation, len(rows))
            rows.append(row)
            truncated = bool(truncated) or (len(rows) >= limit and not terminated)
            told(len(rows), limit)
        film.add(_picture(env, env_id))
        told(limit, limit)
    steps = _table(rows, adapter)
    return Episodes(
        env_id=env_id, agent=agent.name, seeds=np.array([seed]),
        returns=np.array([np.cumsum(steps.reward)[-1]]), lengths=np.array([len(rows)]),
        interventions=np.array([int(steps.intervened.sum())]),
        covered=np.array([int(steps.covered.sum())]),
        terminated=np.array([bool(terminated)]), truncated=np.array([bool(truncated)]),
        steps=steps,
    )


def _film_step(
    env: Any, adapter: SpaceAdapter, agent: Agent, generator: np.random.Generator,
    observation: Any, step: int,
) -> tuple[_Row, Any, bool, bool]:
    state = np.array(adapter.flat(observation))
    uniforms = generator.random((1, agent.n_uniforms)) if agent.n_uniforms else None
    proposed = agent.act(state[None], uniforms)
    following, reward, terminated, truncated, info = env.step(
        adapter.native(adapter.shaped(proposed)[0]))
    record = info.get("shield")
    if record is None:
        rules = [-1] * adapter.n_dimensions
        row = _Row(0, step, state, proposed[0], proposed[0], rules, False, np.inf, float(reward))
    else:
        rules = [-1 if rule is None else rule for rule in record.rules]
        row = _Row(0, step, state, record.proposed, record.executed, rules, record.intervened,
                   record.margin, float(reward))
    return row, following, bool(terminated), bool(truncated)


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
