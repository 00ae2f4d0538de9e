"""Which rules are edited, on the page Edit."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_dashboard.state import edits
from sarl_dashboard.state.edits import Base
from sarl_dashboard.state.rule_files import OWN_FILE
from sarl_dashboard.text import in_full, refuse


def base_choice() -> Base:
    """The widgets; where the rules cannot be had, say what to do and stop the page."""
    st.session_state["_edit_base"] = edits.chosen_kind()
    st.segmented_control(
        "Rules to edit",
        edits.kinds(),
        key="_edit_base",
        on_change=_choose,
        required=True,
        help="Those at the thresholds in the sidebar, the compact ones where there are some, or "
        "those of a rule file.",
    )
    if edits.chosen_kind() == OWN_FILE:
        st.file_uploader("Rule file (.json)", key="edit_rule_file", on_change=_take_file)
    try:
        return edits.base()
    except SarlError as problem:
        error = st.session_state.pop("_edit_error", None)
        if error:
            refuse(error)
        st.info(in_full(str(problem)), icon=":material/upload_file:")
        st.stop()


def _choose() -> None:
    """Which rules are edited: what the visitor clicked."""
    chosen = st.session_state["_edit_base"]
    if chosen:
        edits.choose_kind(chosen)


def _take_file() -> None:
    """Keep what was uploaded; what was kept before stays where it cannot be read."""
    file = st.session_state.get("edit_rule_file")
    if file is None:
        return
    try:
        edits.take_file(file.getvalue(), file.name)
    except SarlError as error:
        st.session_state["_edit_error"] = str(error)
