"""Starts the dashboard: `streamlit run app.py`.

The navigation lives in `pages/_router.py`. Were it here, Streamlit would take `pages/` for its
older kind of multipage app and run a page file alone when a fresh server is first visited by a
deep link.
"""

from __future__ import annotations

from pathlib import Path

import streamlit as st

app = st.App(Path(__file__).parent / "pages" / "_router.py")
