"""The name of the product and its picture: in the browser's tab, and at the top of every page."""

from __future__ import annotations

from pathlib import Path

import streamlit as st

from sarl_dashboard.session import is_dark

_PICTURES = Path(__file__).parents[2] / "pictures"
ICON = str(_PICTURES / "icon.png")  # a named icon would come from the network


def show_logo() -> None:
    """Logo and name at the top of the sidebar; the logo alone where the sidebar is closed."""
    # A picture cannot know the theme that a visitor has chosen in the menu.
    name = "logo_dark.svg" if is_dark() else "logo_light.svg"
    st.logo(str(_PICTURES / name), size="large", icon_image=ICON)
