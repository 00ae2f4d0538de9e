"""The command that takes rules out one by one."""

from __future__ import annotations

import csv
import json

import pytest

from sarl_core import RuleSet, Shield
from sarl_core.cli import main
from sarl_core.rollouts.ablating import ablate


@pytest.fixture(scope="module")
def few_rules(tmp_path_factory, cart_rules):
    """The largest rules of the set, so that there is little to run."""
    from dataclasses import replace

    rules = RuleSet.load(cart_rules)
    largest = sorted(rules.rules, key=lambda rule: -rule.samples)[:4]
    path = tmp_path_factory.mktemp("few") / "rules.json"
    replace(rules, rules=tuple(largest)).save(path)
    return path


def arguments(rules, *more):
    return (
        *("ablate", "--env", "CartPole-v1", "--agent", "novice", "--rules", str(rules)),
        *("--episodes", "3", "--seed", "20", *more),
    )


def test_ablate_says_what_the_library_says(run, few_rules, tmp_path):
    out = tmp_path / "ablation.csv"
    document = json.loads(run(*arguments(few_rules, "--json", "--out", str(out))))
    found = ablate("CartPole-v1", "novice", Shield(RuleSet.load(few_rules)), episodes=3, seed=20)
    assert [row["rule"] for row in document["rules"]] == found.to_frame()["rule"].tolist()
    assert document["mean_return"] == found.base.returns.mean()
    assert document["failures"] == found.base_failures
    assert document["episodes_run"] == found.played
    differences = [row["return_difference"] for row in document["rules"]]
    assert differences == found.to_frame()["return_difference"].tolist()
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [float(row["return_difference"]) for row in rows] == differences
    text = run(*arguments(few_rules))
    assert "load-bearing" in text
    names = RuleSet.load(few_rules).names
    assert all(f"{names[row['rule']]} " in text for row in document["rules"])


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--episodes", "1"), "episodes is 1"),
        (("--most", "0"), "most is 0"),
        (("--out", "ablation.txt"), "must end in .csv"),
        (("--env", "LunarLander-v3"), "use rules of this environment"),
    ],
)
def test_what_cannot_be_run_is_one_line(capsys, few_rules, more, words):
    assert main([*arguments(few_rules), *more]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert words in error
    assert error.count("\n") == 1


def test_where_no_rule_is_in_force_nothing_is_run(capsys, few_rules, tmp_path):
    from dataclasses import replace

    rules = RuleSet.load(few_rules)
    off = replace(rules, rules=tuple(replace(rule, enabled=False) for rule in rules.rules))
    for name, kept in (("off", off), ("empty", replace(rules, rules=()))):
        kept.save(tmp_path / f"{name}.json")
        assert main(list(arguments(tmp_path / f"{name}.json"))) == 2
        assert "no rule in force" in capsys.readouterr().err
