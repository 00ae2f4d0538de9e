"""Compare: two to five rule sets, their rules and the states they decide differently."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.views.difference.comparison import comparison

st.title("Compare")
st.caption(
    "Two to five rule sets side by side: which rules differ, and on how many of the same states "
    "two of them decide differently."
)
comparison()
