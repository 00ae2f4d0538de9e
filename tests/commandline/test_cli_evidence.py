"""`mine` with episodes held out, and what `check` says of contradictions."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sarl_core import Demonstrations, RuleSet, load_demonstrations, save_demonstrations
from sarl_core.cli import main
from sarl_core.mining.holding_out import hold_out
from tests.commandline.conftest import CART

MINE = ("mine", CART, "--support", "0.005", "--confidence", "0.95", "--hold-out", "0.2")


def test_mine_tries_the_rules_on_held_out_episodes(run, tmp_path):
    path = tmp_path / "rules.json"
    text = run(*MINE, "--seed", "4", "--out", path)
    assert "6 episodes of 30" in text
    assert "(seed 4)" in text
    rules = RuleSet.load(path)
    split = hold_out(load_demonstrations(CART), 0.2, seed=4)
    assert rules.source.steps == len(split.mined)
    for rule in rules.rules:
        applies = rule.applies(split.held_out.observations)
        right = split.held_out.actions[applies] == rule.action
        assert rule.held_out == (applies.sum(), right.sum())
    most = max(rules.rules, key=lambda rule: rule.samples)
    assert f" of {most.samples:,}, held out " in text


def test_the_json_sums_what_the_rule_file_holds(run, tmp_path):
    path = tmp_path / "rules.json"
    document = json.loads(run(*MINE, "--json", "--out", path))["held_out"]
    tried = [rule.held_out for rule in RuleSet.load(path).rules]
    assert document["samples"] == sum(one.samples for one in tried)
    assert document["correct"] == sum(one.correct for one in tried)
    assert document["seed"] == 0
    assert len(document["episodes"]) == 6
    assert document["interval"][0] < document["fidelity"] < document["interval"][1]


def test_the_lower_bound_keeps_the_rules_that_are_certain(run, tmp_path):
    path = tmp_path / "rules.json"
    everything = json.loads(run(*MINE, "--json", "--out", path))
    some = json.loads(run(*MINE, "--lower-bound", "0.9", "--json", "--out", path))
    assert 0 < some["rules"] < everything["rules"]
    assert some["rules"] == len(RuleSet.load(path))
    none = run(*MINE, "--lower-bound", "1", "--out", path)
    assert "No rule reaches these thresholds and lower bound" in none


@pytest.mark.parametrize("share", ["0", "1", "0.99", "-1"])
def test_a_share_that_leaves_no_episode_is_one_line(share, tmp_path, capsys):
    path = tmp_path / "rules.json"
    assert main([*MINE[:-1], share, "--out", str(path)]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ")
    assert "held-out share" in told
    assert told.count("\n") == 1
    assert not path.exists()


def test_check_counts_states_shown_with_another_action(run, tmp_path):
    path = tmp_path / "few.csv"
    states = np.array([[0.0], [0.0], [1.0], [2.0], [2.0]])
    save_demonstrations(Demonstrations(states, np.array([0, 1, 1, 1, 1]), np.zeros(5, int)), path)
    assert json.loads(run("check", path, "--json"))["contradictions"] == 2
    assert "2 states were shown with another action too" in run("check", path)
