"""Episodes without an end are cut off where one says, and it is told apart and said."""

import json
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from scipy.stats import binomtest

from sarl_core.cli.app import main
from sarl_core.errors import InputError
from sarl_core.explaining.report.comparison import compared, results_from_text
from sarl_core.rendering.replay import render_episode
from sarl_core.rollouts.episodes import join, rollout
from sarl_core.studies.shield_effect import shield_effect


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
    assert note == (
        "4 of the 6 episodes were cut off after 20 steps (max_steps), before their end: their "
        "returns count these steps alone"
    )
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


def test_whether_a_cut_episode_would_have_failed_is_not_known():
    found = rollout("CartPole-v1", "novice", episodes=12, seed=0, max_steps=20, keep_steps=False)
    whole = rollout("CartPole-v1", "novice", episodes=12, seed=0, keep_steps=False)
    document, summary = found.to_dict(), found.summary()
    ended = 12 - summary["cut"]
    assert 0 < summary["failures"] == ended < 12
    failed = [one["failed"] for one in document["episodes"]]
    assert failed == [None if cut else True for cut in found.cut.tolist()]
    assert [one.get("cost") for one in document["episodes"]] == [f and 1.0 for f in failed]
    assert "cost" not in summary
    least = binomtest(ended, 12).proportion_ci(method="exact").low
    assert summary["failure_rate"] == ended / 12
    assert (summary["failure_low"], summary["failure_high"]) == (pytest.approx(least), 1.0)
    assert whole.summary()["failure_rate"] == 1.0
    assert "whether they would have failed later is not known" in document["notes"][0]


def test_pairs_in_which_one_was_cut_do_not_tell_of_failures():
    short, long = (
        rollout("CartPole-v1", "novice", episodes=12, seed=0, max_steps=limit, keep_steps=False)
        for limit in (20, 500)
    )
    found = shield_effect(short, long)
    assert (found.fell, found.spared, found.failure_p) == (0, 0, 1.0)
    none = replace(short, cut=np.ones(12, dtype=np.bool_))
    assert shield_effect(none, long).failures is None


def test_it_is_said_in_words(capsys):
    run = ["evaluate", "--env", "CartPole-v1", "--agent", "novice", "--seed", "0"]
    assert main([*run, "--episodes", "12", "--max-steps", "20"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    found = rollout("CartPole-v1", "novice", episodes=12, seed=0, max_steps=20, keep_steps=False)
    ended = 12 - int(found.cut.sum())
    assert f"failures {ended} of the {ended} that ended, at least" in told
    assert main([*run, "--episodes", "1", "--max-steps", "1"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "failures not known: no episode ran to its end" in told
    assert (
        "note: the episode was cut off after 1 step (max_steps), before its end: its return counts "
        "these steps alone, and whether it would have failed later is not known"
    ) in told


def test_what_cannot_fail_is_told_apart_from_what_is_not_known(capsys):
    for env_id, words in (
        ("Pendulum-v1", "failures none: no end of this environment's episodes is a failure"),
        (ENV, "failures not known: nothing says which ends of this environment's episodes are"),
    ):
        run = ["evaluate", "--env", env_id, "--agent", "novice", "--episodes", "1"]
        assert main([*run, "--max-steps", "9"]) == 0
        told = capsys.readouterr().out
        assert words in " ".join(told.split())
        assert "would have failed" not in told


def test_a_report_says_the_same_of_what_evaluate_printed(capsys):
    run = ["evaluate", "--agent", "novice", "--seed", "0", "--json", "--episodes", "12"]
    assert main([*run, "--env", "CartPole-v1", "--max-steps", "20"]) == 0
    text = capsys.readouterr().out
    count = json.loads(text)["summary"]["cut"]
    shown = compared(results_from_text(text, "novice.json"))
    assert shown is not None
    assert shown.rows[0].more[0].startswith("at least ")
    assert any(f"novice: {count} of the 12 episodes were cut off" in one for one in shown.sentences)
    assert main([*run, "--env", "Pendulum-v1"]) == 0
    shown = compared(results_from_text(capsys.readouterr().out, "novice.json"))
    assert shown is not None
    assert shown.rows[0].more[0] == "cannot fail"
