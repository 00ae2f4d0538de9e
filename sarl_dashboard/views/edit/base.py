"""The rules that are edited, on the page Edit: those in force."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_dashboard.session import end_page
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.text import in_full


def edited_base() -> Base:
    """The rules in force without their edits; where they cannot be had, the page stops."""
    try:
        return rule_base.base()
    except SarlError as problem:
        st.info(in_full(str(problem)), icon=":material/upload_file:")
        end_page()
