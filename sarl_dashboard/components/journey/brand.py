"""The name of the product and its picture: in the browser's tab, and at the top of every page."""

from __future__ import annotations

from pathlib import Path

import streamlit as st

_PICTURES = Path(__file__).parents[2] / "pictures"
ICON = str(_PICTURES / "icon.png")  # a named icon would come from the network


def show_logo() -> None:
    """Logo and name at the top of the sidebar; the logo alone where the sidebar is closed."""
    # Browsers tell a picture the theme of what it stands in, were it chosen in the menu or changed
    # while the page is open; the server hears of it with the next run alone.
    st.logo(str(_PICTURES / "logo.svg"), size="large", icon_image=ICON)
