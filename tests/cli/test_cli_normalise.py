"""Agents that were trained under VecNormalize, on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from sarl_core.cli.app import main

CART = "CartPole-v1"


@pytest.fixture
def fail(capsys):
    """Run a command line that the input is wrong for, and give the sentence."""

    def call(*arguments):
        assert main([str(argument) for argument in arguments]) == 2
        return capsys.readouterr().err

    return call


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a model, and with statistics whose name tells nothing."""
    folder = tmp_path_factory.mktemp("trained")
    env = VecNormalize(DummyVecEnv([lambda: gymnasium.make(CART)]))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=64, seed=0, device="cpu").learn(128)
    model.save(folder / "model.zip")
    env.save(str(folder / "statistics.pkl"))
    return folder


def returns(trained: Path) -> list[float]:
    """What Stable-Baselines3 itself gets with them."""
    env = VecNormalize.load(
        str(trained / "statistics.pkl"), DummyVecEnv([lambda: gymnasium.make(CART)])
    )
    model = PPO.load(trained / "model.zip", device="cpu")
    plain = gymnasium.make(CART)
    found = []
    for seed in range(3):
        observation, total, over = plain.reset(seed=seed)[0], 0.0, False
        while not over:
            action, _ = model.predict(env.normalize_obs(observation), deterministic=True)
            observation, reward, terminated, truncated, _ = plain.step(int(action))
            total, over = total + float(reward), terminated or truncated
        found.append(total)
    return found


def test_statistics_are_given_found_and_asked_for(run, fail, trained, tmp_path, capsys):
    command = ("evaluate", "--env", CART, "--episodes", 3, "--json", "--agent")
    sentence = fail(*command, trained / "model.zip")
    assert "--normalise FILE" in sentence
    given = run(*command, trained / "model.zip", "--normalise", trained / "statistics.pkl")
    theirs = returns(trained)
    assert [episode["return"] for episode in json.loads(given)["episodes"]] == theirs
    beside = tmp_path / "model.zip"
    beside.write_bytes((trained / "model.zip").read_bytes())
    (tmp_path / "vecnormalize.pkl").write_bytes((trained / "statistics.pkl").read_bytes())
    assert main([str(argument) for argument in (*command, beside)]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out) == json.loads(given)
    assert "vecnormalize.pkl, which lies beside model.zip" in printed.err
    raw = json.loads(run(*command, trained / "model.zip", "--normalise", "none"))
    assert raw != json.loads(given)


@pytest.mark.parametrize("command", ["record", "render", "ablate", "aggregate", "report"])
def test_every_command_with_an_agent_takes_statistics(command, run, trained, cart_rules, tmp_path):
    agent = ("--agent", trained / "model.zip", "--normalise", trained / "statistics.pkl")
    data = Path(__file__).resolve().parents[2] / "data" / "demonstrations" / "cartpole.parquet"
    out = {"record": "d.csv", "render": "p.gif", "ablate": "a.csv", "report": "r.html"}.get(
        command, "rules.json"
    )
    rest = {
        "record": ("--env", CART, "--steps", 50),
        "render": ("--env", CART, "--max-steps", 20),
        "ablate": ("--env", CART, "--rules", cart_rules, "--episodes", 2, "--most", 2, "--jobs", 1),
        "aggregate": (data, "--rounds", 1, "--episodes", 2, "--validation", 2, "--max-rules", 2),
        "report": (cart_rules, "--demonstrations", data, "--episodes", 1, "--frames", 1),
    }[command]
    run(command, *rest, *agent, "--out", tmp_path / out)
    assert np.all([path.stat().st_size > 0 for path in tmp_path.iterdir()])
    assert (tmp_path / out).exists()


def test_only_one_of_two_files_can_be_meant(fail, trained, tmp_path):
    data = Path(__file__).resolve().parents[2] / "data" / "demonstrations" / "cartpole.parquet"
    model = trained / "model.zip"
    sentence = fail(
        *("aggregate", data, "--agent", model, "--expert", model),
        *("--normalise", trained / "statistics.pkl", "--out", tmp_path / "rules.json"),
    )
    assert "both agent and expert are one" in sentence
