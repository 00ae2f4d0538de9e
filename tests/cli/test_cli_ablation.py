"""The command that takes rules out one by one."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import pytest

from sarl_core import RuleSet, Shield
from sarl_core.cli.app import main
from sarl_core.studies.ablation_run import ablate


@pytest.fixture(scope="module")
def few_rules(tmp_path_factory, cart_rules):
    """The largest rules of the set, so that there is little to run."""
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
    rules = RuleSet.load(few_rules)
    off = replace(rules, rules=tuple(replace(rule, enabled=False) for rule in rules.rules))
    for name, kept in (("off", off), ("empty", replace(rules, rules=()))):
        kept.save(tmp_path / f"{name}.json")
        assert main(list(arguments(tmp_path / f"{name}.json"))) == 2
        assert "no rule in force" in capsys.readouterr().err


def test_cut_episodes_and_the_order_of_features_are_told(run, few_rules, tmp_path):
    rules = RuleSet.load(few_rules)
    turned = replace(
        rules,
        rules=tuple(
            replace(
                rule,
                box=None,
                conditions=tuple(one._replace(feature=3 - one.feature) for one in rule.conditions),
            )
            for rule in rules.rules
        ),
        source=replace(rules.source, features=rules.source.features[::-1]),
    )
    path = tmp_path / "turned.json"
    turned.save(path)
    as_it_is, other = (
        json.loads(run(*arguments(one, "--max-steps", "12", "--json"))) for one in (few_rules, path)
    )
    assert as_it_is["rules"] == other["rules"]
    assert "by their names" in other["notes"][0]
    assert other["notes"][1:] == as_it_is["notes"]
    whole = json.loads(run(*arguments(few_rules, "--json")))
    assert whole["notes"] == []
    assert as_it_is["mean_return"] == 12.0
    assert as_it_is["notes"][0].startswith("all 3 episodes were cut off after 12 steps")
    for row in as_it_is["rules"]:
        assert row["cut_with"] == 3
        assert row["cut_without"] + row["failures_without"] == 3
        assert row["failure_p"] == 1.0
    text = " ".join(run(*arguments(path, "--max-steps", "12")).split())
    for note in other["notes"]:
        assert f"note: {note}" in text


def test_side_by_side_in_processes_the_limit_is_the_same(few_rules):
    shield = Shield(RuleSet.load(few_rules))
    one, two = (
        ablate(
            "CartPole-v1", "novice", shield, episodes=6, seed=20, max_steps=15, jobs=jobs
        ).to_frame()
        for jobs in (1, 2)
    )
    assert one.equals(two)
    assert one["cut_with"].max() > 0
