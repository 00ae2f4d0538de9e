"""An episode as a moving picture: rendered once, looked at step by step, saved as GIF or MP4."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError
from sarl_core.files import as_path, whole_file
from sarl_core.mining.environment_actions import environment_dimensions
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import sentence
from sarl_core.progress import Progress, report
from sarl_core.rendering.camera import film_episode, picture_speed
from sarl_core.rendering.canvas import OVERLAY_COLOURS
from sarl_core.rendering.film import Film, Palette
from sarl_core.rendering.gif_and_mp4 import encode_gif, encode_mp4, gif_bytes
from sarl_core.rendering.overlay import GAP, Panel, side_by_side_picture
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.player import shield_for
from sarl_core.rollouts.trial import make_agent

if TYPE_CHECKING:
    from sarl_core.mining.rule_set import RuleSet
    from sarl_core.shielding.shield import Shield

__all__ = ["Replay", "encode_gif", "encode_mp4", "render_episode", "side_by_side"]

DescribeRule = Callable[[int], str]


@dataclass(frozen=True, eq=False)
class Replay:
    """One episode, or two side by side, ready to be looked at or saved.

    Attributes:
        episodes: One `Episodes` of a single episode, with its steps, for each panel.
        panels: What is drawn, in the order of `episodes`.
        fps: Pictures a second, real time.
        first: The picture that a film of it begins with.
    """

    episodes: tuple[Episodes, ...]
    panels: tuple[Panel, ...]
    fps: float
    first: int = 0

    def named(self, dimensions: tuple[LabelledDimension, ...]) -> Replay:
        """The same pictures under other names of the actions.

        Args:
            dimensions: Of the same environment.
        """
        panels = tuple(replace(panel, dimensions=dimensions) for panel in self.panels)
        return replace(self, panels=panels)

    def __len__(self) -> int:
        """Number of pictures: one before each step, and the last state."""
        return 1 + max(len(panel.steps) for panel in self.panels)

    @property
    def pictures(self) -> int:
        """Number of those in a film of it."""
        return len(self) - self.first

    @property
    def seconds(self) -> float:
        """How long a film of it runs."""
        return self.pictures / self.fps

    @property
    def places(self) -> tuple[tuple[int, int], ...]:
        """Left edge and width of each panel, in pixels."""
        widths = [panel.size[1] for panel in self.panels]
        lefts = [sum(widths[:at]) + at * GAP for at in range(len(widths))]
        return tuple(zip(lefts, widths, strict=True))

    def frame(self, number: int) -> NDArray[np.uint8]:
        """The picture in which step `number` is decided; its text is about exactly that step.

        Args:
            number: 0 to the number of steps; there, the last state.

        Returns:
            Shape (height, width, 3).
        """
        return self._coloured(side_by_side_picture(self.panels, number))

    def png(self, number: int) -> bytes:
        """The same picture as a PNG file; small and fast, since its colours are few and known.

        Args:
            number: As for `frame`.

        Returns:
            The file's content.
        """
        from PIL import Image

        image = Image.fromarray(side_by_side_picture(self.panels, number))
        image.putpalette(self._colours.tobytes())
        file = BytesIO()
        image.save(file, format="PNG", compress_level=1)
        return file.getvalue()

    def animation(self) -> Iterator[NDArray[np.uint8]]:
        """All pictures of a film, in order, as they are saved."""
        for number in range(self.first, len(self)):
            yield self.frame(number)

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
                self.pictures,
                lambda number: side_by_side_picture(self.panels, self.first + number),
                self._colours,
                self.fps,
                progress=progress,
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
        target = as_path(path)
        check_picture_path(target)
        if target.suffix.lower() == ".mp4":
            encode_mp4(self.animation(), self.fps, target, count=self.pictures, progress=progress)
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
    env_id: EnvironmentOrId,
    agent: str | Path | Agent,
    *,
    shield: Shield | None = None,
    seed: int = 0,
    stochastic: bool = False,
    describe_rule: DescribeRule | None = None,
    max_steps: int | None = None,
    progress: Progress | None = None,
) -> Replay:
    """Render one episode, the same as `rollout` plays it with that seed.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: An agent, or what `make_agent` takes.
        shield: Checks every action; None for none.
        seed: Of the episode.
        stochastic: Whether a trained policy is sampled.
        describe_rule: A sentence for the index of a rule; that of `language` where not given.
        max_steps: An episode that has not ended by then is cut off; 5,000 where not given.
        progress: Called with (steps done, most steps); returning False stops.

    Returns:
        The replay.

    Raises:
        InputError: If something does not fit, or the environment draws no pictures.
        WorkError: If drawing fails.
        CancelledError: If `progress` returned False.
    """
    return _replay(env_id, agent, (shield,), seed, stochastic, describe_rule, max_steps, progress)


def side_by_side(
    env_id: EnvironmentOrId,
    agent: str | Path | Agent,
    shield: Shield,
    *,
    seed: int = 0,
    stochastic: bool = False,
    describe_rule: DescribeRule | None = None,
    max_steps: int | None = None,
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
        describe_rule: A sentence for the index of a rule; that of `language` where not given.
        max_steps: An episode that has not ended by then is cut off; 5,000 where not given.
        progress: Called with (steps done, most steps); returning False stops.

    Returns:
        The replay; `episodes` holds the shielded one first.

    Raises:
        InputError: If something does not fit, or the environment draws no pictures.
        WorkError: If drawing fails.
        CancelledError: If `progress` returned False.
    """
    return _replay(
        env_id, agent, (shield, None), seed, stochastic, describe_rule, max_steps, progress
    )


def _replay(
    env_id: EnvironmentOrId,
    agent: str | Path | Agent,
    shields: tuple[Shield | None, ...],
    seed: int,
    stochastic: bool,
    describe_rule: DescribeRule | None,
    max_steps: int | None,
    progress: Progress | None,
) -> Replay:
    actor = make_agent(agent, env_id, stochastic=stochastic, seed=seed)
    fps, limit = picture_speed(env_id, max_steps)
    # Whose words are used for the panel without rules, too.
    rule_set = None if shields[0] is None else shield_for(env_id, shields[0]).rule_set
    dimensions = environment_dimensions(describe_environment(env_id), rule_set)
    palette = Palette(OVERLAY_COLOURS)
    episodes: list[Episodes] = []
    panels: list[Panel] = []
    for part, shield in enumerate(shields):

        def advance(done: int, total: int, part: int = part) -> None:
            report(progress, done + part * total, total * len(shields))

        film = Film(palette)
        episode = film_episode(env_id, actor, shield, seed, film, limit, advance)
        assert episode.steps is not None
        episodes.append(episode)
        ending = (
            ""
            if len(shields) == 1 and shield is None
            else (", shielded" if shield is not None else ", unshielded")
        )
        panels.append(
            Panel(
                title=f"{actor.name}{ending}",
                subtitle=f"{str(env_id).rsplit(':', 1)[-1]} · seed {seed}",
                film=film,
                steps=episode.steps,
                shielded=shield is not None,
                describe_rule=describe_rule or sentences(rule_set),
                dimensions=dimensions,
                fps=fps,
            )
        )
    return Replay(tuple(episodes), tuple(panels), fps)


def sentences(rule_set: RuleSet | None) -> DescribeRule:
    """The sentences of rules, as they stand everywhere.

    Args:
        rule_set: The rules; None where there are none to speak of.

    Returns:
        A function from the index of a rule to its sentence.
    """

    def describe(index: int) -> str:
        assert rule_set is not None
        return sentence(rule_set.rules[index], rule_set, evidence=False)

    return describe
