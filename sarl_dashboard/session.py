"""What a session is: its theme, and what it loads for good."""

from __future__ import annotations

import gc

import streamlit as st


@st.cache_resource(show_spinner=False)
def settle(page: str, modules: int) -> None:
    """Take what a page has loaded for good out of the garbage collector's sight.

    Streamlit collects all garbage after every run, and once more before a run that a callback asks
    for. Libraries and trees are here to stay; looking through them each time takes longer than
    everything that follows from a moved slider.

    Args:
        page: Its title; once for each,
        modules: and again where more of them are loaded, as by work beside the page.
    """
    gc.collect()
    gc.freeze()


# --- how it looks ------------------------------------------------------------------------------


def is_dark() -> bool:
    """Whether the visitor's theme is dark."""
    return str(st.context.theme.get("type", "light")) == "dark"
