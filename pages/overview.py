"""Overview: what this is, and where to begin."""

from __future__ import annotations

import streamlit as st

st.title("Overview")
st.caption(
    "From recordings of an expert to a few rules that a person can read, and that correct an agent "
    "before it acts."
)
