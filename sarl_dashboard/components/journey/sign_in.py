"""Signing in, where whoever runs the dashboard has said who vouches for visitors."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from threading import Lock

import streamlit as st
from streamlit.errors import StreamlitAuthError

from sarl_dashboard import providers, session
from sarl_dashboard.text import escaped, refuse

_MOST_LINKS = 1_000  # of people who are about to sign in
_WAITS = 3600.0  # seconds
_LOCK = Lock()
_LINKS: OrderedDict[str, Link] = OrderedDict()
"""By browser: whoever vouches for visitors sends all of them to the first page."""


@dataclass(frozen=True)
class Link:
    """What somebody wanted to see before signing in.

    Attributes:
        page: Its path, "" of the first one.
        query: What its address says.
        since: Seconds of `time.monotonic`.
    """

    page: str
    query: Mapping[str, list[str]]
    since: float


def is_admitted() -> bool:
    """Whether the pages are for this visitor: who has signed in with a name, where one has to."""
    return not session.needs_sign_in() or bool(session.signed_in())


def link_before_sign_in() -> Link | None:
    """What this visitor, back from signing in, wanted to see; None where nothing, or once more."""
    if "_page" in st.session_state or not session.is_signed_in():
        return None  # a page was seen in this visit
    with _LOCK:
        link = _LINKS.pop(session.browser(), None)
    recent = link is not None and time.monotonic() - link.since < _WAITS
    return link if recent else None


def show_sign_in(page: str) -> None:
    """What stands in the place of every page until somebody has signed in.

    Args:
        page: Path of the one that is seen then.
    """
    st.title("Sign in")
    if session.is_signed_in():
        refuse(
            "you have signed in without a name and without an e-mail address, and what you make "
            "would be nobody's; sign out, and in with an account that has one of them"
        )
        st.button("Sign out", icon=":material/logout:", on_click=st.logout, key="sign_out")
        return
    st.caption("What you make here is kept under the name that you sign in with.")
    for provider in _providers():
        pressed = st.button(
            f"Sign in with {escaped(provider)}" if provider else "Sign in",
            type="primary",
            icon=":material/login:",
            key=f"sign_in_{provider}",
        )
        if pressed:
            _remember(page)
            _sign_in(provider)


def show_signed_in() -> None:
    """Who has signed in, and the way out; for the sidebar."""
    if not session.is_signed_in():
        return
    with st.sidebar:
        st.caption(f"Signed in as {escaped(session.signed_in())}")
        st.button("Sign out", icon=":material/logout:", on_click=st.logout, key="sign_out")


def _remember(page: str) -> None:
    query = {name: st.query_params.get_all(name) for name in st.query_params}
    with _LOCK:
        _LINKS[session.browser()] = Link(page, query, time.monotonic())
        while len(_LINKS) > _MOST_LINKS:
            _LINKS.popitem(last=False)


def _sign_in(provider: str) -> None:
    try:
        st.login(provider or None)
    except StreamlitAuthError as error:
        text = " ".join(str(error).replace("*", "").replace("`", "").split())
        refuse(
            f"nobody can sign in here ({text.rstrip('.')}); whoever runs this dashboard finds "
            "what is needed in the guide, under On a server"
        )


def _providers() -> list[str]:
    """The names of those who vouch for visitors; "" for the only one, which needs none."""
    # Beside them may stand a table of what is said to the only one, which is no provider.
    sections = dict(providers.section())
    sections.pop("client_kwargs", None)
    return [name for name, value in sections.items() if isinstance(value, Mapping)] or [""]
