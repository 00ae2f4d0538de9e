"""Which page of a long list is looked at."""

from __future__ import annotations

from collections.abc import Hashable

import streamlit as st


def number_of_pages(count: int, most: int) -> int:
    """How many pages a list takes.

    Args:
        count: Of its entries.
        most: Entries of a page.
    """
    return max(-(-count // most), 1)


def follow(key: str, listing: Hashable, entry: Hashable, *, page: int, pages: int) -> None:
    """Turn to a page where one has to; before the choice is drawn.

    Another list is seen from its beginning, and another entry where it stands. As long as both stay
    what they were, so does the page that was turned to.

    Args:
        key: Of the choice.
        listing: What tells the list, and its order, from others.
        entry: What is chosen in it.
        page: Where the entry stands, from 0.
        pages: How many there are.
    """
    before, now = st.session_state.get(f"_{key}_of"), (listing, entry)
    st.session_state[f"_{key}_of"] = now
    turned = key in st.session_state
    linked = not turned and key in st.query_params
    if linked and before in (None, now):
        return  # as the link says
    if before is None or not (turned or linked):
        wanted = page
    elif before[0] != listing:
        wanted = 0
    elif before[1] != entry:
        wanted = page
    else:
        wanted = min(st.session_state[key], pages) - 1
    if st.session_state.get(key, 1) != wanted + 1:
        st.session_state[key] = wanted + 1


def page_choice(key: str, pages: int) -> int:
    """The choice of a page; nothing is drawn where there is only one.

    Args:
        key: Of the widget, and in the URL.
        pages: How many there are.

    Returns:
        The chosen one, from 0.
    """
    if pages == 1:
        return 0
    return int(st.pagination(pages, key=key, bind="query-params")) - 1
