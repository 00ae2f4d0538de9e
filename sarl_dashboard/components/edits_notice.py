"""That what a page shows is without the edits in force."""

from __future__ import annotations

import streamlit as st

from sarl_core.mining.language import counted
from sarl_dashboard.state import in_force


def without_edits_notice() -> None:
    """Say that this page is about rules as they were mined; nothing where no edits are in force."""
    if in_force.is_edited():
        with st.container(horizontal=True, vertical_alignment="center", gap="small"):
            st.caption(
                f":material/edit: {counted(in_force.count(), 'edit')} in force. This page is about "
                "the rules without them.",
                width="content",
            )
            st.page_link("edit.py", label="See the edits")
