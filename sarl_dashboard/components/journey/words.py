"""What words mean: where one is, in the list on the Overview, and beside every page."""

from __future__ import annotations

import streamlit as st

from sarl_core.explaining.words.glossary import GLOSSARY, meaning_of
from sarl_dashboard.text import together

ANCHOR = "words"
_OPEN = "words"  # parameter of an address that opens them
# A link in a help text opens beside the page, which stays.
_ALL = f"[All words](./?{_OPEN}=all)"


def word_help(word: str, more: str = "") -> str:
    """What stands behind the "?" of a number or a slider that is called by a word.

    Args:
        word: One of the glossary.
        more: What is to be said of it here.

    Returns:
        What it means, and the way to all words.
    """
    return with_words(" ".join(part for part in (meaning_of(word), more) if part))


def with_words(help_text: str) -> str:
    """What stands behind any other "?", and the way to all words."""
    return f"{help_text} {_ALL}"


def show_words(columns: int) -> None:
    """Every word with what it means.

    Args:
        columns: Beside each other, where there is room.
    """
    lines = [f"**{word[0].upper()}{word[1:]}:** {together(GLOSSARY[word])}." for word in GLOSSARY]
    most = -(-len(lines) // columns)
    for place, column in enumerate(st.columns(columns, gap="medium")):
        column.markdown("\n\n".join(lines[place * most : (place + 1) * most]))


def words_button() -> None:
    """The way to all words from any page, which stays as it is behind them."""
    linked = st.query_params.pop(_OPEN, None) is not None
    button = st.sidebar.button("Words", key="words", icon=":material/menu_book:", type="tertiary")
    if button or linked:
        _words()


@st.dialog("Words", width="large")
def _words() -> None:
    show_words(1)
