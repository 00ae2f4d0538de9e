"""`library:ID` gives what is kept with its names and formulas, and is called so in every answer."""

from __future__ import annotations

import json
import re
import shlex
import tempfile
from html import unescape

import pytest

from sarl_core import RuleSet, load_demonstrations
from sarl_core.cli.app import main
from sarl_core.demonstrations.dataset import formula_feature
from sarl_core.demonstrations.names import names_of
from sarl_core.library import Library
from sarl_core.library.annotations import formulas_details, names_details
from tests.cli.conftest import CART, ROOT

RULES = str(ROOT / "data" / "rules" / "cartpole_compact.json")
LEAN = "lean [rad] = 2 * pole angle"


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "library"))
    monkeypatch.setenv("SARL_AUTHOR", "Ada")
    return tmp_path / "library"


def kept(run, path):
    (item,) = json.loads(run("library", "import", path, "--json"))["items"]
    return f"library:{item['id']}"


@pytest.fixture
def named(run):
    """Demonstrations that somebody gave other names and a formula."""
    data = kept(run, CART)
    shown = load_demonstrations(CART)
    names = names_of(shown)._replace(
        features=("place", "speed", "tilt", "turning"), labels=(("west", "east"),)
    )
    details = {
        **names_details(names),
        **formulas_details([formula_feature(LEAN, shown.observed)]),
    }
    with Library() as library:
        library.annotate(data.removeprefix("library:"), details, author="Ada")
    return data


def test_names_and_formulas_reach_commands(run, named, tmp_path, place, monkeypatch):
    aside = tmp_path / "aside"
    aside.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(aside))
    checked = json.loads(run("check", named, "--json"))
    assert [one["name"] for one in checked["features"]] == [
        "place",
        "speed",
        "tilt",
        "turning",
        "lean",
    ]
    assert "lean" in json.dumps(checked["formulas"])
    assert run("check", named).startswith(f"{named}: ")
    out = tmp_path / "rules.json"
    run("mine", named, "--setting", "filtered", "--out", out)
    rules = RuleSet.load(out)
    assert [one.name for one in rules.source.features] == [
        "place",
        "speed",
        "tilt",
        "turning",
        "lean",
    ]
    assert rules.actions[0].label_names == ("west", "east")
    plain = tmp_path / "plain.json"
    run("mine", CART, "--feature", LEAN, "--setting", "filtered", "--out", plain)
    asked = [rule.conditions for rule in RuleSet.load(plain)]
    assert [rule.conditions for rule in rules] == asked
    (item,) = json.loads(run("library", "import", out, "--json"))["items"]
    assert item["came_from"] == [named.removeprefix("library:")]
    # Nothing is left of the file that was made for it.
    assert not list(aside.iterdir())
    assert len(list((place / "files").glob("*/*"))) == 2


def test_the_environment_is_still_the_rules_one(run, named, tmp_path):
    out = tmp_path / "rules.json"
    run("mine", named, "--env", "CartPole-v1", "--setting", "filtered", "--out", out)
    env = ("--env", "CartPole-v1", "--agent", "expert", "--episodes", 1, "--json")
    assert json.loads(run("evaluate", *env, "--rules", out))["summary"]["coverage"] > 0


def test_a_report_names_what_was_typed(run, named, tmp_path, place):
    out, again = tmp_path / "rules.json", tmp_path / "again.json"
    run("mine", named, "--setting", "filtered", "--out", out)
    rules, page = kept(run, out), tmp_path / "report.html"
    run("report", rules, "--demonstrations", named, "--frames", 0, "--out", page)
    html = unescape(page.read_text())
    assert str(place) not in html
    assert ".unfinished" not in html
    assert f"({named})" in html
    assert f"({rules})" in html
    mine, report = re.findall(r"python -m sarl_core .*", html)
    assert shlex.split(report)[3:6] == ["report", rules, "--demonstrations"]
    words = shlex.split(mine)[3:]
    assert words == ["mine", named, "--setting", "filtered", "--out", "rules.json"]
    run(*words[:-1], again)
    assert RuleSet.load(again).rules == RuleSet.load(out).rules
    first = page.read_bytes()
    run(*shlex.split(report)[3:])
    assert page.read_bytes() == first


def test_answers_and_errors_call_things_as_they_were_typed(run, named, tmp_path, capsys, place):
    rules = kept(run, RULES)
    assert rules in run("diff", rules, RULES)
    run("mine", named, "--setting", "filtered", "--out", tmp_path / "rules.json")
    printed = run("audit", tmp_path / "rules.json", named, "--out", tmp_path / "audited")
    assert printed.startswith(f"{named} against {tmp_path / 'rules.json'}\n")
    assert f"{named} against rules.json" in (tmp_path / "audited" / "audit.html").read_text()
    env = ("--env", "CartPole-v1", "--agent", "novice", "--episodes", 1)
    assert f"shielded by {rules}" in run("evaluate", *env, "--rules", rules)
    for wrong in (("audit", named, rules), ("check", rules), ("mine", rules, "--out", "x.json")):
        assert main(list(wrong)) == 2
        said = capsys.readouterr().err
        assert str(place) not in said
        assert ".unfinished" not in said


def test_the_command_on_a_card_can_be_typed_again(run, tmp_path):
    data, out = kept(run, CART), tmp_path / "compact.json"
    quick = ("--rounds", 1, "--episodes", 2, "--validation", 2, "--max-rules", 3)
    run("aggregate", data, "--out", out, *quick)
    card = json.loads((tmp_path / "compact.card.json").read_text())
    assert card["command"].startswith(f"python -m sarl_core aggregate {data} --out {out} ")


@pytest.mark.parametrize("form", [["--out", "{}"], ["--out={}"]])
def test_nothing_is_written_into_what_is_kept(run, form, capsys, place):
    rules = kept(run, RULES)
    before = {path: path.read_bytes() for path in (place / "files").glob("*/*")}
    arguments = [one.format(rules) for one in form]
    assert main(["mine", CART, "--setting", "filtered", *arguments]) == 2
    assert "what is kept never changes" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in (place / "files").glob("*/*")} == before
