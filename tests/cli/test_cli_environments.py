"""Environments with arguments and wrappers, by command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sarl_core import Demonstrations, load_demonstrations, save_demonstrations
from sarl_core.cli.app import main

WRAPPERS = """
import gymnasium

class Fails(gymnasium.Wrapper):
    def reset(self, **more):
        self.left = 7
        return self.env.reset(**more)
    def step(self, action):
        self.left -= 1
        if not self.left:
            raise RuntimeError("the cable broke")
        return self.env.step(action)

class Leaves(Fails):
    def step(self, action):
        try:
            return super().step(action)
        except RuntimeError:
            raise SystemExit(0)

def tenfold(env):
    return gymnasium.wrappers.TransformReward(env, lambda reward: 10 * reward)
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "crane_wrappers.py").write_text(WRAPPERS)
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def evaluated(capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    assert not main(["evaluate", "--agent", "novice", "--episodes", "1", "--json", *options])
    return dict(json.loads(capsys.readouterr().out))


def test_arguments_and_wrappers_reach_what_is_played(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    env = ("--env", "CartPole-v1", "--env-args", '{"max_episode_steps": 5}')
    alone = evaluated(capsys, *env)["episodes"][0]
    wrapped = evaluated(
        capsys,
        *env,
        *("--wrapper", "crane_wrappers:tenfold", "--wrapper", "crane_wrappers:tenfold"),
    )["episodes"][0]
    assert (alone["length"], alone["return"]) == (5, 5.0)
    assert (wrapped["length"], wrapped["return"]) == (5, 500.0)


def test_what_raises_in_an_episode_says_which_and_when(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    env = ("--env", "CartPole-v1", "--wrapper", "crane_wrappers:Fails")
    code = main(["evaluate", *env, "--agent", "novice", "--seed", "11"])
    said = capsys.readouterr().err
    assert code == 2
    assert "in the episode with seed 11, at step 6 (RuntimeError: the cable broke)" in said


def test_what_leaves_the_program_ends_an_episode_and_is_no_success(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    env = ("--env", "CartPole-v1", "--wrapper", "crane_wrappers:Leaves")
    out = here / "kept.csv"
    code = main(["record", *env, "--agent", "novice", "--steps", "50", "--out", str(out)])
    said = capsys.readouterr().err
    assert code == 2
    assert "in the episode with seed 0, at step 6 (SystemExit: 0)" in said
    assert len(load_demonstrations(out)) == 6
    (here / "leaving.py").write_text("raise SystemExit(0)\n")
    assert main(["evaluate", "--env", "CartPole-v1", "--agent", "leaving:agent"]) == 2
    assert "cannot be imported (SystemExit: 0)" in capsys.readouterr().err


def test_arguments_without_an_environment_are_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    data = Path(__file__).resolve().parents[2] / "data" / "demonstrations" / "cartpole.parquet"
    assert main(["check", str(data), "--env-args", "{}"]) == 2
    assert "--env-args belongs to an environment; name it with --env" in capsys.readouterr().err


def test_no_module_is_imported_because_demonstrations_name_it(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = here / "table.csv"
    table.write_text("obs_a,action\n" + "".join(f"{i / 7},{i % 2}\n" for i in range(40)))
    recorded = here / "named.parquet"
    plain = load_demonstrations(table)
    save_demonstrations(
        Demonstrations(
            plain.observations,
            plain.actions,
            plain.episodes,
            env_id="crane_wrappers:Crane-v0",
        ),
        recorded,
    )
    assert main(["aggregate", str(recorded), "--out", str(here / "out.json")]) == 2
    assert "a file may not say what is" in capsys.readouterr().err


def test_what_was_recorded_before_an_environment_failed_is_written(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "late_wrappers.py").write_text(
        "import crane_wrappers\n\n"
        "class Late(crane_wrappers.Fails):\n"
        "    def reset(self, *, seed=None, options=None):\n"
        "        answer = super().reset(seed=seed)\n"
        "        self.left = 7 if seed == 3 else -1\n"
        "        return answer\n"
    )
    out = here / "part.parquet"
    env = ("--env", "CartPole-v1", "--wrapper", "late_wrappers:Late")
    code = main(
        ["record", *env, "--agent", "novice", "--steps", "9000", "--seed", "0", "--out", str(out)]
    )
    assert code == 2
    assert "in the episode with seed 3, at step 6" in capsys.readouterr().err
    part = load_demonstrations(out)
    as_long = ("--agent", "novice", "--seed", "0", "--steps", str(len(part)))
    plain = here / "whole.parquet"
    assert not main(["record", "--env", "CartPole-v1", *as_long, "--out", str(plain)])
    whole = load_demonstrations(plain)
    first = part.episodes == 0
    np.testing.assert_array_equal(part.observations[first], whole.observations[: first.sum()])
    assert part.n_episodes == 2
