"""Signing in, where whoever runs the dashboard has said who vouches for visitors."""

from __future__ import annotations

from collections.abc import Mapping

import streamlit as st
from streamlit.errors import StreamlitAuthError

from sarl_dashboard import session
from sarl_dashboard.text import escaped, refuse


def is_admitted() -> bool:
    """Whether the pages are for this visitor: who has signed in with a name, where one has to."""
    return not session.needs_sign_in() or bool(session.signed_in())


def show_sign_in() -> None:
    """What stands in the place of every page until somebody has signed in."""
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
            _sign_in(provider)


def show_signed_in() -> None:
    """Who has signed in, and the way out; for the sidebar."""
    if not session.is_signed_in():
        return
    with st.sidebar:
        st.caption(f"Signed in as {escaped(session.signed_in())}")
        st.button("Sign out", icon=":material/logout:", on_click=st.logout, key="sign_out")


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
    sections = dict(st.secrets["auth"])
    sections.pop("client_kwargs", None)
    return [name for name, value in sections.items() if isinstance(value, Mapping)] or [""]
