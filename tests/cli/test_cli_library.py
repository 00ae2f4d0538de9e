"""Commands around what is kept, as they are typed."""

from __future__ import annotations

import json
import re

import pytest

from sarl_core import RuleSet
from sarl_core.cli.app import main
from sarl_core.library import Library
from sarl_core.library.contents import add_edits
from sarl_core.mining.editing.edits import Switch
from tests.cli.conftest import CART, ROOT

RULES = str(ROOT / "data" / "rules" / "cartpole_compact.json")


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "library"))
    monkeypatch.setenv("SARL_AUTHOR", "Ada")
    return tmp_path / "library"


def imported(run, *arguments):
    (item,) = json.loads(run("library", "import", *arguments, "--json"))["items"]
    return item


def test_demonstrations_and_rules_are_kept_listed_and_shown(run):
    assert "Nothing is kept" in run("library", "list")
    data = imported(run, CART)
    rules = imported(run, RULES, "--name", "four rules")
    listed = json.loads(run("library", "list", "--json"))["items"]
    assert [one["id"] for one in listed] == [rules["id"], data["id"]]
    assert [one["kind"] for one in listed] == ["rules", "demonstrations"]
    assert {one["author"] for one in listed} == {"Ada"}
    assert rules["name"] == "four rules"
    # The shipped rules were mined from more than the shipped demonstrations.
    assert rules["came_from"] == []
    printed = run("library", "list", "--kind", "rules")
    assert rules["id"] in printed
    assert data["id"] not in printed
    told = json.loads(run("library", "show", rules["id"], "--json"))
    assert RuleSet.load(told["paths"]["rules"]) == RuleSet.load(RULES)
    assert "four rules" in run("library", "show", f"library:{rules['id']}")


def test_rules_know_the_demonstrations_that_are_kept(run, tmp_path):
    data = imported(run, CART)
    run("mine", CART, "--setting", "filtered", "--out", tmp_path / "rules.json")
    assert imported(run, tmp_path / "rules.json")["came_from"] == [data["id"]]


def test_an_id_stands_for_a_file_in_commands(run, tmp_path):
    data, rules = (f"library:{imported(run, one)['id']}" for one in (CART, RULES))
    kept, direct = tmp_path / "kept.json", tmp_path / "direct.json"
    run("mine", data, "--setting", "filtered", "--out", kept)
    run("mine", CART, "--setting", "filtered", "--out", direct)
    assert RuleSet.load(kept).rules == RuleSet.load(direct).rules
    assert json.loads(run("audit", rules, data, "--json")) == json.loads(
        run("audit", RULES, CART, "--json")
    )
    env = ("--env", "CartPole-v1", "--agent", "novice", "--episodes", 2, "--json")
    plain = json.loads(run("evaluate", *env, "--rules", RULES))
    assert json.loads(run("evaluate", *env, f"--rules={rules}"))["summary"] == plain["summary"]
    assert json.loads(run("evaluate", *env, "--rules", rules))["summary"] == plain["summary"]


def test_a_set_travels_as_one_file(run, tmp_path, monkeypatch):
    data = imported(run, CART)
    run("mine", CART, "--setting", "filtered", "--out", tmp_path / "rules.json")
    rules = imported(run, tmp_path / "rules.json")
    run("library", "approve", rules["id"], "--note", "held against the logs")
    out = tmp_path / "rules.sarl"
    run("library", "export", rules["id"], "--out", out)
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "other"))
    monkeypatch.setenv("SARL_AUTHOR", "Bob")
    run("library", "import", out)
    listed = {one["id"]: one for one in json.loads(run("library", "list", "--json"))["items"]}
    assert set(listed) == {data["id"], rules["id"]}
    assert listed[rules["id"]]["approvals"][0]["note"] == "held against the logs"
    printed = run("library", "show", rules["id"])
    assert re.search(r"Ada, \d{4}-\d\d-\d\d \d\d:\d\d: held against the logs", printed)


def test_removing_can_be_undone(run):
    rules = imported(run, RULES)
    run("library", "remove", rules["id"])
    assert "Nothing is kept" in run("library", "list")
    assert rules["id"] in run("library", "list", "--removed")
    run("library", "remove", rules["id"], "--undo")
    assert rules["id"] in run("library", "list")


def test_what_was_removed_stands_for_no_file(run, capsys):
    rules = imported(run, RULES)
    run("library", "approve", rules["id"])
    run("library", "remove", f"library:{rules['id']}")
    # It would be said to be approved by nobody, as what was removed approves nothing.
    assert main(["audit", f"library:{rules['id']}", str(CART)]) == 2
    said = capsys.readouterr().err
    assert "was removed by Ada" in said
    assert f"`sarl library remove {rules['id']} --undo`" in said
    run("library", "remove", f"library:{rules['id']}", "--undo")
    assert "Approved by Ada" in run("audit", f"library:{rules['id']}", CART)


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (("library", "show", "nothing"), 2, "'nothing' is no id of a library"),
        (("library", "show", "a" * 26), 2, "has nothing with the id"),
        (("library", "remove", "a" * 26), 2, "has nothing with the id"),
        (("library", "list", "--kind", "cars"), 2, "--kind cars is no kind of thing"),
        (("library", "import", "none.csv"), 2, "none.csv"),
        (("library", "export", "a" * 26, "--out", "rules.zip"), 2, "must end in .sarl"),
        (("mine", "library:x", "--support", 0, "--confidence", 1, "--out", "x.json"), 2, "no id"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(arguments, code, says, capsys, tmp_path):
    assert main([str(one) for one in arguments]) == code
    printed = capsys.readouterr().err
    assert re.fullmatch(r"error: [^\n]*\n", printed)
    assert says in printed


def test_what_belongs_to_somebody_else_is_not_removed(run, capsys, monkeypatch):
    rules = imported(run, RULES)
    monkeypatch.setenv("SARL_AUTHOR", "Bob")
    assert main(["library", "remove", rules["id"]]) == 2
    assert "is 'Ada''s, who alone may change that" in capsys.readouterr().err


def test_a_library_that_cannot_be_made_is_said_in_one_sentence(place, capsys):
    place.write_text("a file where the folder should be")
    assert main(["library", "list"]) == 1
    assert "cannot be made" in capsys.readouterr().err


def test_edits_say_in_words_what_they_were_made_on(run):
    rules = RuleSet.load(RULES)
    with Library() as library:
        item = add_edits(
            library,
            [Switch(rules[0].id, on=False)],
            "(('cartpole', 2), 'key')",
            author="Ada",
            made_on="At the thresholds, Cart Pole",
        )
    printed = run("library", "show", item.id)
    assert "At the thresholds, Cart Pole" in printed
    assert "key" not in printed
