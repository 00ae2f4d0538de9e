"""The commands that run agents: evaluate, render, train-expert."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sarl_core.agents.mlp_policy import MlpPolicy

ROOT = Path(__file__).resolve().parents[2]
PENDULUM = str(ROOT / "data" / "demonstrations" / "pendulum.parquet")


def test_evaluate_as_json_is_the_contract(run, cart_rules):
    arguments = (
        "evaluate",
        "--env",
        "CartPole-v1",
        "--agent",
        "novice",
        "--rules",
        cart_rules,
        "--episodes",
        4,
        "--seed",
        7,
        "--json",
    )
    document = json.loads(run(*arguments))
    assert [episode["seed"] for episode in document["episodes"]] == [7, 8, 9, 10]
    for episode in document["episodes"]:
        assert set(episode) == {
            "seed",
            "return",
            "length",
            "interventions",
            "covered",
            "failed",
            "cost",
        }
        assert 0 <= episode["interventions"] <= episode["covered"] <= episode["length"]
    summary = document["summary"]
    assert set(summary) == {
        "mean",
        "std",
        "iqm",
        "iqm_low",
        "iqm_high",
        "intervention_rate",
        "coverage",
        "outside_rate",
        "worst_tenth",
        "freedom",
        "cost",
        "cost_low",
        "cost_high",
        "cost_worst_tenth",
        "failures",
        "failure_rate",
        "failure_low",
        "failure_high",
    }
    assert summary["mean"] == np.mean([episode["return"] for episode in document["episodes"]])
    assert summary["intervention_rate"] > 0
    assert json.loads(run(*arguments)) == document


def test_evaluate_prints_a_row_an_episode_and_a_shield_helps_a_novice(run, cart_rules):
    def mean(*more):
        arguments = ("evaluate", "--env", "CartPole-v1", "--agent", "novice", "--episodes", 5)
        text = run(*arguments, *more)
        assert "interventions" in text
        assert (
            sum(line.split()[:1] == [str(seed)] for seed in range(5) for line in text.splitlines())
            == 5
        )
        return json.loads(run(*arguments, *more, "--json"))["summary"]["mean"]

    assert mean("--rules", cart_rules) > 5 * mean()


def test_evaluate_projects_as_told(run, tmp_path):
    rules = tmp_path / "rules.json"
    run("mine", PENDULUM, "--support", 0, "--confidence", 0.9, "--divider", 3, "--out", rules)
    means = {
        json.loads(
            run(
                "evaluate",
                "--env",
                "Pendulum-v1",
                "--agent",
                "novice",
                "--rules",
                rules,
                "--episodes",
                1,
                "--projection",
                projection,
                "--json",
            )
        )["summary"]["mean"]
        for projection in ("centre", "clip", "expert")
    }
    assert len(means) == 3


def test_evaluate_samples_a_trained_agent_only_when_told(run):
    def evaluate(*more):
        return run(
            "evaluate",
            "--env",
            "Pendulum-v1",
            "--agent",
            "expert",
            "--episodes",
            1,
            "--json",
            *more,
        )

    assert evaluate() == evaluate()
    assert evaluate() != evaluate("--stochastic")


def test_render_side_by_side_as_gif(run, cart_rules, tmp_path):
    path = tmp_path / "replay.gif"
    arguments = (
        "render",
        "--env",
        "CartPole-v1",
        "--agent",
        "novice",
        "--rules",
        cart_rules,
        "--seed",
        1,
        "--max-steps",
        60,
        "--out",
        path,
    )
    alone = json.loads(run(*arguments, "--json"))
    with Image.open(path) as picture:
        width = picture.width
    both = json.loads(run(*arguments, "--side-by-side", "--json"))
    assert [episode["shielded"] for episode in both["episodes"]] == [True, False]
    assert both["episodes"][0] == alone["episodes"][0]
    with Image.open(path) as picture:
        assert picture.is_animated
        assert picture.width > 1.8 * width
        milliseconds = 0
        for frame in range(picture.n_frames):
            picture.seek(frame)
            milliseconds += picture.info["duration"]
    assert milliseconds == pytest.approx(1000 * both["seconds"], abs=30)


def test_render_agrees_with_evaluate(run, cart_rules, tmp_path):
    arguments = ("--env", "CartPole-v1", "--agent", "novice", "--rules", cart_rules, "--seed", 5)
    arguments += ("--max-steps", 60)
    rendered = json.loads(run("render", *arguments, "--out", tmp_path / "r.gif", "--json"))
    evaluated = json.loads(run("evaluate", *arguments, "--episodes", 1, "--json"))["episodes"][0]
    assert {name: rendered["episodes"][0][name] for name in evaluated} == evaluated


def test_render_as_mp4(run, tmp_path):
    path = tmp_path / "replay.mp4"
    text = run("render", "--env", "CartPole-v1", "--agent", "novice", "--out", path)
    assert path.read_bytes()[4:8] == b"ftyp"
    assert "novice" in text


def test_train_expert_writes_a_policy_that_evaluate_takes(run, tmp_path):
    path = tmp_path / "expert.npz"
    text = run("train-expert", "--env", "CartPole-v1", "--steps", 1024, "--out", path)
    assert "mean return" in text
    assert MlpPolicy.load(path).env_id == "CartPole-v1"
    card = json.loads(path.with_suffix(".json").read_text())
    assert card["steps"] == 1024
    # The command makes this file again, wherever it lies.
    assert card["command"].endswith(f"--seed 0 --steps 1024 --out {path.as_posix()}")
    run("evaluate", "--env", "CartPole-v1", "--agent", path, "--episodes", 1)


def test_outside_their_data_rules_act_or_abstain(run, tmp_path):
    rules = tmp_path / "rules.json"
    shown = ROOT / "data" / "demonstrations" / "cartpole.parquet"
    run("mine", shown, "--support", 0, "--confidence", 1, "--out", rules)
    arguments = ("--env", "CartPole-v1", "--agent", "novice", "--rules", rules, "--seed", 100_000)
    summaries = {}
    for outside in ("act", "abstain"):
        evaluate = ("evaluate", *arguments, "--episodes", 3, "--outside", outside)
        summaries[outside] = json.loads(run(*evaluate, "--json"))["summary"]
        assert 0 < summaries[outside]["outside_rate"] < 1
        text = run(*evaluate)
        assert "interventions outside the data" in text
        assert ("left as it is" in " ".join(text.split())) == (outside == "abstain")
    assert summaries["act"] != summaries["abstain"]
    assert (
        json.loads(run("evaluate", *arguments, "--episodes", 3, "--json"))["summary"]
        == (summaries["act"])
    )
    picture = ("render", *arguments, "--out", tmp_path / "r.gif", "--outside", "abstain", "--json")
    one = json.loads(run(*picture))["episodes"][0]
    alike = ("evaluate", *arguments, "--episodes", 1, "--outside", "abstain", "--json")
    assert {name: one[name] for name in ("return", "interventions")} == {
        name: json.loads(run(*alike))["episodes"][0][name] for name in ("return", "interventions")
    }


def test_a_rule_file_without_data_boxes_says_so(run, cart_rules, tmp_path, capsys):
    from sarl_core.cli.app import main

    document = json.loads(Path(cart_rules).read_text())
    for rule in document["rules"]:
        rule.pop("box", None)
    old = tmp_path / "old.json"
    old.write_text(json.dumps(document))
    arguments = ("evaluate", "--env", "CartPole-v1", "--agent", "novice", "--rules", str(old))
    assert "keeps no data boxes" in " ".join(run(*arguments, "--episodes", 1).split())
    assert main([*arguments, "--outside", "abstain"]) == 2
    assert "this rule file keeps no data boxes" in capsys.readouterr().err
