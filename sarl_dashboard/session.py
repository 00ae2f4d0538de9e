"""What a session is: its theme, and what it loads for good."""

from __future__ import annotations

import gc
from typing import NoReturn

import streamlit as st
from streamlit.runtime.scriptrunner import StopException


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


# --- its end -----------------------------------------------------------------------------------


def end_page() -> NoReturn:
    """End a page here, as `st.stop` does.

    After that nothing of Streamlit could be used any more, not even to remember something, and
    what stands at the end of every run would be left out.
    """
    raise StopException
