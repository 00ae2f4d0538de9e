"""That the rules on screen have been edited elsewhere."""

from __future__ import annotations

import streamlit as st

from sarl_core.mining.language import counted
from sarl_dashboard.state.edits import _histories, base, chosen_kind, history, offered
from sarl_dashboard.state.rule_files import OWN_FILE


def notice() -> None:
    """Say that the rules in force have edits, with a link to them; nothing where they have none."""
    if not _histories() or chosen_kind() == OWN_FILE or not offered():
        return
    count = counted(len(history(base()).edits), "edit")
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        st.caption(
            f":material/edit: You have made {count} of these rules. Shown here is what was mined.",
            width="content",
        )
        st.page_link("edit.py", label="See the edited set")
