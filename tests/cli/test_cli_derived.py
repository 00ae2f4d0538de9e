"""Combinations and formulas, as they are typed."""

from __future__ import annotations

import html
import json

import pytest

from sarl_core import RuleSet, load_demonstrations
from sarl_core.cli.app import main
from sarl_core.cli.options import with_bare_combine
from sarl_core.demonstrations.dataset import (
    derived_features,
    formula_feature,
    with_formulas,
)
from sarl_core.demonstrations.derived import Combination
from sarl_core.demonstrations.formats import save_demonstrations
from sarl_core.environments.formulas import Formula
from tests.cli.conftest import CART, ROOT

LUNAR = str(ROOT / "data" / "demonstrations" / "lunar_lander.parquet")
LEAVE = "leave [1/s] = cart_velocity / max(abs(cart position), 0.1)"


def derived_of(path):
    return [one for one in RuleSet.load(path).source.features if one.derived is not None]


def test_combine_alone_is_of_every_pair(run, tmp_path):
    out = tmp_path / "rules.json"
    printed = run("mine", "--combine", CART, "--setting", "filtered", "--out", out)
    assert "plus" in printed
    pairs = {one.derived.features for one in derived_of(out)}
    assert {(2, 3), (0, 1)} <= pairs
    assert json.loads(out.read_text())["version"] == 2


def test_pairs_that_are_named_are_combined_alone(run, tmp_path):
    out = tmp_path / "rules.json"
    arguments = ("--combine", "pole angle, pole_angular_velocity", "--feature", LEAVE)
    run("mine", CART, *arguments, "--setting", "filtered", "--out", out)
    derived = derived_of(out)
    assert isinstance(derived[0].derived, Formula)
    assert (derived[0].name, derived[0].unit) == ("leave", "1/s")
    assert {one.derived.features for one in derived[1:]} == {(2, 3)}
    assert all(isinstance(one.derived, Combination) for one in derived[1:])


def test_rules_with_combinations_are_played_audited_compared_and_exported(run, tmp_path):
    out, plain = tmp_path / "rules.json", tmp_path / "plain.json"
    thresholds = ("--support", 0.001, "--confidence", 0.9)
    run("mine", CART, "--combine", "--feature", LEAVE, *thresholds, "--out", out)
    run("mine", CART, *thresholds, "--out", plain)
    env = ("--env", "CartPole-v1", "--agent", "novice", "--episodes", 3, "--seed", 1)
    assert json.loads(run("evaluate", *env, "--rules", out, "--json"))["summary"]["mean"] > 100
    audit = json.loads(run("audit", out, CART, "--json"))
    assert audit["steps"] == 15_000
    assert audit["covered"] > 13_000
    assert json.loads(run("diff", out, plain, "--json"))["states"]["count"] == 10_000
    shared = json.loads(run("diff", out, plain, "--demonstrations", CART, "--json"))
    assert shared["states"]["count"] == 15_000
    assert "-ffp-contract=off" in written(run, out, tmp_path / "rules.c")
    rounded = written(run, out, tmp_path / "rules.md", "--rounded", "--demonstrations", CART)
    assert "plus" in rounded


def written(run, rules, path, *options):
    run("export", rules, "--out", path, *options)
    return path.read_text(encoding="utf-8")


def test_a_landscape_and_a_check_take_what_is_derived(run, tmp_path):
    out = tmp_path / "landscape.json"
    run("landscape", CART, "--combine", "--out", out)
    plain = tmp_path / "plain.json"
    run("landscape", CART, "--out", plain)
    assert json.loads(out.read_text()) != json.loads(plain.read_text())
    checked = json.loads(run("check", CART, "--feature", LEAVE, "--json"))
    assert [one["name"] for one in checked["features"]][-1] == "leave"


def test_aggregate_takes_what_is_derived(run, tmp_path):
    out = tmp_path / "compact.json"
    quick = ("--rounds", 1, "--episodes", 2, "--validation", 2, "--max-rules", 12)
    run("aggregate", CART, *quick, "--combine", "--feature", LEAVE, "--out", out)
    names = [one.name for one in derived_of(out)]
    assert names[0] == "leave"
    assert any("pole angle plus" in name for name in names)
    card = json.loads((tmp_path / "compact.card.json").read_text())
    assert ["cart position", "cart velocity"] in card["combined"]


def test_units_that_do_not_fit_are_warned_of(run):
    printed = run("check", CART, "--feature", "odd = cart position + pole angle")
    assert "'odd' adds m and rad" in printed


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--combine", "pole angle, speed"), "'speed' is no feature"),
        (("--combine", "pole angle, pole angle"), "combined with itself"),
        (("--combine", "pole angle"), "names one feature"),
        (("--combine", "pole angle;cart velocity"), "is no feature"),
        (("--combine", ""), "is no feature"),
        (("--feature", "a = pole angle / nothing"), "'nothing' (sign 14) is no feature"),
        (("--feature", "a = " + "+".join(["1"] * 251)), "more than 500"),
        (("--feature", "a = " + "(" * 51 + "1" + ")" * 51), "50 deep"),
        (("--feature", "a = pole angle ; 2"), "';' (sign 12) is not part of a formula"),
        (("--feature", "pole angle"), "is no feature; write its name"),
        (("--feature", "pole angle = 2"), "stands twice"),
        (("--feature", "a = 0 * pole angle / (0 * pole angle)"), "no value in 15,000 steps"),
        (("--feature", "a = pole angle > 0"), "is a condition and no number"),
    ],
)
def test_what_cannot_be_derived_is_refused_in_one_sentence(arguments, says, tmp_path, capsys):
    out = tmp_path / "rules.json"
    assert main(["mine", CART, *arguments, "--setting", "filtered", "--out", str(out)]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("error: ")
    assert printed.count("\n") == 1
    assert says in printed
    assert not out.exists()


def test_a_lone_option_has_a_value_unless_what_follows_is_an_option_or_a_file():
    assert with_bare_combine(["mine", "--combine", "a.csv"]) == ["mine", "--combine=*", "a.csv"]
    assert with_bare_combine(["--combine"]) == ["--combine=*"]
    assert with_bare_combine(["--combine", "pole angle"]) == ["--combine", "pole angle"]
    long = "; ".join(["hull angular velocity"] * 30)  # longer than a file's name can be
    assert with_bare_combine(["--combine", long]) == ["--combine", long]
    assert with_bare_combine(["--combine", "docs"]) == ["--combine=*", "docs"]
    named = ["mine", "a.csv", "--combine", "one, other", "--combine", "--out", "x"]
    assert with_bare_combine(named) == [*named[:4], "--combine=*", "--out", "x"]


def test_demonstrations_that_were_saved_with_formulas_keep_them(run, tmp_path):
    made = load_demonstrations(LUNAR)
    made = made.deriving([formula_feature("fall = vertical velocity * 2", made.observed)])
    save_demonstrations(made, tmp_path / "lunar.parquet")
    assert "fall = vertical velocity * 2" in run("check", tmp_path / "lunar.parquet")
    (told,) = json.loads(run("check", tmp_path / "lunar.parquet", "--json"))["formulas"]
    assert told == "fall = vertical velocity * 2"
    run("mine", tmp_path / "lunar.parquet", "--setting", "filtered", "--out", tmp_path / "r.json")
    assert [one.name for one in derived_of(tmp_path / "r.json")] == ["fall"]


def test_a_formula_of_the_file_gives_way_to_one_of_the_same_name(run, tmp_path):
    shown, rules, report = (tmp_path / name for name in ("cart.parquet", "r.json", "r.html"))
    made = with_formulas(
        load_demonstrations(CART), ["lean = pole angle * 2", "drift = -pole_angle"]
    )
    save_demonstrations(made, shown)
    changed = "lean = pole angle + 0.5 * pole angular velocity"
    run("mine", shown, "--feature", changed, "--setting", "filtered", "--out", rules)
    made_again = with_formulas(load_demonstrations(CART), [changed, "drift = -pole_angle"])
    assert derived_features(RuleSet.load(rules).source.features) == made_again.derived
    run("report", rules, "--demonstrations", shown, "--frames", 0, "--out", report)
    text = html.unescape(report.read_text(encoding="utf-8"))
    assert f"--feature '{changed}' --out {rules}" in text


def test_a_report_says_the_command_that_makes_its_rules_again(run, tmp_path):
    rules, report = tmp_path / "rules.json", tmp_path / "report.html"
    arguments = ("--combine", "pole angle, pole angular velocity", "--feature", LEAVE)
    run("mine", CART, *arguments, "--support", 0.05, "--confidence", 0.9, "--out", rules)
    run("report", rules, "--demonstrations", CART, "--frames", 0, "--out", report)
    text = html.unescape(report.read_text(encoding="utf-8"))
    again = f"--feature '{LEAVE}' --combine 'pole angle, pole angular velocity' --out {rules}"
    assert f"mine {CART} --support 0.05 --confidence 0.9 {again}" in text
    assert "plus" in text
