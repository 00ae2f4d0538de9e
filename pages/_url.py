"""Choices that the URL holds, and that survive a change of page without a widget."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import streamlit as st


def url_choice(name: str, options: Sequence[str], default: str) -> str:
    """A choice that the URL holds and that survives a change of page.

    Args:
        name: URL parameter.
        options: What it may be.
        default: Taken where the URL says nothing, or something else.

    Returns:
        One of `options`.
    """
    return url_text(name, default, lambda text: text in options)


def url_text(name: str, default: str, valid: Callable[[str], bool]) -> str:
    """A text that the URL holds and that survives a change of page.

    Args:
        name: URL parameter.
        default: Taken where the URL says nothing, or nothing valid.
        valid: Whether a text may be meant.

    Returns:
        The default, or a valid text.
    """
    value = st.query_params.get(name)
    if value is None or not valid(value):  # a change of page takes the parameters away
        value = str(st.session_state.get(f"_{name}", default))
    if not valid(value):
        value = default
    set_url_choice(name, value, default)
    return value


def set_url_choice(name: str, value: str, default: str = "") -> None:
    """Choose, from a widget's callback or by `url_choice`.

    Args:
        name: URL parameter.
        value: Its new value.
        default: Value that needs no place in the URL.
    """
    st.session_state[f"_{name}"] = value
    if value != default:
        if st.query_params.get(name) != value:
            st.query_params[name] = value
    elif name in st.query_params:
        del st.query_params[name]


def with_own(options: tuple[str, ...], key: str) -> tuple[str, ...]:
    """Options of a select box that also takes typed ones, with the typed one among them.

    Args:
        options: The usual ones.
        key: Of the widget; it is bound to the URL.

    Returns:
        The options, and what was typed or came with the URL.
    """
    own = st.session_state.get(key) or st.query_params.get(key)
    return options if own is None or own in options else (*options, str(own))
