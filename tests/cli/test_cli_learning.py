"""The command `learn`."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sarl_core.cli.app import main

ROOT = Path(__file__).resolve().parents[2]
BASE = ("learn", "--env", "CartPole-v1", "--steps", 400, "--episodes", 2)


def test_learn_writes_curves_results_and_policies_that_evaluate_takes(run, cart_rules, tmp_path):
    out = tmp_path / "learned"
    arguments = (*BASE, "--rules", cart_rules, "--arm", "none", "--arm", "imitate", "--out", out)
    document = json.loads(run(*arguments, "--json"))
    assert [arm["arm"] for arm in document["arms"]] == ["none", "imitate"]
    assert document["finding"]
    assert (out / "curves.csv").is_file()
    assert json.loads((out / "results.json").read_text())["steps"] == 400
    told = (out / "finding.md").read_text()
    assert all(paragraph in told for paragraph in document["finding"])
    assert "| Mask and imitate |" in told
    policy = out / "policies" / "imitate-0.npz"
    assert document["policies"][1] == str(policy)
    evaluated = json.loads(
        run(
            *("evaluate", "--env", "CartPole-v1", "--agent", policy, "--episodes", 2),
            *("--seed", 9_000_000, "--json"),
        )
    )
    assert evaluated["summary"]["mean"] == pytest.approx(document["arms"][1]["alone"]["mean"])
    text = run(*arguments)  # everything is there already
    assert "Way to" in text  # a narrow terminal breaks the heading
    assert "Mask and" in text
    assert f"Wrote 2 runs to {out}" in text


def test_without_rules_the_learner_alone_learns(run, tmp_path):
    document = json.loads(run(*BASE, "--arm", "none", "--out", tmp_path / "alone", "--json"))
    assert document["arms"][0]["shielded"] is None


def test_learners_are_compared_with_an_agent_of_the_callers_own(
    run, cart_rules, tmp_path, monkeypatch
):
    (tmp_path / "upright.py").write_text(
        "def push(observations):\n    return (observations[:, 2] > 0).astype(int)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    out = tmp_path / "learned"
    arguments = (*BASE, "--rules", cart_rules, "--arm", "none", "--out", out)
    document = json.loads(run(*arguments, "--agent", "upright:push", "--json"))
    compared = document["compared"]
    assert compared["agent"] == "upright:push"
    assert any("“upright:push” without the shield returns" in text for text in document["finding"])
    played = json.loads(
        run(
            *("evaluate", "--env", "CartPole-v1", "--agent", "upright:push", "--episodes", 2),
            *("--seed", 9_000_000, "--json"),
        )
    )
    assert compared["alone"]["mean"] == played["summary"]["mean"]
    assert json.loads((out / "results.json").read_text())["compared"]["agent"] == "upright:push"
    again = json.loads(run(*arguments, "--agent", "novice", "--json"))  # what was learned stays
    assert again["compared"]["agent"] == "novice"
    assert "compared" not in json.loads(run(*arguments, "--json"))


@pytest.mark.parametrize(
    ("more", "fragment"),
    [
        (("--steps", 0), "steps is 0"),
        (("--steps", -3), "steps is -3"),
        (("--arm", "unknown"), "no arm 'unknown'"),
        (("--arm", "override"), "no rules"),
        (("--env", "Nowhere-v1"), "Nowhere-v1"),
        (("--seeds", 0), "seeds"),
        (("--rules", "{other}"), "version 9"),
        (("--arm", "none", "--agent", "nowhere:agent"), "nowhere"),
        (("--rules", "{rules}", "--env", "LunarLander-v3"), "4 features"),
        (("--arm", "none", "--out", "{file}/x"), "cannot be made"),
    ],
)
def test_bad_input_is_one_line(capsys, cart_rules, tmp_path, more, fragment):
    (tmp_path / "file").write_text("")
    document = json.loads(cart_rules.read_text())
    (tmp_path / "other.json").write_text(json.dumps({**document, "version": 9}))
    names = {
        "rules": cart_rules,
        "other": tmp_path / "other.json",
        "file": tmp_path / "file",
    }
    given = [str(part).format(**names) for part in (*BASE, "--out", tmp_path / "out", *more)]
    assert main(given) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("error: ")
    assert printed.err.count("\n") == 1
    assert fragment in printed.err


def a_long_run(tmp_path: Path, *more: str) -> subprocess.Popen[bytes]:
    """`learn` in a process of its own, once it has begun."""
    process = subprocess.Popen(
        [
            *(sys.executable, "-m", "sarl_core", "learn", "--env", "CartPole-v1", "--arm", "none"),
            *("--steps", "5000000", "--out", str(tmp_path), *more),
        ],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    while not (tmp_path / "runs" / "none-0.json").exists():
        assert process.poll() is None, process.stderr
        time.sleep(0.1)
    return process


@pytest.mark.parametrize("way", ["interrupt", "terminate", "input"])
def test_a_stopped_study_is_kept_and_says_so(tmp_path, way):
    process = a_long_run(tmp_path, *(["--stop-with-input"] if way == "input" else []))
    if way == "input":
        assert process.stdin is not None
        process.stdin.close()
        process.stdin = None
    else:
        process.send_signal(signal.SIGINT if way == "interrupt" else signal.SIGTERM)
    out, error = process.communicate(timeout=120)
    assert process.returncode == 130
    assert out == b""
    assert error.decode().startswith("error: stopped; 0 of 1 runs are finished")
    assert error.count(b"\n") == 1
    assert (tmp_path / "runs" / "none-0.pt").is_file()
    kept = json.loads((tmp_path / "runs" / "none-0.json").read_text())
    assert kept["steps_done"] > 0
    assert not kept["alone"]
