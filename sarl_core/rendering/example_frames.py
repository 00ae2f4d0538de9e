"""Pictures of states in which rules apply, from episodes that anybody can play again.

The episodes are run without pictures first. Which frames to draw is chosen when all of them are
known, and only the episodes that have one are played again, before the camera.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, SarlError
from sarl_core.mining.rule_set import RuleSet
from sarl_core.progress import CancelledError, Progress, report
from sarl_core.rendering.camera import no_display, picture_of, picture_speed
from sarl_core.rendering.film import Palette
from sarl_core.rendering.repeating import Repeating
from sarl_core.rollouts.episodes import rollout, run_seeds
from sarl_core.rollouts.player import View, check_environment
from sarl_core.rollouts.seeds import FRESH
from sarl_core.rollouts.steps import StepTable
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield

FIRST_SEED = FRESH
EPISODES = 12
_LEAST_HEIGHT = 0.4  # of the width, below which nothing more is cut off


@dataclass(frozen=True, eq=False)
class Player:
    """Who plays the episodes.

    Attributes:
        name: In words, as "the expert".
        agent: What `make_agent` takes.
        shielded: Whether the rules are in force.
        stochastic: Whether a trained policy is sampled.
    """

    name: str
    agent: str | Path | Agent
    shielded: bool
    stochastic: bool = False


@dataclass(frozen=True, eq=False)
class ExampleFrame:
    """One step at which a rule applied.

    Attributes:
        player: Who played, as "the expert".
        seed: Of the episode.
        step: Index within the episode, from 0.
        observation: The state, (d,).
        executed: The action the environment got, (m,).
        picture: A PNG file of the state in which the step was decided.
    """

    player: str
    seed: int
    step: int
    observation: NDArray[np.float32]
    executed: NDArray[np.int64] | NDArray[np.float32]
    picture: bytes


@dataclass(frozen=True, eq=False)
class PlayedEpisodes:
    """The steps of one player's episodes.

    Attributes:
        player: Who.
        seeds: Of the episodes, (E,).
        steps: All their steps; `rules` holds the rule in force whether or not it was enforced.
        remarks: What a person should know of how they came about, as clauses.
    """

    player: Player
    seeds: NDArray[np.int64]
    steps: StepTable
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Examples:
    """What rules look like in their environment.

    Attributes:
        env_id: Environment.
        frames: By the index of a rule in its set, in the order of the episodes; rules that were
            not asked for, or applied at no step that was played, are missing.
        played: What was played, in the order it was.
        size: Width and height of the pictures.
        notes: What is to be said of how rules and environment were matched, as clauses.
    """

    env_id: str
    frames: dict[int, tuple[ExampleFrame, ...]]
    played: tuple[PlayedEpisodes, ...]
    size: tuple[int, int]
    notes: tuple[str, ...] = ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know of how rules were matched and episodes came about."""
        played = [remark for one in self.played for remark in one.remarks]
        return tuple(dict.fromkeys((*self.notes, *played)))


class _FramePlace(NamedTuple):
    """A step of what was played."""

    played: int
    episode: int
    step: int


def example_frames(
    env_id: EnvironmentOrId,
    rule_set: RuleSet,
    rules: Sequence[int],
    players: Sequence[Player],
    *,
    each: int = 3,
    episodes: int = EPISODES,
    seed: int = FIRST_SEED,
    max_steps: int | None = None,
    width: int = 400,
    progress: Progress | None = None,
) -> Examples:
    """Draw some states in which rules apply.

    Args:
        env_id: What ``gymnasium.make`` takes.
        rule_set: The rules.
        rules: Indices of those to show.
        players: Who plays; the next one only as long as some rule has too few frames.
        each: Frames a rule at most, spread over episodes.
        episodes: So many of each player.
        seed: Of a player's first episode.
        max_steps: After which an episode is cut off; `episodes.MAX_STEPS` where None.
        width: Of the pictures, in pixels.
        progress: Called with (units done, in all); returning False stops.

    Returns:
        The frames; the same arguments give the same ones, byte for byte.

    Raises:
        InputError: If something does not fit, or the environment draws no pictures.
        WorkError: If drawing fails.
        CancelledError: If `progress` returned False.
    """
    for name, value in (("episodes", episodes), ("frames a rule", each)):
        if value < 1:
            raise InputError(f"the number of {name} is {value}; give 1 or more")
    picture_speed(env_id)  # refuses an environment without pictures before anything is played
    _, shield, notes = check_environment(env_id, Shield(rule_set))
    assert shield is not None
    rule_set = shield.rule_set
    # Half the way is playing, half is drawing.
    total = 2 * episodes * len(players)
    played: list[PlayedEpisodes] = []
    places: dict[int, list[_FramePlace]] = {rule: [] for rule in rules}
    for number, player in enumerate(players):
        if played and all(len(chosen) >= each for chosen in places.values()):
            break

        def advance(done: int, _: int, before: int = number * episodes) -> None:
            report(progress, before + done, total)

        played.append(_play(env_id, shield, player, episodes, seed, max_steps, advance))
        for rule, chosen in places.items():
            if len(chosen) < each:
                chosen += _spread(played[-1].steps, rule, rule_set, number, each - len(chosen))
    report(progress, total // 2, total)
    wanted = sorted({place for chosen in places.values() for place in chosen})
    pictures = _trimmed(_pictures(env_id, played, wanted, width, progress))
    files = _files(pictures)
    frames = {
        rule: tuple(
            _frame(played[place.played], place, files[place]) for place in chosen if place in files
        )
        for rule, chosen in places.items()
    }
    report(progress, total, total)
    size = next(iter(pictures.values())).shape[1::-1] if pictures else (width, 0)
    return Examples(
        env_id=str(env_id),
        frames={rule: drawn for rule, drawn in frames.items() if drawn},
        played=tuple(played),
        size=(int(size[0]), int(size[1])),
        notes=notes,
    )


def _play(
    env_id: EnvironmentOrId,
    shield: Shield,
    player: Player,
    episodes: int,
    seed: int,
    max_steps: int | None,
    progress: Progress,
) -> PlayedEpisodes:
    episodes_played = rollout(
        env_id,
        make_agent(player.agent, env_id, stochastic=player.stochastic, seed=seed),
        shield=shield if player.shielded else None,
        episodes=episodes,
        seed=seed,
        max_steps=max_steps,
        progress=progress,
    )
    steps = episodes_played.steps
    assert steps is not None
    if not player.shielded:
        rules = shield.rules_in_force(steps.observation)
        columns = {name: getattr(steps, name) for name in StepTable.__dataclass_fields__}
        steps = StepTable(**(columns | {"rules": rules}))
    return PlayedEpisodes(player, episodes_played.seeds, steps, episodes_played.remarks)


def _spread(
    steps: StepTable, rule: int, rule_set: RuleSet, played: int, count: int
) -> list[_FramePlace]:
    """Some steps at which a rule was in force, of as many episodes as possible."""
    rows = np.flatnonzero(steps.rules[:, rule_set.rules[rule].dimension] == rule)
    if not len(rows) or not count:
        return []
    _, first = np.unique(steps.episode[rows], return_index=True)
    groups = np.split(rows, first[1:])
    # Each turn takes one step of every chosen episode; within an episode, from its middle out.
    chosen = np.linspace(0, len(groups) - 1, min(count, len(groups))).round().astype(np.int64)
    picked: list[int] = []
    turns = -(-count // len(chosen))
    for turn in range(turns):
        for group in (groups[index] for index in chosen):
            if turn < len(group) and len(picked) < count:
                picked.append(int(group[(2 * turn + 1) * len(group) // (2 * turns)]))
    return [
        _FramePlace(played, int(steps.episode[row]), int(steps.step[row]))
        for row in sorted(set(picked))
    ]


def _pictures(
    env_id: EnvironmentOrId,
    played: Sequence[PlayedEpisodes],
    wanted: Sequence[_FramePlace],
    width: int,
    progress: Progress | None,
) -> dict[_FramePlace, NDArray[np.uint8]]:
    pictures: dict[_FramePlace, NDArray[np.uint8]] = {}
    reels = sorted({(place.played, place.episode) for place in wanted})
    with no_display():
        for done, (number, episode) in enumerate(reels):
            report(progress, len(reels) + done, 2 * len(reels))
            one = played[number]
            steps = {place.step for place in wanted if place[:2] == (number, episode)}
            drawn = _draw(
                env_id, int(one.seeds[episode]), one.steps.of_episode(episode), steps, width
            )
            pictures |= {
                _FramePlace(number, episode, step): picture for step, picture in drawn.items()
            }
    return pictures


class _AstrayError(Exception):
    """The environment went another way than it did."""


def _draw(
    env_id: EnvironmentOrId, seed: int, steps: StepTable, wanted: set[int], width: int
) -> dict[int, NDArray[np.uint8]]:
    """Play an episode again up to the last step that is wanted."""
    pictures = {}

    def observer(view: View) -> None:
        if view.step > max(wanted):
            return
        # Every state is drawn: flames and dust fade as they are drawn.
        picture = picture_of(view.env, str(env_id))
        if not np.array_equal(view.state, steps.observation[view.step]):
            raise _AstrayError  # a picture would show another state
        if view.step in wanted:
            pictures[view.step] = _smaller(picture, width)

    with suppress(_AstrayError):
        run_seeds(
            env_id,
            Repeating(steps.executed),
            None,
            np.array([seed]),
            max_steps=max(wanted) + 1,
            observer=observer,
            render_mode="rgb_array",
        )
    return pictures


def _smaller(picture: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    from PIL import Image

    height = max(1, round(picture.shape[0] * width / picture.shape[1]))
    if width >= picture.shape[1]:
        return np.array(picture)
    whole = Image.fromarray(picture).resize((width, height), Image.Resampling.LANCZOS)
    return np.asarray(whole)


def _trimmed(
    pictures: dict[_FramePlace, NDArray[np.uint8]],
) -> dict[_FramePlace, NDArray[np.uint8]]:
    """Without the rows at the top and at the bottom in which no picture ever shows anything."""
    if not pictures or len({picture.shape for picture in pictures.values()}) > 1:
        return pictures
    busy = np.zeros(len(next(iter(pictures.values()))), dtype=np.bool_)
    for picture in pictures.values():
        busy |= (picture != picture[:, :1]).any(axis=(1, 2))
        # Rows of one colour are told apart where the colour changes.
        busy[1:] |= (picture[1:, 0] != picture[:-1, 0]).any(axis=1)
    rows = np.flatnonzero(busy)
    if not len(rows):
        return pictures
    height, width = next(iter(pictures.values())).shape[:2]
    least = int(_LEAST_HEIGHT * width)
    margin = max(height // 20, (least - (int(rows[-1]) - int(rows[0]))) // 2)
    first, last = max(int(rows[0]) - margin, 0), min(int(rows[-1]) + 1 + margin, height)
    return {place: picture[first:last] for place, picture in pictures.items()}


def _files(pictures: dict[_FramePlace, NDArray[np.uint8]]) -> dict[_FramePlace, bytes]:
    """PNG files that share their colours."""
    from PIL import Image

    palette = Palette()
    indexes = {place: palette.indexes(pictures[place]) for place in sorted(pictures)}
    colours = palette.colours.tobytes()
    files = {}
    for place, picture in indexes.items():
        image = Image.fromarray(picture)
        image.putpalette(colours)
        file = io.BytesIO()
        image.save(file, format="PNG", optimize=True)
        files[place] = file.getvalue()
    return files


def _frame(played: PlayedEpisodes, place: _FramePlace, picture: bytes) -> ExampleFrame:
    steps = played.steps.of_episode(place.episode)
    return ExampleFrame(
        player=played.player.name,
        seed=int(played.seeds[place.episode]),
        step=place.step,
        observation=steps.observation[place.step],
        executed=steps.executed[place.step],
        picture=picture,
    )


def try_example_frames(*arguments: Any, **options: Any) -> Examples | SarlError:
    """As `example_frames`, with what goes wrong as a result: a report does without pictures.

    Args:
        *arguments: Of `example_frames`.
        **options: Likewise.

    Returns:
        The frames, or why there are none.

    Raises:
        CancelledError: If `progress` returned False.
    """
    try:
        return example_frames(*arguments, **options)
    except CancelledError:
        raise
    except SarlError as error:
        return error
    except Exception as error:  # of other people's environments, which may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        return InputError(f"the environment failed ({reason}); choose another one")
