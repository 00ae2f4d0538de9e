"""Who vouches for visitors (OpenID Connect), as Streamlit's secrets have it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from threading import Event
from typing import Any

import streamlit as st
from streamlit import config
from streamlit.errors import StreamlitSecretNotFoundError

from sarl_core.errors import InputError

_ADVICE = "the guide shows under On a server what stands in them"
_SECRET = re.compile(r"[\w+/=-]{32,}", re.ASCII)
_named = Event()  # never taken back: what was closed once opens for nobody


def check() -> None:
    """Take in who is named before anybody is served, or refuse the secrets.

    Streamlit goes on without secrets that it cannot read, and would let everybody in.

    Raises:
        InputError: If they cannot be read, name nobody where they should, or hold no secret that
            the cookie of who has signed in could be sealed with.
    """
    places = [Path(path) for path in config.get_option("secrets.files")]
    try:
        folders = [path for path in places if path.is_dir()]
        known = st.secrets.to_dict()
    except StreamlitSecretNotFoundError as error:
        if error.error_id == "no-secrets-found" and not folders:
            return
        raise _refusal(str(error)) from error
    except (OSError, ValueError) as error:
        raise _refusal(str(error)) from error
    if "auth" not in known:
        return
    provider = known["auth"]
    if not (isinstance(provider, dict) and provider):
        raise InputError(f"'auth' in the secrets names nobody; {_ADVICE}")
    if not _SECRET.fullmatch(str(provider.get("cookie_secret", ""))):
        raise InputError(
            "'cookie_secret' in the secrets is none, and who knows it can sign in as anybody; "
            "write there what `openssl rand -hex 32` prints"
        )
    _named.set()


def are_named() -> bool:
    """Whether anybody vouches for visitors, or did so since the server started."""
    if section():
        _named.set()
    return _named.is_set()


def section() -> Mapping[str, Any]:
    """What the secrets say of them now; nothing where they say nothing or cannot be read."""
    try:
        provider = st.secrets.to_dict().get("auth")
    except (OSError, ValueError):  # as Streamlit's own error of secrets is
        return {}
    return provider if isinstance(provider, dict) else {}


def _refusal(reason: str) -> InputError:
    return InputError(
        f"the secrets cannot be read ({reason.rstrip('.')}); let whoever runs the dashboard read "
        f"them, or take them away; {_ADVICE}"
    )
