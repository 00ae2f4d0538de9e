"""Export: the rules as code, as a table, and on paper; rounded to what changes no decision."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.state.data import require_demonstrations
from sarl_dashboard.views.export.export import show_export

st.title("Export")
st.caption(
    "Carry the rules into other code, onto paper, or to somebody else, and check with test vectors "
    "that they decide there as here. The rules are learned from demonstrations: they guarantee "
    "nothing."
)
show_export(require_demonstrations())
