"""Episodes without an end are cut off where one says, and it is told apart and said."""

import json
from pathlib import Path
from typing import ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from sarl_core.cli import main
from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import join, rollout
from sarl_core.rollouts.rendering import render_episode


class Endless(gymnasium.Env):
    """It ends only on seeds that divide by three, after seven steps; each step costs a half."""

    metadata: ClassVar = {"render_modes": ["rgb_array"], "render_fps": 10}
    observation_space = spaces.Box(-1, 1, (2,), np.float32)
    action_space = spaces.Discrete(2)

    def __init__(self, render_mode=None):
        self.render_mode = render_mode

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.ends, self.step_number = seed % 3 == 0, 0
        return np.zeros(2, np.float32), {}

    def step(self, action):
        self.step_number += 1
        done = self.ends and self.step_number == 7
        return np.zeros(2, np.float32), 1.0, False, done, {"cost": 0.5}

    def render(self):
        return np.zeros((40, 60, 3), np.uint8)


ENV = "SarlEndless-v0"
gymnasium.register(ENV, entry_point=Endless, disable_env_checker=True)


def test_the_limit_of_the_run_is_told_from_that_of_the_environment():
    found = rollout(ENV, "novice", episodes=6, seed=0, max_steps=20, keep_steps=False)
    assert found.cut.tolist() == [False, True, True, False, True, True]
    assert found.truncated.all()
    assert not found.terminated.any()
    assert found.lengths.tolist() == [7, 20, 20, 7, 20, 20]
    document = found.to_dict()
    assert [one.get("cut", False) for one in document["episodes"]] == found.cut.tolist()
    assert document["summary"]["cut"] == 4
    (note,) = document["notes"]
    assert "4 of the 6 episodes had no end and were cut off after 20 steps" in note
    halves = join([found.part(0, 3), found.part(3, 6)])
    assert halves.cut.tolist() == found.cut.tolist()
    assert found.part(0, 1).remarks == ()


def test_what_steps_cost_is_added_up_and_what_is_not_known_is_not_said():
    found = rollout(ENV, "novice", episodes=3, seed=0, max_steps=20, keep_steps=False)
    assert found.costs.tolist() == [3.5, 10.0, 10.0]
    document = found.to_dict()
    assert document["summary"]["cost"] == pytest.approx(23.5 / 3)
    assert not any(name.startswith("failure") for name in document["summary"])
    assert "failed" not in document["episodes"][0]
    assert document["summary"]["freedom"] == 1.0


def test_the_limit_of_a_picture_may_be_set():
    replay = render_episode(ENV, "novice", seed=1, max_steps=9)
    (episode,) = replay.episodes
    assert (len(replay), episode.cut.tolist(), episode.truncated.tolist()) == (10, [True], [True])
    assert episode.costs.tolist() == [4.5]
    with pytest.raises(InputError, match="max_steps"):
        render_episode(ENV, "novice", max_steps=0)


@pytest.mark.parametrize("command", ["evaluate", "render"])
def test_both_commands_say_it(capsys, tmp_path: Path, command: str):
    out = ["--out", str(tmp_path / "x.gif")] if command == "render" else ["--episodes", "1"]
    run = [command, "--env", ENV, "--agent", "novice", "--seed", "1", "--max-steps", "11", *out]
    assert main([*run, "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["episodes"][0]["cut"] is True
    assert document["episodes"][0]["length"] == 11
    assert "cut off after 11 steps" in document["notes"][0]
    assert main(run) == 0
    assert "cut off after 11 steps" in capsys.readouterr().out
