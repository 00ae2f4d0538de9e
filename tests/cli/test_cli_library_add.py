"""Results and notes are added on the command line, with what they are about, and shown."""

from __future__ import annotations

import json
import re

import pytest

from sarl_core.cli.app import main
from tests.cli.conftest import CART, ROOT

RULES = str(ROOT / "data" / "rules" / "cartpole_combined.json")


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "library"))
    monkeypatch.setenv("SARL_AUTHOR", "Ada")
    return tmp_path / "library"


def added(run, *arguments):
    (item,) = json.loads(run("library", "add", *arguments, "--json"))["items"]
    return item


def test_an_audit_is_kept_as_a_result_of_the_rules_and_the_log(run, tmp_path):
    data = added(run, CART, "--kind", "demonstrations", "--name", "the log")
    rules = added(run, RULES, "--kind", "rules", "--about", data["id"])
    assert (data["name"], rules["name"]) == ("the log", "cartpole_combined")
    assert rules["came_from"] == [data["id"]]
    answer = tmp_path / "audit.json"
    answer.write_text(run("audit", f"library:{rules['id']}", f"library:{data['id']}", "--json"))
    about = ("--about", rules["id"], "--about", f"library:{data['id']}")
    result = added(run, answer, "--kind", "result", "--name", "March", *about)
    assert (result["kind"], result["name"]) == ("result", "March")
    assert result["came_from"] == [rules["id"], data["id"]]
    printed = run("library", "show", result["id"])
    assert '"steps": 15000' in printed
    assert "and more; the file holds all of it" in printed
    assert f"cartpole_combined, {rules['id']}" in printed
    assert result["id"] in run("library", "list", "--kind", "result")
    # It is a file for other commands, too.
    told = json.loads(run("library", "show", result["id"], "--json"))
    assert told["paths"]["result"].endswith(".json")


def test_a_log_is_kept_and_audited(run, tmp_path):
    rules = added(run, RULES, "--kind", "rules")
    log = added(run, CART, "--kind", "log", "--name", "March", "--about", rules["id"])
    assert (log["name"], log["details"]["file_name"]) == ("March", "cartpole.parquet")
    assert log["came_from"] == [rules["id"]]
    assert log["id"] in run("library", "list", "--kind", "log")
    answer = json.loads(run("audit", RULES, f"library:{log['id']}", "--json"))
    assert answer["steps"] == 15_000


def test_a_table_is_shown_as_one(run, tmp_path):
    table = tmp_path / "comparison.csv"
    table.write_text("agent,return\n" + "".join(f"agent {n},{n}\n" for n in range(30)))
    printed = run("library", "show", added(run, table, "--kind", "result")["id"])
    assert re.search(r"agent 19 +19", printed)
    assert "agent 20" not in printed
    assert "and more" in printed
    page = tmp_path / "report.html"
    page.write_text("<p>words of the page</p>")
    printed = run("library", "show", added(run, page, "--kind", "result")["id"])
    assert "words of the page" not in printed
    assert ".html" in printed


def test_a_note_is_shown_beneath_what_it_is_about(run, tmp_path):
    rules = added(run, RULES, "--kind", "rules")
    (tmp_path / "note.md").write_text("Late by a step.\n\nSeen <b>twice</b>.\n")
    note = added(run, tmp_path / "note.md", "--kind", "note", "--about", rules["id"])
    assert note["name"] == "Late by a step."
    for identifier in (rules["id"], note["id"]):
        printed = run("library", "show", identifier)
        assert "Late by a step.\n\nSeen <b>twice</b>.\n" in printed
    (told,) = json.loads(run("library", "show", rules["id"], "--json"))["notes"]
    assert (told["id"], told["author"]) == (note["id"], "Ada")
    assert told["text"] == "Late by a step.\n\nSeen <b>twice</b>."


def test_what_a_thing_came_from_may_be_gone(run, tmp_path, monkeypatch):
    from datetime import timedelta

    from sarl_core.library import library as module

    rules = added(run, RULES, "--kind", "rules")
    (tmp_path / "note.txt").write_text("words")
    note = added(run, tmp_path / "note.txt", "--kind", "note", "--about", rules["id"])
    monkeypatch.setattr(module, "_UNDONE_FOR", timedelta(0))
    run("library", "remove", rules["id"])
    assert f"{rules['id']}, which is not here" in run("library", "show", note["id"])


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("none.csv", "--kind", "result"), "none.csv cannot be read"),
        (("none.md", "--kind", "note"), "none.md cannot be read"),
        (("none.json", "--kind", "rules"), "none.json"),
        (("none.csv", "--kind", "demonstrations"), "none.csv"),
        ((RULES, "--kind", "cars"), "--kind cars is no kind of thing"),
        ((RULES,), "Missing option '--kind'"),
        ((CART, "--kind", "result"), "ends in '.parquet' and a result in one of"),
        ((CART, "--kind", "note"), "ends in '.parquet' and a note in one of"),
        ((CART, "--kind", "rules"), "cartpole.parquet"),
        ((RULES, "--kind", "result", "--about", "x"), "'x' is no id of a library"),
        ((RULES, "--kind", "result", "--about", "a" * 26), "has nothing with the id"),
        ((RULES, "--kind", "result", "--name", " "), "needs a name"),
        (("blank.txt", "--kind", "note"), "a note needs some words"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(arguments, says, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "blank.txt").write_text(" \n ")
    assert main(["library", "add", *arguments]) == 2
    printed = capsys.readouterr().err
    assert re.fullmatch(r"error: [^\n]*\n", printed)
    assert says in printed


def test_what_is_too_large_is_said_in_one_sentence(capsys, tmp_path, monkeypatch):
    from sarl_core.library import Quota
    from sarl_core.library import library as module

    monkeypatch.setattr(module, "Quota", lambda: Quota(author=10))
    (tmp_path / "a.csv").write_text("agent,return\n")
    assert main(["library", "add", str(tmp_path / "a.csv"), "--kind", "result"]) == 2
    assert "that Ada may keep" in capsys.readouterr().err
