"""What the Report page asks for: the rules, and what the report is to hold."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.explaining.report.cover import MOST_LINE, MOST_NOTES, MOST_TITLE, today_text
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import rule_set_choice


@dataclass(frozen=True, eq=False)
class CoverChoices:
    """What is to stand on the first page, as it was typed."""

    title: str
    author: str
    date: str
    notes: str
    signers: tuple[str, ...]
    logo: UploadedFile | None


@dataclass(frozen=True, eq=False)
class ReportChoices:
    """What the widgets say."""

    rules: str
    in_full: int
    frames: int
    with_session: bool
    files: list[UploadedFile]
    cover: CoverChoices


def settings(has_comparison: bool) -> ReportChoices:
    """The widgets.

    Args:
        has_comparison: Whether this visitor has run one on the page Measure.
    """
    with st.container(border=True):
        with st.grid(3, min_column_width=150, gap="small"):
            rules = rule_set_choice("report_rules")
            in_full = st.number_input(
                "Rules in full",
                0,
                300,
                60,
                key="in_full",
                bind="query-params",
                help=with_words(
                    "So many rules with evidence, conditions and pictures, those that apply most "
                    "often. The others stand in a table."
                ),
            )
            frames = st.number_input(
                "Pictures a rule",
                0,
                6,
                3,
                key="frames",
                bind="query-params",
                help=with_words(
                    "States in which the rule applies, from episodes that the shipped expert "
                    "plays, or a novice held to the rules."
                ),
            )
        with_session = False
        if has_comparison:
            with_session = st.checkbox(
                "With the comparison you ran on the page Measure",
                value=True,
                key="with_comparison",
                bind="query-params",
            )
        with st.expander("Add results from files"):
            files = st.file_uploader(
                "CSV of the page Measure, or JSON of `evaluate --json`",
                accept_multiple_files=True,
                key="report_results",
            )
        cover = _cover_choices()
    return ReportChoices(rules, int(in_full or 0), int(frames or 0), with_session, files, cover)


def _cover_choices() -> CoverChoices:
    with st.expander("Title, author, logo, notes and who signs"):
        with st.grid(3, min_column_width=150, gap="small"):
            title = _line("Title", "report_title", MOST_TITLE, "the name of the task")
            author = _line("Author", "report_author", MOST_LINE, "")
            date = _line("Date", "report_date", MOST_LINE, today_text()) or today_text()
        with st.grid(2, min_column_width=200, gap="small"):
            notes = st.text_area(
                "Notes",
                key="report_notes",
                bind="query-params",
                max_chars=MOST_NOTES,
                placeholder="what you say, on the first page",
            )
            signers = st.text_area(
                "Who is to sign, one a line",
                key="report_sign_off",
                bind="query-params",
                placeholder="as Head of operations",
            )
        # Which file is no picture is said by who reads it, and not by its name.
        logo = st.file_uploader("Logo (PNG or JPEG)", key="report_logo")
    lines = tuple(line.strip() for line in (signers or "").splitlines() if line.strip())
    return CoverChoices(title, author, date, notes or "", lines, logo)


def _line(label: str, key: str, most: int, placeholder: str) -> str:
    text = st.text_input(
        label, key=key, bind="query-params", max_chars=most, placeholder=placeholder
    )
    return (text or "").strip()
