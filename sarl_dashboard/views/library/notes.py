"""What people say of a thing, and what it is about."""

from __future__ import annotations

from contextlib import suppress

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.library import Item, Library
from sarl_core.library.results import add_note, note_text, note_writer, notes_about
from sarl_dashboard.state.url import set_url_choice
from sarl_dashboard.text import escaped, refuse


def show_sources(opened: Library, item: Item) -> None:
    """What a thing came from or is about, each to be opened.

    Args:
        opened: Where it is.
        item: The thing.
    """
    if not item.came_from:
        return
    word = "About" if item.kind in ("result", "note") else "Made of"
    with st.container(horizontal=True):
        for identifier in item.came_from:
            with suppress(SarlError):  # removed for good, or left behind elsewhere
                name = opened.item(identifier).name
                _open_button(f"{word}: {escaped(name)}", identifier, f"source_{identifier}")


def show_results(opened: Library, item: Item, author: str) -> None:
    """The results that are about a thing, as far as they stand in the list of who looks.

    Args:
        opened: Where it is.
        item: The thing.
        author: Who looks.
    """
    results = [
        one for one in opened.made_of(item.id, kind="result") if one.shared or one.author == author
    ]
    if not results:
        return
    with st.expander(f"Results ({len(results):,})", icon=":material/lab_profile:"):
        for one in results:
            label = f"{escaped(one.name)} · {one.created.astimezone():%d %b %Y, %H:%M}"
            _open_button(label, one.id, f"result_{one.id}")


def show_notes(opened: Library, item: Item, author: str) -> None:
    """The notes to a thing, and a place for another.

    Args:
        opened: Where it is.
        item: The thing.
        author: Who looks.
    """
    for one in notes_about(opened, item):
        with st.container(border=True):
            who = "You" if note_writer(one) == author else note_writer(one)
            label = f"{escaped(who)}, {one.created.astimezone():%d %B %Y, %H:%M}"
            _open_button(label, one.id, f"note_item_{one.id}")
            try:
                st.text(note_text(opened, one))
            except SarlError as error:
                refuse(error)
    with st.expander("Add a note", icon=":material/add_notes:"):
        st.text_area("Your note", key=f"note_{item.id}", max_chars=10_000)
        st.button(
            f"Add as {escaped(author)}",
            key="library_note",
            on_click=_add,
            args=(opened, item, author),
        )


def _add(opened: Library, item: Item, author: str) -> None:
    """Keep what was written, which stays where it was written if it cannot be; for a callback."""
    text = st.session_state.get(f"note_{item.id}") or ""
    try:
        add_note(opened, text, author=author, about=[item.id])
    except SarlError as error:
        st.session_state["_library_error"] = str(error)
        return
    st.session_state[f"note_{item.id}"] = ""


def _open_button(label: str, identifier: str, key: str) -> None:
    st.button(
        label,
        key=key,
        type="tertiary",
        icon=":material/arrow_forward:",
        on_click=set_url_choice,
        args=("item", identifier),
    )
