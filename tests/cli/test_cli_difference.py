"""diff: what it prints, as text and as JSON, and what it refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sarl_core import RuleSet, Shield, load_demonstrations
from sarl_core.cli.app import main
from sarl_core.mining.editing.edits import Add, Pin, Switch, apply
from sarl_core.mining.editing.manual_rules import Ask, manual_rule
from tests.cli.conftest import CART, ROOT


@pytest.fixture
def files(cart_rules, tmp_path):
    """Mined rules, and the same with three edits."""
    mined = RuleSet.load(cart_rules)
    hand = manual_rule(mined, [Ask("pole angle", ">", 0.01)], rule_id="manual.1", action=0)
    edited = apply(mined, [Switch(mined.rules[0].id, False), Pin(mined.rules[1]), Add(hand)])
    edited.save(tmp_path / "edited.json")
    return cart_rules, tmp_path / "edited.json"


def different(files, states):
    said = []
    for path in files:
        rules = RuleSet.load(path)
        found = Shield(rules).decide_batch(states, np.zeros(len(states), dtype=int)).rules[:, 0]
        said.append([rules.rules[at].action if at >= 0 else None for at in found])
    return sum(one != other for one, other in zip(*said, strict=True))


def test_edits_are_found_and_counted_on_a_file(run, files):
    mined = RuleSet.load(files[0])
    printed = json.loads(run("diff", *files, "--demonstrations", CART, "--json"))
    states = load_demonstrations(CART).observations
    assert printed["states"]["different"] == different(files, states)
    assert printed["states"]["count"] == len(states)
    assert printed["states"]["from"] == CART
    assert [rule["id"] for rule in printed["added"]] == ["manual.1"]
    assert printed["added"][0]["origin"] == "manual"
    assert printed["removed"] == []
    assert {change["before"]["id"]: change["what"] for change in printed["changed"]} == {
        mined.rules[0].id: ["switched"],
        mined.rules[1].id: ["place"],
    }
    assert printed["same"] == len(mined) - 2
    (dimension,) = printed["dimensions"]
    assert sum(map(sum, dimension["confusion"])) == len(states)
    assert dimension["different"] == printed["states"]["different"]
    assert dimension["says"] == ["push left", "push right", None]


def test_without_demonstrations_the_states_are_random_and_the_same_every_time(run, files):
    text = run("diff", *files)
    assert "10,000 random ones over the range of the thresholds" in text
    assert "Added:" in text
    last = len(RuleSet.load(files[1]))  # what a person wrote is numbered after the mined rules
    assert f"R{last}: If the pole angle is above 0.01 rad, then push left." in text
    assert "switched off" in text
    assert "pinned" in text
    assert text == run("diff", *files)
    assert json.loads(run("diff", *files, "--json"))["states"]["count"] == 10_000


def test_long_lists_are_cut_in_the_text_and_whole_in_json(run, cart_rules, tmp_path):
    fine = tmp_path / "fine.json"
    run("mine", CART, "--setting", "unfiltered", "--out", fine)
    text = run("diff", cart_rules, fine, "--demonstrations", CART)
    assert "more; --json lists them all" in text
    printed = json.loads(run("diff", cart_rules, fine, "--json"))
    assert len(printed["added"]) + len(printed["changed"]) + printed["same"] == len(
        RuleSet.load(fine)
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "A.json"),
        (("missing.json", "missing.json"), "missing.json"),
        ((CART, CART), "not JSON"),
    ],
)
def test_what_is_no_rule_file_is_refused(capsys, arguments, words):
    assert main(["diff", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert words.lower() in printed.err.lower()


def test_rules_or_states_of_something_else_are_refused_in_one_line(capsys, cart_rules):
    lander = str(ROOT / "data" / "rules" / "lunar_lander_compact.json")
    assert main(["diff", str(cart_rules), lander]) == 2
    assert "different features" in capsys.readouterr().err
    pendulum = str(ROOT / "data" / "demonstrations" / "pendulum.parquet")
    rules = str(cart_rules)
    assert main(["diff", rules, rules, "--demonstrations", pendulum]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert "4 features and the states have 3" in printed.err
