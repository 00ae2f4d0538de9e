"""Rules that forbid, on the command line: mined, held by a shield, and made of probes."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from sarl_core import RuleSet, load_demonstrations
from sarl_core.cli.app import main
from sarl_core.explaining.words.evidence import verdict_counts
from sarl_core.mining.never.never_rules import never_thresholds
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.validation.cross_fitting import judge_pairs
from sarl_core.mining.validation.holding_out import hold_out

LANDER = "data/demonstrations/lunar_lander.parquet"
CART = "data/demonstrations/cartpole.parquet"


@pytest.fixture
def typed(capsys):
    """Run a command line, and give its code and what it printed."""

    def call(*arguments: str) -> tuple[int, str, str]:
        code = main(list(arguments))
        printed = capsys.readouterr()
        return code, printed.out, printed.err

    return call


def test_rules_that_forbid_alone(typed, tmp_path):
    out = tmp_path / "never.json"
    code, told, _ = typed("mine", LANDER, "--never", "0.1", "--support", "0.002", "--out", str(out))
    assert code == 0
    rules = RuleSet.load(out)
    assert len(rules) == 52
    assert all(rule.forbids for rule in rules)
    assert "of the choice is left there" in told
    assert "then never do nothing: the expert did not in 97.5 % of 9,682 states." in told


def test_rules_that_forbid_behind_rules_that_demand(typed, tmp_path):
    out = tmp_path / "both.json"
    arguments = ("--setting", "filtered", "--never", "0.1", "--out", str(out), "--json")
    code, told, _ = typed("mine", CART, *arguments)
    assert code == 0
    document = json.loads(told)
    kinds = [rule.kind for rule in RuleSet.load(out)]
    assert kinds == sorted(kinds)
    assert {*kinds} == {"do", "never"}
    assert document["thresholds"]["never"] == 0.1
    assert 0 < document["freedom"] < 1
    assert 0 < document["coverage"] <= 1


def test_each_kind_is_held_against_its_own_share_in_other_episodes(typed, tmp_path):
    out = tmp_path / "both.json"
    options = ("--setting", "filtered", "--never", "0.1", "--hold-out", "0.3", "--out", str(out))
    code, told, _ = typed("mine", LANDER, *options, "--json")
    assert code == 0
    rules, held_out = RuleSet.load(out), json.loads(told)["held_out"]
    parted = [
        verdict_counts([rule for rule in rules if rule.kind == kind], at)
        for kind, at in (
            ("do", Thresholds(0.005, 0.95)),
            ("never", never_thresholds(0.1)),
        )
    ]
    assert all(sum(one.values()) for one in parted)
    for name, count in verdict_counts(rules.rules, rules.thresholds).items():
        assert held_out[f"rules_{name}"] == count == sum(one[name] for one in parted)
    split = hold_out(load_demonstrations(LANDER), 0.3)
    assert held_out["fidelity"] == judge_pairs(rules, split.held_out).fidelity.share


def test_what_is_left_to_an_agent_is_told(typed, tmp_path):
    out = tmp_path / "never.json"
    assert typed("mine", LANDER, "--never", "0.1", "--support", "0.01", "--out", str(out))[0] == 0
    arguments = ("--env", "LunarLander-v3", "--agent", "novice", "--rules", str(out), "--json")
    code, told, _ = typed("evaluate", *arguments, "--episodes", "5", "--seed", "3")
    assert code == 0
    assert 0.2 < json.loads(told)["summary"]["freedom"] < 0.8


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--never", "0"), "above 0 and below 1"),
        (("--never", "1"), "above 0 and below 1"),
        (("--never", "0.1", "--confidence", "0.9"), "give both --support and --confidence"),
        (("--never", "0.1", "--hold-out", "2"), "the held-out share is 2"),
        (("--never", "0.1", "--lower-bound", "0.8"), "give --hold-out as well"),
        (("--never", "0.1", "--lift", "3"), "--lift is for rules that demand"),
        (
            ("--never", "0.1", "--cluster", "local:2", "--hold-out", "0.2", "--lower-bound", "0.8"),
            "--lower-bound is for rules that demand an action where steps are not in one memory",
        ),
    ],
)
def test_what_cannot_be_mined_is_one_sentence(typed, tmp_path, options, said):
    out = tmp_path / "never.json"
    code, told, error = typed("mine", CART, *options, "--out", str(out))
    assert (code, told) == (2, "")
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_other_episodes_say_how_often_they_hold(typed, tmp_path):
    out, read = tmp_path / "never.json", tmp_path / "never.md"
    arguments = ("mine", LANDER, "--never", "0.1", "--support", "0.01", "--hold-out", "0.3")
    code, told, _ = typed(*arguments, "--cross-fit", "--out", str(out))
    assert code == 0
    assert "; held out: 97.1 % in 19 episodes (2,992 states), 90 to 99.8 %." in told
    assert "1 reach 90 % with their whole interval, 15 open, 0 below it, 0 met" in told
    assert typed("export", str(out), "--out", str(read))[0] == 0
    assert "| did not in 97.1 % in 19 episodes (90 to 99.8 %) |" in read.read_text()
    code, told, _ = typed(*arguments, "--cross-fit", "--json", "--out", str(out))
    document = json.loads(told)
    assert document["cross_fitted"]["fidelity"]["low"] < document["fidelity"]
    assert document["cross_fitted"]["episodes"] == 43
    held_out = document["held_out"]
    verdicts = [held_out[f"rules_{one}"] for one in ("below", "open", "reached", "unknown")]
    assert sum(verdicts) == document["rules"]


def test_rules_that_forbid_are_dropped_below_a_lower_bound(typed, tmp_path):
    out = tmp_path / "never.json"
    arguments = ("mine", LANDER, "--never", "0.1", "--support", "0.01", "--hold-out", "0.3")
    options = ("--lower-bound", "0.8", "--out", str(out), "--json")
    code, told, _ = typed(*arguments, *options)
    assert code == 0
    rules = RuleSet.load(out)
    assert 0 < len(rules) == json.loads(told)["rules"] < 16
    assert all(rule.held_out is not None and rule.held_out.low >= 0.8 for rule in rules)
    assert json.loads(told)["freedom"] > 0.38  # of those that are left


@pytest.mark.parametrize("options", [("--support", "0.002"), ("--setting", "filtered")])
def test_they_are_held_against_a_log(typed, tmp_path, options):
    out, folder = tmp_path / "never.json", tmp_path / "audited"
    assert typed("mine", LANDER, *options, "--never", "0.1", "--out", str(out))[0] == 0
    code, told, _ = typed("audit", str(out), LANDER, "--out", str(folder), "--json")
    assert code == 0
    document = json.loads(told)
    rules = RuleSet.load(out)
    alone = all(rule.forbids for rule in rules)
    for rule, row in zip(rules, document["rules"], strict=True):
        if alone or not rule.forbids:
            assert (row["applies"], row["applies"] - row["broken"]) == (rule.samples, rule.correct)
        else:
            assert row["applies"] <= rule.samples
    assert document["drift"]["drifted"] == 0
    assert json.loads((folder / "audit.json").read_text()) == document
    assert "then never fire left engine" in (folder / "audit.html").read_text()
    steps = pd.read_csv(folder / "steps.csv")
    assert steps["broken"].sum() == document["broken"] > 0
    assert len(pd.read_csv(folder / "rules.csv")) == len(rules)


def test_they_are_compared_with_rules_that_demand(typed, tmp_path):
    never, demanding = tmp_path / "never.json", tmp_path / "demanding.json"
    assert typed("mine", CART, "--never", "0.1", "--out", str(never))[0] == 0
    assert typed("mine", CART, "--setting", "filtered", "--out", str(demanding))[0] == 0
    code, out, _ = typed("diff", str(never), str(never), "--demonstrations", CART)
    assert code == 0
    assert "decide none of" in out
    code, out, _ = typed("diff", str(never), str(demanding), "--demonstrations", CART, "--json")
    assert code == 0
    found = json.loads(out)
    assert all(rule["forbids"] for rule in found["removed"])
    # With two actions, to forbid one is to demand the other.
    assert found["dimensions"][0]["says"] == ["push left", "push right", None]
    assert 0 < found["states"]["different"] < found["states"]["count"]


def test_they_are_taken_out_one_by_one(typed, tmp_path):
    out = tmp_path / "never.json"
    assert typed("mine", CART, "--never", "0.1", "--support", "0.02", "--out", str(out))[0] == 0
    arguments = ("--env", "CartPole-v1", "--agent", "novice", "--rules", str(out), "--seed", "500")
    code, told, _ = typed("ablate", *arguments, "--episodes", "3", "--json")
    assert code == 0
    document = json.loads(told)
    ids = [rule["rule"] for rule in document["rules"]] + document["without_difference"]
    assert sorted(ids) == sorted(rule.id for rule in RuleSet.load(out))
    assert any(rule["steps_changed"] for rule in document["rules"])


def test_a_learner_chooses_from_what_they_leave(typed, tmp_path):
    rules, folder = "data/rules/lunar_lander_never.json", tmp_path / "learned"
    arguments = ("learn", "--env", "LunarLander-v3", "--rules", rules, "--steps", "2048", "--json")
    options = ("--arm", "mask", "--episodes", "1")
    code, told, _ = typed(*arguments, *options, "--out", str(folder))
    assert code == 0
    assert [arm["arm"] for arm in json.loads(told)["arms"]] == ["mask"]


def test_probes_leave_rules_and_a_card(typed, tmp_path):
    out = tmp_path / "never.json"
    options = ("--rounds", "2", "--episodes", "8", "--validation", "4", "--report-episodes", "4")
    arguments = ("probe", "--env", "CartPole-v1", *options, "--seed", "3", "--out", str(out))
    code, told, _ = typed(*arguments)
    assert code == 0
    assert f"Wrote {out}: " in told
    card = json.loads(Path(out).with_suffix(".card.json").read_text())
    assert card["command"].startswith("python -m sarl_core probe --env CartPole-v1 --out ")
    assert [one["number"] for one in card["rounds"]] == [1, 2]
    assert card["reported"]["episodes"] == 4
    rules = RuleSet.load(out)
    assert len(rules) == card["rules"]
    assert all(rule.origin == "probed" for rule in rules)
    assert json.loads(typed(*arguments, "--json")[1])["reported"] == card["reported"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--env", "Pendulum-v1"), "--failure"),
        (("--env", "CartPole-v1", "--risk", "0"), "the risk is 0.0"),
        (("--env", "CartPole-v1", "--risk", "1.5"), "the risk is 1.5"),
        (("--env", "CartPole-v1", "--leaves", "1"), "leaves"),
        (("--env", "CartPole-v1", "--episodes", "0"), "episodes"),
    ],
)
def test_what_cannot_be_probed_is_one_sentence(typed, tmp_path, options, said):
    out = tmp_path / "never.json"
    code, told, error = typed("probe", *options, "--out", str(out))
    assert (code, told) == (2, "")
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()
