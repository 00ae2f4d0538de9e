"""Beside every return stands how often it failed, and what the rules left to choose from."""

import json

import numpy as np
import pytest
from scipy.stats import binomtest

from sarl_core import Environment, Shield, load_demonstrations, mine_rules, record, rollout
from sarl_core.cli.app import main
from tests.cli.conftest import CART, ROOT

LANDER = ["evaluate", "--env", "LunarLander-v3", "--agent", "novice", "--episodes", "6"]


def evaluated(capsys, *arguments: str):
    assert main([*LANDER, "--seed", "5", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_failures_stand_with_their_exact_interval(capsys):
    document = evaluated(capsys)
    summary, episodes = document["summary"], document["episodes"]
    count = sum(episode["failed"] for episode in episodes)
    exact = binomtest(count, 6).proportion_ci(method="exact")
    assert summary["failures"] == count > 0
    assert summary["failure_rate"] == count / 6
    assert (summary["failure_low"], summary["failure_high"]) == pytest.approx(
        (exact.low, exact.high)
    )
    assert summary["freedom"] == 1.0
    assert main([*LANDER, "--seed", "5"]) == 0
    assert f"{count} of 6 episodes" in capsys.readouterr().out


def test_rules_that_cover_every_state_are_called_a_policy(capsys):
    rules = ["--rules", str(ROOT / "data" / "rules" / "lunar_lander_compact.json")]
    summary = evaluated(capsys, *rules)["summary"]
    assert summary["freedom"] == 0.0
    assert summary["intervention_rate"] > 0.5
    assert main([*LANDER, *rules]) == 0
    assert "this is a policy and no longer a shield" in capsys.readouterr().out


def test_freedom_is_the_share_of_dimensions_without_a_rule():
    walker = load_demonstrations(ROOT / "data" / "demonstrations" / "bipedal_walker.parquet")
    rules = mine_rules(walker, supp_min=0.02, conf_min=0.9)
    found = rollout("BipedalWalker-v3", "novice", shield=Shield(rules), episodes=2, seed=3)
    free = (found.steps.rules < 0).mean()
    assert 0 < free < 1
    assert found.summary()["freedom"] == pytest.approx(free)


def test_rules_that_abstain_leave_all_to_the_agent():
    rules = mine_rules(load_demonstrations(CART), supp_min=0.0, conf_min=1.0)
    act, abstain = Shield(rules), Shield(rules, outside="abstain")
    states = np.array([[0.0, 0.0, 0.0, 0.0], [90.0, 9.0, 9.0, 9.0]], dtype=np.float32)
    in_force = act.decide_batch(states, [0, 0]).rules
    assert (in_force >= 0).all()
    assert act.freedom(states, in_force).tolist() == [0.0, 0.0]
    assert abstain.freedom(states, in_force)[1] == 1.0


def test_a_failure_and_a_cost_are_named_on_the_command_line(capsys):
    cart = ["evaluate", "--env", "CartPole-v1", "--agent", "novice", "--episodes", "6", "--json"]
    named = ["--failure", "abs(pole angle) > 0.1", "--cost", "pole angle > 0"]
    assert main([*cart, *named]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["summary"]["failures"] == sum(one["failed"] for one in document["episodes"])
    costs = [one["cost"] for one in document["episodes"]]
    assert document["summary"]["cost"] == pytest.approx(np.mean(costs))
    assert document["summary"]["cost_low"] < np.mean(costs) < document["summary"]["cost_high"]
    for options, says in (
        (["--failure", "crashd"], "has 'crashd' in its info, which is empty"),
        (["--failure", "pole angel > 1"], "did you mean 'pole angle'"),
        (["--cost", " "], "--cost is empty"),
    ):
        assert main([*cart, *options]) == 2
        assert says in capsys.readouterr().err


def test_recordings_say_what_failed_in_them_where_it_is_named():
    environment = Environment("CartPole-v1", failure="abs(pole angle) > 0.1")
    recorded = record(environment, "novice", steps=100)
    assert recorded.notes[0].startswith("failures while recording: ")
    assert not record("CartPole-v1", "novice", steps=100).notes
