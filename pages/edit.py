"""Edit: rules switched off, pinned, regrown and added by hand, and what each changes at once."""

from __future__ import annotations

import streamlit as st

from sarl_core.mining.language import counted
from sarl_dashboard.components.settings import other_data_notice
from sarl_dashboard.state import edits
from sarl_dashboard.text import escaped
from sarl_dashboard.views.edit.base import edited_base
from sarl_dashboard.views.edit.editing import editing

st.title("Edit")
st.caption(
    "Switch rules off, pin them, move them, add your own, or let a part of the tree grow anew from "
    "another condition: edits stay while the thresholds move, and are in force on every page."
)
base = edited_base()
other_data_notice()
if base.name:
    st.caption(f"The rules of {escaped(base.name)}, {len(base.rule_set):,} of them.")
others = edits.waiting(base)
if others:
    st.caption(
        f":material/schedule: The edits of {counted(others, 'other rule set')} wait until "
        f"{'it is' if others == 1 else 'they are'} chosen again."
    )
editing(base)
