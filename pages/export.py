"""Export: the rules as code, as a table, and on paper; rounded to what changes no decision."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.state.data import require_demonstrations
from sarl_dashboard.views.export.export import show_export

st.title("Export")
st.caption(
    "Carry the rules, which are learned from demonstrations and guarantee nothing, into other "
    "code, onto paper, or to somebody else, with test vectors that show whether they decide there "
    "as here."
)
show_export(require_demonstrations())
