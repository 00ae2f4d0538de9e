"""Commands say whether the rules that they speak of are approved, and do without a library."""

from __future__ import annotations

import json

import pytest
from sqlalchemy import create_engine, text

from sarl_core.cli.app import main
from sarl_core.library import database
from tests.cli.conftest import CART, ROOT

RULES = str(ROOT / "data" / "rules" / "cartpole_combined.json")
SAYS = "held against the logs of March."
REPORT = ("--demonstrations", CART, "--frames", 0, "--out")


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "library"))
    monkeypatch.setenv("SARL_AUTHOR", "Ada")
    return tmp_path / "library"


@pytest.fixture
def approved(run):
    (item,) = json.loads(run("library", "import", RULES, "--json"))["items"]
    run("library", "approve", item["id"], "--note", SAYS)
    return item["id"]


def test_an_audit_says_it(run, approved, tmp_path):
    printed = run("audit", RULES, CART, "--out", tmp_path / "audited")
    assert "Approved by Ada on " in printed.splitlines()[1]
    assert SAYS in printed
    (approval,) = json.loads(run("audit", RULES, CART, "--json"))["approved"]
    assert (approval["author"], approval["note"]) == ("Ada", SAYS)
    written = json.loads((tmp_path / "audited" / "audit.json").read_text())
    assert written["approved"] == [approval]
    assert SAYS in (tmp_path / "audited" / "audit.html").read_text()
    assert json.loads(run("audit", f"library:{approved}", CART, "--json"))["approved"] == [approval]


def test_a_report_says_it(run, approved, tmp_path):
    out = tmp_path / "report.html"
    (approval,) = json.loads(run("report", RULES, *REPORT, out, "--json"))["approved"]
    assert approval["note"] == SAYS
    assert SAYS in out.read_text()


def test_an_export_says_it_of_the_rules_in_it(run, approved, tmp_path):
    out = tmp_path / "shield.py"
    assert SAYS in run("export", RULES, "--out", out)
    assert SAYS in out.read_text()
    # What was rounded are other rules, for which nobody stands.
    rounded = ("--rounded", "--demonstrations", CART, "--out", tmp_path / "shield.c")
    assert "Not approved by anybody." in run("export", RULES, *rounded)
    assert "Not approved by anybody." in (tmp_path / "shield.c").read_text()
    document = json.loads(run("export", RULES, "--out", tmp_path / "rules.json", "--json"))
    assert document["approved"][0]["note"] == SAYS
    assert "approved" not in (tmp_path / "rules.json").read_text()


def test_where_nothing_is_known_nobody_has_approved(run, place, tmp_path):
    printed = run("audit", RULES, CART)
    assert printed.splitlines()[1] == "Not approved by anybody."
    assert json.loads(run("audit", RULES, CART, "--json"))["approved"] is None
    assert "Not approved by anybody." in run("export", RULES, "--out", tmp_path / "shield.md")
    run("report", RULES, *REPORT, tmp_path / "report.html")
    assert "Nobody has yet." in (tmp_path / "report.html").read_text()
    assert not place.exists()
    run("library", "import", RULES)
    assert json.loads(run("audit", RULES, CART, "--json"))["approved"] == []


def test_a_library_of_a_newer_version_is_said_to_be_one(run, approved, place, capsys):
    engine = create_engine(f"sqlite:///{place / 'library.sqlite3'}")
    with engine.begin() as connection:
        connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
    engine.dispose()
    for command in (("audit", RULES, CART), ("audit", RULES, CART, "--json")):
        assert main([*command]) == 0
        out, error = capsys.readouterr()
        assert SAYS not in out
        (note,) = error.splitlines()
        assert note.startswith("note: whether the rules are approved is not known: the library in")
        assert "was made by a newer version" in note


def test_a_place_that_may_not_be_looked_into_is_said_to_be_one(monkeypatch, capsys):
    def forbidden(_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(database, "is_there", forbidden)
    assert main(["audit", RULES, CART]) == 0
    assert "is not known: Permission denied" in capsys.readouterr().err


def test_a_library_that_cannot_be_opened_stops_nothing(run, place, tmp_path):
    place.mkdir()
    (place / "library.sqlite3").write_bytes(b"something else" * 100)
    assert "pproved" not in run("audit", RULES, CART)
    assert json.loads(run("audit", RULES, CART, "--json"))["approved"] is None
    assert "pproved" not in run("export", RULES, "--out", tmp_path / "shield.md")
    assert "pproved" not in (tmp_path / "shield.md").read_text()
    run("report", RULES, *REPORT, tmp_path / "report.html")
    assert "pproved" not in (tmp_path / "report.html").read_text()
