"""What the rules say of a log: numbers, drift, two logs side by side, rules and files."""

from __future__ import annotations

import json
from functools import partial
from pathlib import PurePath

import streamlit as st

from sarl_core.auditing.audit import Audit
from sarl_core.explaining.exports.audit import (
    audit_document,
    audit_html,
    broken_rules_html,
    moved_html,
)
from sarl_core.explaining.html.headings import heading
from sarl_core.explaining.html.number_cards import Number, number_cards
from sarl_core.explaining.tables.spreadsheet_cells import safe_cells
from sarl_core.explaining.words.audit import audit_facts, comparison_text, drift_text
from sarl_core.explaining.words.sign_off import SignOff, sign_off_text
from sarl_core.mining.language import share_text
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.keeping import keep_result_button
from sarl_dashboard.components.settings import notes_notice
from sarl_dashboard.state.sign_off import sign_off_here
from sarl_dashboard.text import escaped
from sarl_dashboard.views.audit.logs import Logs


def show_answer(logs: Logs) -> None:
    """Everything but the steps of single episodes.

    Args:
        logs: What was audited.
    """
    held, sign_off = logs.first, sign_off_here(logs.rule_set)
    notes_notice(held.notes)
    if sign_off is not None:
        st.caption(escaped(sign_off_text(sign_off)))
    facts = dict(audit_facts(held))
    numbers = [
        ("Steps", f"{held.steps:,}", "steps"),
        ("Coverage", share_text(held.coverage), "coverage"),
        ("Agreement", share_text(held.agreement) if held.covered else "–", "agreement"),
        ("Broken", f"{held.broken:,}", "breaks"),
        (
            "Breaks a minute",
            "–" if held.time is None else f"{held.breaks_per_minute:.3g}",
            "breaks a minute",
        ),
        ("Longest run", f"{held.longest_run:,}", "longest run"),
        ("Near misses", f"{held.near_count:,}", "near misses"),
        ("Freedom", share_text(held.freedom), "freedom"),
    ]
    st.html(number_cards([Number(label, value, facts[fact]) for label, value, fact in numbers]))
    _sentence(drift_text(held.drift), warns=bool(held.drift.drifted))
    with st.expander("Every share that was compared", icon=":material/compare_arrows:"):
        st.html(moved_html(held.drift.all, "now, and before"))
    if logs.comparison is not None:
        st.html(heading("Before and after"))
        comparison = logs.comparison
        _sentence(
            comparison_text(comparison), warns=any(one.drifted for one in comparison.differences)
        )
        st.html(moved_html(comparison.differences, "after, and before"))
    if held.broken:
        st.html(heading("By rule"))
        st.html(broken_rules_html(held))
    _downloads(logs, sign_off)


def _sentence(text: str, *, warns: bool) -> None:
    if warns:
        st.warning(escaped(text), icon=":material/moving:")
    else:
        st.info(escaped(text), icon=":material/info:")


def _downloads(logs: Logs, sign_off: SignOff | None) -> None:
    stem = f"audit-{PurePath(logs.name).stem}"
    held = logs.first
    with st.container(horizontal=True, gap="small"):
        page = partial(_page, logs, sign_off)
        download(
            "Report",
            page,
            f"{stem}.html",
            key="audit_html",
            meaning="One page that opens by itself",
        )
        download("JSON", partial(_json, logs, sign_off), f"{stem}.json", key="audit_json")
        download("Steps as CSV", partial(_steps, held), f"{stem}.csv", key="audit_csv")
        keep_result_button(page, f"{stem}.html", key="keep_audit", beside=lambda: logs.identifiers)


def _page(logs: Logs, sign_off: SignOff | None) -> str:
    title = f"Audit of {logs.name}"
    return str(audit_html(logs.first, title=title, comparison=logs.comparison, sign_off=sign_off))


def _json(logs: Logs, sign_off: SignOff | None) -> str:
    return json.dumps(audit_document(logs.first, logs.comparison, sign_off), indent=1)


def _steps(held: Audit) -> str:
    return str(safe_cells(held.to_frame()).to_csv(index=False))
