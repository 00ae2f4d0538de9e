"""Which of many features are looked at."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st


def searched(names: Sequence[str], key: str) -> list[int]:
    """The features whose names have all words of a search.

    Args:
        names: Of the features.
        key: Of the search box, and in the URL.

    Returns:
        Their places, in order; all where nothing is searched for.
    """
    text = st.text_input(
        "Search for features",
        key=key,
        bind="query-params",
        icon=":material/search:",
        width=300,
        placeholder=f"a name among {len(names):,}",
        label_visibility="collapsed",
    )
    return with_words(names, text or "")


def with_words(names: Sequence[str], text: str) -> list[int]:
    """The same of a text that somebody has typed before."""
    words = text.lower().split()
    return [
        place for place, name in enumerate(names) if all(word in name.lower() for word in words)
    ]
