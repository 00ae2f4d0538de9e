"""What the Report page asks for: the rules, and what the report is to hold."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import rule_set_choice


@dataclass(frozen=True, eq=False)
class ReportChoices:
    """What the widgets say."""

    rules: str
    in_full: int
    frames: int
    with_session: bool
    files: list[UploadedFile]


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
    return ReportChoices(rules, int(in_full or 0), int(frames or 0), with_session, files)
