import io
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import imageio.v3
import numpy as np
import pytest
from PIL import Image, ImageSequence

from sarl_core.decimals import rounded_text
from sarl_core.environments.description import describe_environment
from sarl_core.errors import InputError
from sarl_core.mining.action_words import done_text
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.environment_actions import environment_dimensions
from sarl_core.mining.language import sentence
from sarl_core.progress import CancelledError
from sarl_core.rendering.canvas import INKS, OVERLAY_COLOURS, fitted, text_width, wrapped
from sarl_core.rendering.overlay import BOTTOM, GAP, TOP
from sarl_core.rendering.replay import (
    Replay,
    check_picture_path,
    render_episode,
    side_by_side,
)
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.recording import record
from sarl_core.shielding.shield import Shield

CHANGED = np.array(OVERLAY_COLOURS[INKS.changed.full])


@pytest.fixture(scope="module")
def shields() -> dict[str, Shield]:
    return {
        env_id: Shield(
            mine_rules(
                record(env_id, "expert", steps=3_000, stochastic=True), supp_min=0.0, conf_min=0.9
            )
        )
        for env_id in ("LunarLander-v3", "Pendulum-v1", "CartPole-v1")
    }


@pytest.fixture(scope="module")
def pair(shields: dict[str, Shield]) -> Replay:
    return side_by_side("LunarLander-v3", "novice", shields["LunarLander-v3"], seed=1)


@pytest.mark.parametrize("env_id", ["LunarLander-v3", "Pendulum-v1", "CartPole-v1"])
@pytest.mark.parametrize("shielded", [True, False])
def test_renders_the_episode_that_rollout_plays(
    env_id: str, shielded: bool, shields: dict[str, Shield]
) -> None:
    shield = shields[env_id] if shielded else None
    rendered = render_episode(env_id, "novice", shield=shield, seed=2).episodes[0]
    played = rollout(env_id, "novice", shield=shield, episodes=1, seed=2)
    for name in ("returns", "lengths", "interventions", "covered", "terminated", "truncated"):
        assert getattr(rendered, name).tobytes() == getattr(played, name).tobytes(), name
    assert rendered.steps is not None
    for name in (
        "episode",
        "step",
        "observation",
        "proposed",
        "executed",
        "rules",
        "intervened",
        "margin",
        "reward",
        "outside",
    ):
        assert getattr(rendered.steps, name).tobytes() == getattr(played.steps, name).tobytes()


def test_the_scene_is_the_environments_own(shields: dict[str, Shield]) -> None:
    """With few colours, every pixel of the scene is as the environment drew it."""
    replay = render_episode("CartPole-v1", "novice", seed=5)
    env = gymnasium.make("CartPole-v1", render_mode="rgb_array")
    env.reset(seed=5)
    assert replay.episodes[0].steps is not None
    for number, action in enumerate(replay.episodes[0].steps.executed[:10, 0]):
        drawn: Any = env.render()
        shown = replay.frame(number)[TOP:-BOTTOM].astype(int)
        assert np.abs(shown - drawn).max() <= 24  # smoothed edges may share a palette entry
        assert (shown == drawn).all(axis=2).mean() > 0.995
        env.step(int(action))


def test_a_gif_is_animated_in_real_time_and_not_blank(pair: Replay) -> None:
    content = pair.gif()
    assert pair.gif() is content
    with Image.open(io.BytesIO(content)) as image:
        assert image.is_animated  # type: ignore[attr-defined]
        assert image.size == (2 * 600 + GAP, TOP + 400 + BOTTOM)
        pictures, total = [], 0
        last = image.n_frames - 1  # type: ignore[attr-defined]
        for number, frame in enumerate(ImageSequence.Iterator(image)):
            if number % 30 == 0 or number == last:
                pictures.append(np.asarray(frame.convert("RGB")))
            total += int(frame.info["duration"])
    assert abs(total / 1000 - len(pair) / 50) <= 1 / 50
    scenes = [picture[TOP:-BOTTOM, :600] for picture in pictures]
    assert all(len(np.unique(scene.reshape(-1, 3), axis=0)) > 5 for scene in scenes)
    assert (scenes[0] != scenes[len(scenes) // 2]).any()
    assert (pictures[-1] == pair.frame(len(pair) - 1)).all()


def test_same_seed_same_bytes(tmp_path: Path, pair: Replay, shields: dict[str, Shield]) -> None:
    again = side_by_side("LunarLander-v3", "novice", shields["LunarLander-v3"], seed=1)
    again.save(tmp_path / "again.gif")
    assert (tmp_path / "again.gif").read_bytes() == pair.gif()
    first, second, other = (
        render_episode("CartPole-v1", "novice", seed=seed) for seed in (3, 3, 4)
    )
    first.save(tmp_path / "first.mp4")
    second.save(tmp_path / "second.mp4")
    assert (tmp_path / "first.mp4").read_bytes() == (tmp_path / "second.mp4").read_bytes()
    assert first.gif() == second.gif()
    assert first.gif() != other.gif()


# imageio's reader leaves a pipe to ffmpeg open.
@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")
def test_an_mp4_holds_every_picture(tmp_path: Path) -> None:
    replay = render_episode("CartPole-v1", "novice", seed=0)
    replay.save(tmp_path / "x.mp4")
    pictures = imageio.v3.imread(tmp_path / "x.mp4", plugin="FFMPEG")
    assert pictures.shape == (len(replay), TOP + 400 + BOTTOM, 600, 3)
    assert np.abs(pictures[-1].astype(int) - replay.frame(len(replay) - 1)).mean() < 6
    assert imageio.v3.immeta(tmp_path / "x.mp4", plugin="FFMPEG")["fps"] == 50


def test_interventions_are_marked_and_only_they(pair: Replay) -> None:
    steps = pair.episodes[0].steps
    assert steps is not None
    assert 0 < steps.intervened.sum() < len(steps)
    for number in range(0, len(steps), 7):
        line = pair.frame(number)[-BOTTOM, :600]
        assert bool((line == CHANGED).all()) == bool(steps.intervened[number])
        assert not (pair.frame(number)[-BOTTOM, 600 + GAP :] == CHANGED).all(axis=1).any()


def test_captions_say_what_the_step_was(pair: Replay) -> None:
    shielded, plain = pair.panels
    steps = shielded.steps
    names = ("do nothing", "fire left engine", "fire main engine", "fire right engine")
    step = int(np.flatnonzero(steps.intervened & ~steps.outside)[3])
    caption = shielded.caption(step)
    assert caption.mark == "CHANGED"
    assert caption.action == (
        f"{names[steps.proposed[step, 0]]} → {names[steps.executed[step, 0]]}"
    )
    assert caption.reason == shielded.describe_rule(int(steps.rules[step, 0]))
    assert names[steps.executed[step, 0]] in caption.reason
    agreeing = int(np.flatnonzero(steps.covered & ~steps.intervened)[0])
    assert shielded.caption(agreeing).mark == "AGREES"
    beyond = replace(shielded, steps=replace(steps, outside=np.ones_like(steps.outside)))
    assert beyond.caption(step) == caption._replace(
        reason=f"Outside the data behind it: {caption.reason}"
    )
    assert beyond.caption(agreeing).mark == "ABSTAINS"
    without = replace(steps, rules=np.full_like(steps.rules, -1))
    assert replace(shielded, steps=without).caption(agreeing).mark == "NO RULE"
    assert plain.caption(0).mark == ""


def test_a_saved_picture_speaks_of_its_own_step_only(pair: Replay) -> None:
    """The strip of every picture is that of its step's record, whatever the steps around it."""
    panel = pair.panels[0]
    top = panel.size[0] - BOTTOM
    orange = np.array(INKS.changed.full)
    steps = panel.steps
    kinds = {"changed": steps.intervened, "agreed": steps.covered & ~steps.intervened}
    assert all(kind.any() for kind in kinds.values())
    for number in range(len(steps)):
        line = panel.picture(number)[top : top + 4]
        assert (line == orange).all() == bool(steps.intervened[number])
    # The records of all other steps may be anything: the text above the bar stays as it is.
    for kind in kinds.values():
        number = int(np.flatnonzero(kind)[-1])
        others = np.arange(len(steps)) != number
        elsewhere = replace(
            steps,
            rules=np.where(others[:, None], -1, steps.rules),
            intervened=steps.intervened & ~others,
        )
        strip = np.s_[top : top + BOTTOM - 20]
        alone = replace(panel, steps=elsewhere).picture(number)
        assert (alone[strip] == panel.picture(number)[strip]).all()


def test_the_shorter_one_stays_on_its_last_state(pair: Replay) -> None:
    long, short = (len(panel.steps) for panel in pair.panels)
    assert short < long
    assert len(pair) == long + 1
    right = np.s_[:, 600 + GAP :]
    assert (pair.frame(short)[right] == pair.frame(long)[right]).all()
    assert (pair.frame(short - 1)[right] != pair.frame(short)[right]).any()


def test_the_sides_are_the_two_episodes(pair: Replay, shields: dict[str, Shield]) -> None:
    assert [panel.title for panel in pair.panels] == ["novice, shielded", "novice, unshielded"]
    with_rules, without = (
        rollout("LunarLander-v3", "novice", shield=shield, episodes=1, seed=1).returns[0]
        for shield in (shields["LunarLander-v3"], None)
    )
    assert [episode.returns[0] for episode in pair.episodes] == [with_rules, without]


def test_the_rules_can_be_described_otherwise(shields: dict[str, Shield]) -> None:
    asked: list[int] = []

    def describe(rule: int) -> str:
        asked.append(rule)
        return f"rule number {rule}"

    replay = render_episode(
        "CartPole-v1", "novice", shield=shields["CartPole-v1"], describe_rule=describe
    )
    replay.frame(0)
    assert replay.episodes[0].steps is not None
    assert asked == [int(replay.episodes[0].steps.rules[0, 0])]


def test_a_picture_says_the_sentence_that_stands_everywhere(shields: dict[str, Shield]) -> None:
    shield = shields["Pendulum-v1"]
    replay = side_by_side("Pendulum-v1", "novice", shield, seed=2, max_steps=60)
    panel, steps = replay.panels[0], replay.episodes[0].steps
    assert steps is not None
    step = int(np.flatnonzero(steps.intervened)[0])
    rule = shield.rule_set.rules[int(steps.rules[step, 0])]
    assert panel.caption(step).reason == sentence(rule, shield.rule_set, evidence=False)
    (dimension,) = shield.rule_set.actions
    proposed, executed = float(steps.proposed[step, 0]), float(steps.executed[step, 0])
    assert panel.caption(step).action == (
        f"{done_text(proposed, dimension, beside=(executed,))} → "
        f"{done_text(executed, dimension, beside=(proposed,))}"
    )
    alone = replay.panels[1]
    assert alone.caption(step).action == done_text(float(alone.steps.executed[step, 0]), dimension)


def test_rendering_tells_how_far_it_is_and_can_be_stopped() -> None:
    calls: list[tuple[int, int]] = []
    render_episode("CartPole-v1", "novice", progress=lambda *call: calls.append(call))
    assert calls[-1] == (500, 500)
    assert [done for done, _ in calls] == sorted(done for done, _ in calls)
    with pytest.raises(CancelledError):
        render_episode("CartPole-v1", "novice", progress=lambda *_: False)


def test_an_environment_without_pictures_is_one_sentence() -> None:
    with pytest.raises(InputError, match="toy/Matrix-v0 draws no pictures"):
        render_episode("toy/Matrix-v0", "novice")


@pytest.mark.parametrize(
    ("name", "sentence"), [("x.png", "neither a .gif nor a .mp4"), ("no/x.gif", "does not exist")]
)
def test_a_bad_file_name_is_one_sentence(tmp_path: Path, name: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        check_picture_path(tmp_path / name)


def test_works_without_a_display_and_leaves_the_environment_alone() -> None:
    code = (
        "import os\n"
        "from sarl_core.rendering.replay import render_episode\n"
        "def found(): return {k: v for k, v in os.environ.items() if k.startswith('SDL_')}\n"
        "before = found()\n"
        "assert len(render_episode('LunarLander-v3', 'novice').gif()) > 10_000\n"
        "assert found() == before\n"
    )
    clean = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("SDL_", "PYGAME_", "DISPLAY", "WAYLAND"))
    }
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, env=clean, text=True
    )
    assert done.stdout == done.stderr == ""


def test_small_pictures_are_enlarged() -> None:
    replay = render_episode("toy/Tiny-v0", "novice")
    assert replay.frame(0).shape == (TOP + 6 * 80 + BOTTOM, 6 * 80, 3)
    assert replay.fps == 4


TINY: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 4}


class Tiny(gymnasium.Env[Any, Any]):
    """Draws 80 x 80 pixels, four times a second."""

    metadata = TINY

    def __init__(self, **kwargs: Any):
        self.render_mode = kwargs.get("render_mode")
        self.observation_space = gymnasium.spaces.Box(-1, 1, (1,))
        self.action_space = gymnasium.spaces.MultiDiscrete([2, 3])

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self.left = 5
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> Any:
        self.left -= 1
        return np.zeros(1, np.float32), 1.0, self.left == 0, False, {}

    def render(self) -> Any:
        return np.full((80, 80, 3), 40 * self.left, dtype=np.uint8)


gymnasium.register("toy/Tiny-v0", entry_point=Tiny)


def test_actions_in_words() -> None:
    replay = render_episode("toy/Tiny-v0", "novice")
    panel, steps = replay.panels[0], replay.episodes[0].steps
    assert steps is not None
    first, second = steps.executed[0].tolist()
    assert panel.caption(0).action == f"action 0 {first}, action 1 {second}"
    # Of two dimensions the one is named that was changed.
    changed = replace(
        steps,
        proposed=np.array([[0, 2], *steps.proposed[1:].tolist()]),
        executed=np.array([[0, 1], *steps.executed[1:].tolist()]),
        rules=np.zeros_like(steps.rules),
        intervened=np.ones_like(steps.intervened),
    )
    shielded = replace(panel, steps=changed, shielded=True, describe_rule=lambda rule: "Always 1.")
    assert shielded.caption(0).action == "action 1 2 → action 1 1"
    pendulum = environment_dimensions(describe_environment("Pendulum-v1"), None)
    torques = np.array([[-1.2], [0.5004], [0.0004]], np.float32)
    wanted = np.array([[-1.2], [0.5], [0.0]], np.float32)
    pushed = replace(
        steps.take(slice(3)),
        proposed=wanted,
        executed=torques,
        rules=np.zeros((3, 1), dtype=np.int64),
        intervened=np.array([False, True, True]),
    )
    shielded = replace(shielded, steps=pushed, dimensions=pendulum)
    assert [shielded.caption(step).action for step in range(3)] == [
        "torque -1.2",
        "torque 0.5 → torque 0.5004",
        "torque 0 → torque 0.0004",
    ]
    assert (rounded_text(-0.001, 2), rounded_text(-1234.5, 1)) == ("0.00", "−1,234.5")


def test_text_is_wrapped_and_shortened_to_what_there_is() -> None:
    text = "If the pole leans far to the left and the cart moves fast then push it left again"
    lines = wrapped(text, 14, 200, 2)
    assert len(lines) == 2
    assert all(text_width(line, 14) <= 200 for line in lines)
    assert lines[1].endswith("…")
    assert wrapped(text, 14, 2_000, 2) == [text]
    assert fitted("x", 14, 100) == "x"
    assert text_width("≤ → −", 14) > text_width("", 14)


def test_a_picture_as_a_file_is_the_picture() -> None:
    replay = render_episode("CartPole-v1", "novice", seed=3)
    for number in (0, len(replay.panels[0].film) // 2):
        with Image.open(io.BytesIO(replay.png(number))) as picture:
            assert (np.asarray(picture.convert("RGB")) == replay.frame(number)).all()
