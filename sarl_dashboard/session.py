"""What a session is: whose it is, its theme, and what it loads for good."""

from __future__ import annotations

import gc
import os
import time
from contextlib import suppress
from hashlib import sha256
from ipaddress import ip_address
from threading import Lock
from typing import NoReturn
from urllib.parse import urlsplit

import psutil
import streamlit as st
from streamlit import config
from streamlit.runtime.scriptrunner import StopException, get_script_run_ctx
from streamlit.web.server.starlette.starlette_app_utils import decode_xsrf_token_string
from streamlit.web.server.starlette.starlette_server_config import XSRF_COOKIE_NAME

from sarl_core.serving import limits
from sarl_dashboard import providers


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


# --- whose it is --------------------------------------------------------------------------------

_LONGEST_NAME = 200  # as the library has it
_LONGEST_ADDRESS = _LONGEST_NAME - 4  # in brackets, behind a letter of a name and a space
_ONLY_ONE = "the only one"


def needs_sign_in() -> bool:
    """Whether visitors sign in here: whether Streamlit's secrets name who vouches for them."""
    return providers.are_named()


def is_signed_in() -> bool:
    """Whether this visitor has."""
    try:
        return bool(getattr(st.user, "is_logged_in", False))
    except (OSError, ValueError):  # of secrets that became unreadable
        return False


def signed_in() -> str:
    """What tells who has signed in, in words: "" where nobody has, or there is nothing to say.

    What is kept is theirs by this. An address counts where who vouches for them says that it was
    verified; two people of one name are told apart by their addresses, or else their accounts. So
    nobody can take a name that holds somebody's address or account.
    """
    if get_script_run_ctx() is None or not is_signed_in():
        return ""
    name, email = _said("name"), _said("email")
    verified = str(st.user.get("email_verified")).lower() == "true"  # a text with some
    if email and verified and len(email) <= _LONGEST_ADDRESS:  # cut, it could be somebody else's
        return _with_mark(name, f"<{email}>") if name else email
    named = (name or email).replace("@", " at ")  # or it could be somebody's address
    account = _account()
    if not (named and account):
        return ""
    return _with_mark(named, f"(account {sha256(account.encode()).hexdigest()[:12]})")


def _said(key: str) -> str:
    """A text of who vouches for the visitor, in signs that cannot be taken for others."""
    text = str(st.user.get(key) or "").strip().translate(str.maketrans("", "", "<>"))
    return "".join(filter(str.isprintable, text))


def _with_mark(name: str, mark: str) -> str:
    return f"{name[: _LONGEST_NAME - len(mark) - 1]} {mark}"


def _account() -> str:
    """What stays the same of an account whatever its holder is called; "" where it is not said."""
    subject = str(st.user.get("sub") or "")
    return f"{st.user.get('iss') or ''} {subject}" if subject else ""


def visitor() -> str:
    """What tells visitors apart: whose work is whose, and what each may have.

    The account that has signed in; else the browser, or on a server for one person nothing at all.
    """
    context = get_script_run_ctx()
    if context is None:
        return ""
    if is_signed_in():
        return _account() or signed_in()
    return _ONLY_ONE if serves_one() else browser() or context.session_id


def serves_one() -> bool:
    """Whether this server is one person's own, whose browsers are all the same visitor.

    It listens on its own machine alone, no limits are set in its settings, nobody signs in, and no
    proxy has brought this page from elsewhere.
    """
    headers = st.context.headers
    return (
        not needs_sign_in()
        and limits.VARIABLE not in os.environ
        and _is_own_machine(str(config.get_option("server.address") or ""))
        and not any(name in headers for name in ("X-Forwarded-For", "Forwarded"))
        and ("Host" not in headers or _is_own_machine(_host(headers["Host"])))
    )


def browser() -> str:
    """What tells browsers apart; "" where one takes no cookies.

    All pages of a browser have this token, until it is closed. As text it is another at every page.
    """
    token, _ = decode_xsrf_token_string(st.context.cookies.get(XSRF_COOKIE_NAME, ""))
    return token.hex() if token else ""


def _host(said: str) -> str:
    """Without its port."""
    try:
        return urlsplit(f"//{said}").hostname or ""
    except ValueError:
        return ""


def _is_own_machine(name: str) -> bool:
    try:
        return name == "localhost" or ip_address(name).is_loopback
    except ValueError:
        return False


# --- what it takes ------------------------------------------------------------------------------


_MEASURED_EVERY = 2.0  # seconds: to look at a process takes about 10 ms, and many wait to know
_MEASURING = Lock()
_measured: tuple[float, int] | None = None  # when, and bytes


def memory_used() -> int:
    """Bytes that the server and its processes take, as of a moment ago."""
    global _measured
    with _MEASURING:
        now = time.monotonic()
        if _measured is None or now - _measured[0] > _MEASURED_EVERY:
            server = psutil.Process()
            processes = (server, *server.children(recursive=True))
            _measured = (now, sum(_taken_by(process) for process in processes))
        return _measured[1]


def _taken_by(process: psutil.Process) -> int:
    """Bytes, of what it shares with others its part; where the system does not say that, all."""
    with suppress(psutil.Error):  # gone meanwhile
        if psutil.LINUX:
            with suppress(psutil.AccessDenied):
                return int(process.memory_full_info().pss)
        return int(process.memory_info().rss)
    return 0


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
