from __future__ import annotations

import io
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from PIL import Image

from sarl_core import InputError, RuleSet, load_demonstrations, mine_rules
from sarl_core.errors import WorkError
from sarl_core.rendering.example_frames import (
    Examples,
    Player,
    example_frames,
    try_example_frames,
)

DATA = Path(__file__).parents[2] / "data"
EXPERT = Player("the expert", "expert", shielded=False, stochastic=True)
NOVICE = Player("a novice held to the rules", "novice", shielded=True)


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    demonstrations = load_demonstrations(DATA / "demonstrations" / "cartpole.parquet")
    return mine_rules(demonstrations, supp_min=0.005, conf_min=0.95)


@pytest.fixture(scope="module")
def found(rules: RuleSet) -> Examples:
    return example_frames("CartPole-v1", rules, range(len(rules)), (EXPERT, NOVICE), episodes=4)


def drawn(observation: np.ndarray) -> np.ndarray:
    """The scene of a state, drawn by the environment itself."""
    env = gymnasium.make("CartPole-v1", render_mode="rgb_array")
    env.reset(seed=0)
    env.unwrapped.state = tuple(observation.astype(float))
    picture = env.render()
    env.close()
    return np.asarray(picture)


def test_a_frame_shows_a_state_in_which_its_rule_applies(rules: RuleSet, found: Examples) -> None:
    assert set(found.frames) <= set(range(len(rules)))
    assert len(found.frames) >= 3
    for index, frames in found.frames.items():
        assert 1 <= len(frames) <= 3
        for frame in frames:
            assert rules.rules[index].applies(frame.observation[None]).all()


def test_the_picture_is_that_of_the_state(found: Examples) -> None:
    frames = [frame for some in found.frames.values() for frame in some]
    pictures = [
        np.asarray(Image.open(io.BytesIO(frame.picture)).convert("RGB"), dtype=float)
        for frame in frames
    ]
    assert {picture.shape for picture in pictures} == {(found.size[1], found.size[0], 3)}
    scenes = []
    for frame in frames:
        scene = Image.fromarray(drawn(frame.observation)).resize((400, 267))
        scenes.append(np.asarray(scene, dtype=float))
    # Rows without anything are cut off: the scene is found again at one and the same height.
    heights = range(267 - found.size[1] + 1)
    off = [
        np.mean(
            [
                np.abs(scene[y : y + found.size[1]] - picture).mean()
                for scene, picture in zip(scenes, pictures, strict=True)
            ]
        )
        for y in heights
    ]
    y = int(np.argmin(off))
    for number, picture in enumerate(pictures):
        far = [np.abs(scene[y : y + found.size[1]] - picture).mean() for scene in scenes]
        assert far[number] <= min(far) + 0.05
        assert far[number] < 1.5


def test_frames_are_spread_over_episodes_where_a_rule_applies_in_several(found: Examples) -> None:
    (played,) = found.played[:1]
    for index, frames in found.frames.items():
        own = [frame for frame in frames if frame.player == "the expert"]
        episodes = np.unique(played.steps.episode[played.steps.rules[:, 0] == index])
        assert len({frame.seed for frame in own}) == min(3, len(episodes))


def test_the_same_arguments_give_the_same_bytes(rules: RuleSet) -> None:
    first, again = (
        example_frames("CartPole-v1", rules, [0, 1], (EXPERT,), each=1, episodes=2)
        for _ in range(2)
    )
    assert {key: [f.picture for f in some] for key, some in first.frames.items()} == {
        key: [f.picture for f in some] for key, some in again.frames.items()
    }


def test_pictures_share_few_colours(found: Examples) -> None:
    palettes = set()
    for frames in found.frames.values():
        for frame in frames:
            picture = Image.open(io.BytesIO(frame.picture))
            assert picture.mode == "P"
            palettes.add(bytes(picture.getpalette() or []))
    assert len(palettes) == 1


def test_who_is_not_needed_does_not_play(rules: RuleSet) -> None:
    found = example_frames("CartPole-v1", rules, [0], (EXPERT, NOVICE), each=1, episodes=1)
    assert [played.player for played in found.played] == [EXPERT]
    assert found.frames[0][0].player == "the expert"


def test_progress_rises_to_the_end_and_can_stop(rules: RuleSet) -> None:
    told: list[tuple[int, int]] = []

    def note(done: int, total: int) -> None:
        told.append((done, total))

    example_frames("CartPole-v1", rules, [0], (EXPERT,), each=1, episodes=2, progress=note)
    shares = [done / total for done, total in told]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    with pytest.raises(WorkError, match="stopped"):
        try_example_frames("CartPole-v1", rules, [0], (EXPERT,), progress=lambda done, total: False)


def test_what_cannot_be_drawn_is_said(rules: RuleSet) -> None:
    with pytest.raises(InputError, match="Nowhere-v9"):
        example_frames("Nowhere-v9", rules, [0], (NOVICE,))
    told = try_example_frames("Acrobot-v1", rules, [0], (NOVICE,), episodes=1)
    assert isinstance(told, InputError)
    assert "features" in str(told) or "observation" in str(told)
    with pytest.raises(InputError, match="frames a rule is 0"):
        example_frames("CartPole-v1", rules, [0], (NOVICE,), each=0)
