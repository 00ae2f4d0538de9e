"""Who stands for rules is said in one sentence, and nothing in it can end a comment or a tag."""

from __future__ import annotations

import ast
import json
import subprocess
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import pytest

from sarl_core import Demonstrations, RuleSet, load_demonstrations, make_report, mine_rules
from sarl_core.auditing.audit import audit
from sarl_core.explaining.exports.audit import audit_document, audit_html, save_audit
from sarl_core.explaining.exports.export import export_content
from sarl_core.explaining.words.sign_off import (
    Approval,
    SignOff,
    approvals_document,
    sign_off_of,
    sign_off_text,
)
from tests.explaining.exported import STRICT

MARCH = datetime(2026, 3, 5, 9, 30, tzinfo=UTC)
ADA = Approval("Ada", "held against the logs of March", MARCH)
SENTENCE = "Approved by Ada on 5 March 2026: held against the logs of March."
HOSTILE = Approval('""" */ <b>E\\ve</b> `#`', "??/\n*/ int x; /* {0} {{ </p><script>", MARCH)


@pytest.fixture(scope="module")
def cart() -> Demonstrations:
    data = Path(__file__).parents[2] / "data" / "demonstrations" / "cartpole.parquet"
    return load_demonstrations(data).select(range(3))


@pytest.fixture(scope="module")
def rules(cart: Demonstrations) -> RuleSet:
    return mine_rules(cart, supp_min=0.01, conf_min=0.9)


def test_a_sentence_says_who_when_and_what() -> None:
    assert sign_off_text(sign_off_of([ADA])) == SENTENCE
    eve = Approval("Eve", "", MARCH + timedelta(days=1))
    assert sign_off_text(sign_off_of([eve, ADA])) == (
        f"{SENTENCE} Approved by Eve on 6 March 2026."
    )
    told = Approval("Ada", "Seen!\n\nAll of it.", MARCH)
    assert sign_off_text(sign_off_of([told])) == (
        "Approved by Ada on 5 March 2026: Seen! All of it."
    )
    assert sign_off_text(SignOff()) == sign_off_text(sign_off_of([])) == "Not approved by anybody."
    assert sign_off_text(None) == ""


def test_the_day_is_the_same_everywhere() -> None:
    late = MARCH.replace(hour=23, minute=30).astimezone(timezone(timedelta(hours=9)))
    assert "on 5 March 2026" in sign_off_text(sign_off_of([Approval("Ada", "", late)]))


def test_of_an_author_the_last_word_counts() -> None:
    again = Approval("Ada", "once more", MARCH + timedelta(days=2))
    eve = Approval("Eve", "", MARCH + timedelta(days=1))
    assert sign_off_of([again, eve, ADA]).approvals == (eve, again)


def test_a_document_tells_nobody_from_not_known() -> None:
    assert approvals_document(None) is None
    assert approvals_document(SignOff()) is None
    assert approvals_document(sign_off_of([])) == []
    assert approvals_document(sign_off_of([ADA])) == [
        {"author": "Ada", "note": ADA.note, "created": "2026-03-05T09:30:00+00:00"}
    ]


@pytest.mark.parametrize("suffix", [".md", ".py", ".c"])
def test_what_is_carried_away_says_it(rules: RuleSet, suffix: str) -> None:
    plain = export_content(rules, suffix).decode()
    assert "pproved" not in plain
    for sign_off, says in ((sign_off_of([ADA]), SENTENCE), (SignOff(), "Not approved by anybody.")):
        text = export_content(rules, suffix, sign_off=sign_off).decode()
        assert says in text.replace("\\", "")  # Markdown's escapes


@pytest.mark.parametrize("suffix", [".json", ".csv"])
def test_a_file_of_rules_and_nothing_else_stays_as_it_is(rules: RuleSet, suffix: str) -> None:
    plain = export_content(rules, suffix)
    assert export_content(rules, suffix, sign_off=sign_off_of([ADA])) == plain


def test_a_model_says_it_in_its_metadata(rules: RuleSet) -> None:
    import onnx

    model = onnx.load_model_from_string(
        export_content(rules, ".onnx", sign_off=sign_off_of([ADA, HOSTILE]))
    )
    said = {entry.key: entry.value for entry in model.metadata_props}["approved"]
    assert said.startswith(SENTENCE)
    plain = onnx.load_model_from_string(export_content(rules, ".onnx"))
    assert "approved" not in {entry.key for entry in plain.metadata_props}


def test_no_name_and_no_note_becomes_code(rules: RuleSet, tmp_path: Path) -> None:
    long = Approval("Ada", "word " * 1_900, MARCH)
    sign_off = sign_off_of([HOSTILE, long])
    python = export_content(rules, ".py", sign_off=sign_off).decode()
    assert ast.dump(ast.parse(python)) == ast.dump(ast.parse(export_content(rules, ".py").decode()))
    assert max(map(len, python.splitlines())) <= 120
    (tmp_path / "shield.c").write_bytes(export_content(rules, ".c", sign_off=sign_off))
    subprocess.run(["cc", *STRICT, "-c", "shield.c"], cwd=tmp_path, check=True)
    markdown = export_content(rules, ".md", sign_off=sign_off).decode()
    assert "<script>" not in markdown
    assert "<b>" not in markdown


def test_a_report_says_it_below_its_numbers(rules: RuleSet, cart: Demonstrations) -> None:
    quick = {"frames": 0, "commands": ("python -m sarl_core report",)}
    plain = make_report(rules, cart, **quick).html
    assert "pproved" not in plain
    html = make_report(rules, cart, **quick, sign_off=sign_off_of([ADA])).html
    assert f'<p class="soft">{SENTENCE}</p>' in html
    assert "as long as nobody else approves the rules" in html
    assert "Nobody has yet." in make_report(rules, cart, **quick, sign_off=SignOff()).html
    hostile = make_report(rules, cart, **quick, sign_off=sign_off_of([HOSTILE])).html
    assert "<script>" not in hostile
    assert "&lt;script&gt;" in hostile


def test_an_audit_says_it_on_its_page_and_in_its_document(
    rules: RuleSet, cart: Demonstrations, tmp_path: Path
) -> None:
    held, sign_off = audit(rules, cart), sign_off_of([ADA])
    assert "pproved" not in audit_html(held, title="x")
    assert f'<p class="soft">{SENTENCE}</p>' in audit_html(held, title="x", sign_off=sign_off)
    assert "<script>" not in audit_html(held, title="x", sign_off=sign_off_of([HOSTILE]))
    assert audit_document(held) == {**held.to_dict(), "approved": None}
    save_audit(held, tmp_path / "audited", title="x", sign_off=sign_off)
    written = json.loads((tmp_path / "audited" / "audit.json").read_text())
    assert written["approved"] == approvals_document(sign_off)
    assert SENTENCE in (tmp_path / "audited" / "audit.html").read_text()
