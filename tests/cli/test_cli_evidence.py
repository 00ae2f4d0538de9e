"""`mine` with episodes held out, and what `check` says of contradictions."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sarl_core import (
    Demonstrations,
    RuleSet,
    load_demonstrations,
    mine_rules,
    save_demonstrations,
)
from sarl_core.cli.app import main
from sarl_core.mining.language import share_text
from sarl_core.mining.validation.cross_fitting import cross_fit
from sarl_core.mining.validation.holding_out import hold_out, with_held_out
from tests.cli.conftest import CART

LANDER = CART.replace("cartpole", "lunar_lander")

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
        assert rule.held_out[:2] == (applies.sum(), right.sum())
        assert rule.held_out.episodes == len(set(split.held_out.episodes[applies].tolist()))
    most = max(rules.rules, key=lambda rule: rule.samples)
    assert f" of {most.samples:,} states; held out: " in text
    assert f" in {most.held_out.episodes} episodes (" in text


def test_the_json_sums_what_the_rule_file_holds(run, tmp_path):
    path = tmp_path / "rules.json"
    document = json.loads(run(*MINE, "--json", "--out", path))["held_out"]
    tried = [rule.held_out for rule in RuleSet.load(path).rules]
    assert document["samples"] == sum(one.samples for one in tried)
    assert document["correct"] == sum(one.correct for one in tried)
    split = hold_out(load_demonstrations(CART), 0.2)
    shares = []
    for episode in document["episodes"]:
        some = split.held_out.select([episode])
        applies = [rule.applies(some.observations) for rule in RuleSet.load(path).rules]
        right = [
            some.actions[rows] == rule.action
            for rows, rule in zip(applies, RuleSet.load(path).rules, strict=True)
        ]
        shares.append(sum(one.sum() for one in right) / sum(one.sum() for one in applies))
    assert document["fidelity"] == pytest.approx(np.mean(shares))
    verdicts = [document[f"rules_{name}"] for name in ("below", "open", "reached", "unknown")]
    assert sum(verdicts) == len(tried)
    assert document["seed"] == 0
    assert len(document["episodes"]) == 6
    assert document["interval"][0] < document["fidelity"] < document["interval"][1]


def test_the_lower_bound_keeps_the_rules_that_are_certain(run, tmp_path):
    path = tmp_path / "rules.json"
    everything = json.loads(run(*MINE, "--json", "--out", path))
    bounds = sorted({rule.held_out.low or 0.0 for rule in RuleSet.load(path).rules})
    some = json.loads(run(*MINE, "--lower-bound", str(bounds[-1]), "--json", "--out", path))
    assert 0 < some["rules"] < everything["rules"]
    assert some["rules"] == len(RuleSet.load(path))
    assert {rule.held_out.low for rule in RuleSet.load(path).rules} == {bounds[-1]}
    none = run(*MINE, "--lower-bound", "1", "--out", path)
    assert "No rule reaches the lower bound: 6 held-out episodes can show at most 75.4 %" in none
    assert len(RuleSet.load(path)) == 0


def test_where_the_lower_bound_leaves_nothing_the_reason_is_told(run, tmp_path):
    path = tmp_path / "rules.json"
    split = hold_out(load_demonstrations(LANDER), 0.2)
    tried = with_held_out(mine_rules(split.mined, supp_min=0.005, conf_min=0.95), split.held_out)
    best = max(rule.held_out.low or 0.0 for rule in tried.rules)
    mine = ("mine", LANDER, "--setting", "filtered", "--hold-out", "0.2", "--out", path)
    told = " ".join(run(*mine, "--lower-bound", "0.9").split())
    assert f"0 of {len(tried)} rules reach 90 %; {len(tried)} were met in too few" in told
    assert "12 held-out episodes can show at most 87.8 %" in told
    assert "hold out at least 15 of the 62 (--hold-out 0.25)" in told
    document = json.loads(run(*mine, "--lower-bound", "0.9", "--json"))["held_out"]["lower_bound"]
    assert document.pop("most_possible") == pytest.approx(0.8777, abs=1e-4)
    (warning,) = document.pop("warnings")
    assert warning in told
    assert document == {
        "least": 0.9,
        "rules": len(tried),
        "kept": 0,
        "too_few_episodes": len(tried),
        "too_often_wrong": 0,
        "highest": best,
    }
    least = told.rsplit("--lower-bound ", 1)[1].split(")")[0]
    kept = run(*mine, "--lower-bound", least)
    assert len(RuleSet.load(path)) >= 1
    assert "No rule reaches" not in kept
    more = run(*mine[:5], "0.25", *mine[6:], "--lower-bound", "0.9")
    assert "held-out episodes can show at most" not in more


def test_where_thresholds_leave_nothing_the_lower_bound_is_not_blamed(run, tmp_path):
    path = tmp_path / "rules.json"
    mine = ("mine", CART, "--support", "0.9", "--confidence", "1", "--hold-out", "0.2")
    told = run(*mine, "--lower-bound", "0.9", "--out", path)
    assert "No rule reaches these thresholds; lower one of them." in told


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


def test_a_lower_bound_needs_other_episodes(tmp_path, capsys):
    path = tmp_path / "rules.json"
    assert main([*map(str, MINE[:6]), "--lower-bound", "0.9", "--out", str(path)]) == 2
    assert "give --hold-out as well" in capsys.readouterr().err
    assert not path.exists()


def test_rules_are_cross_fitted_where_that_is_asked(run, tmp_path):
    path = tmp_path / "rules.json"
    plain = run(*MINE[:6], "--out", path)
    assert "flatters; --cross-fit says what they are elsewhere" in plain
    told = run(*MINE[:6], "--cross-fit", "--out", path)
    assert "every episode judged by rules mined without it, in 10 parts" in told
    document = json.loads(run(*MINE[:6], "--cross-fit", "--json", "--out", path))
    found = document["cross_fitted"]
    expected = cross_fit(load_demonstrations(CART)).at(RuleSet.load(path).thresholds)
    assert found["fidelity"] == expected.fidelity._asdict()
    assert found["coverage"] == expected.coverage._asdict()
    assert found["episodes"] == 30
    assert f"{share_text(expected.fidelity.share)} (" in told
    assert found["warnings"] == []


@pytest.mark.parametrize("episodes", [20, 1])
def test_random_labels_end_with_a_warning(episodes, run, tmp_path):
    """Every rule is right about what it was mined from, and none about anything else."""
    path, out = tmp_path / "noise.csv", tmp_path / "rules.json"
    rng = np.random.default_rng(0)
    noise = Demonstrations(
        rng.normal(size=(2_000, 3)).astype(np.float32),
        rng.integers(0, 2, 2_000),
        np.arange(2_000) * episodes // 2_000,
    )
    save_demonstrations(noise, path)
    told = run("mine", path, "--setting", "unfiltered", "--cross-fit", "--out", out)
    assert "fidelity            100 %" in told
    assert "warning: The rules are right in 100 % of the states they were mined from, and" in told
    document = json.loads(
        run("mine", path, "--setting", "unfiltered", "--cross-fit", "--json", "--out", out)
    )["cross_fitted"]
    assert document["fidelity"]["share"] == pytest.approx(0.5, abs=0.05)
    assert document["whole_episodes"] is (episodes > 1)
    assert (document["fidelity"]["low"] is None) is (episodes == 1)
    assert len(document["warnings"]) == 1
