"""Whose name a visitor goes by, and with whom one may sign in."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from streamlit.web.server.starlette.starlette_app_utils import generate_xsrf_token_string

from sarl_core.serving.limits import VARIABLE, ServerLimits
from sarl_dashboard import session
from sarl_dashboard.components.journey import sign_in


class Visitor(dict[str, Any]):
    """What Streamlit knows of who has signed in."""

    is_logged_in = True


def name_of(monkeypatch: pytest.MonkeyPatch, **said: object) -> str:
    monkeypatch.setattr(session, "get_script_run_ctx", object)
    monkeypatch.setattr(session.st, "user", Visitor(said))
    return session.signed_in()


@pytest.mark.parametrize(
    "said",
    [
        {"name": "bob@example.org"},
        {"name": "<bob@example.org>"},
        {"name": "bob@example.org", "email": "eve@example.org"},
        {"name": "Bob <bob@example.org>", "email": "eve@example.org"},
        {"name": "Bob <bob@example.org>"},
    ],
)
def test_nobody_takes_an_address_by_being_called_so(
    monkeypatch: pytest.MonkeyPatch, said: dict[str, str]
) -> None:
    known = {
        name_of(monkeypatch, email="bob@example.org"),
        name_of(monkeypatch, name="Bob", email="bob@example.org"),
    }
    assert known == {"bob@example.org", "Bob <bob@example.org>"}
    assert name_of(monkeypatch, **said) not in {"", *known}


TOKEN = bytes(range(16))


def visitor_of(
    monkeypatch: pytest.MonkeyPatch,
    *,
    cookie: str = "",
    limits: str = "",
    address: str = "127.0.0.1",
    **headers: str,
) -> str:
    """Whom the server takes for the visitor of a page, where nobody signs in."""
    page = SimpleNamespace(session_id="this page")
    sent = SimpleNamespace(
        headers={name.replace("_", "-"): value for name, value in headers.items()},
        cookies={"_streamlit_xsrf": cookie},
    )
    monkeypatch.setattr(session, "get_script_run_ctx", lambda: page)
    monkeypatch.setattr(session.st, "context", sent)
    monkeypatch.setattr(session.config, "get_option", lambda _: address)
    monkeypatch.delenv(VARIABLE, raising=False)
    if limits:
        monkeypatch.setenv(VARIABLE, limits)
    return session.visitor()


def test_all_pages_of_a_browser_are_one_visitor(monkeypatch: pytest.MonkeyPatch) -> None:
    own, again = (generate_xsrf_token_string(TOKEN, 1) for _ in range(2))
    assert own != again  # as text
    other = generate_xsrf_token_string()
    visitors = [
        visitor_of(monkeypatch, cookie=cookie, limits="{}")
        for cookie in (own, again, other, "no token", "")
    ]
    assert visitors[0] == visitors[1]
    assert len(set(visitors)) == 3
    assert visitors[3:] == ["this page"] * 2  # which takes no cookies, and is nobody else's


def test_all_browsers_of_ones_own_machine_are_one_visitor(monkeypatch: pytest.MonkeyPatch) -> None:
    here = visitor_of(monkeypatch, cookie=generate_xsrf_token_string(), Host="localhost:8501")
    assert here == visitor_of(monkeypatch, Host="127.0.0.1:8501") != "this page"


@pytest.mark.parametrize(
    "many",
    [
        {"limits": ServerLimits().to_text()},
        {"address": "0.0.0.0"},
        {"address": ""},
        {"address": "unix:///run/sarl.sock"},
        {"Host": "sarl.example.org"},
        {"X_Forwarded_For": "192.0.2.7", "Host": "localhost"},
    ],
)
def test_who_may_come_from_elsewhere_is_told_apart(
    monkeypatch: pytest.MonkeyPatch, many: dict[str, Any]
) -> None:
    one, two = (
        visitor_of(monkeypatch, cookie=generate_xsrf_token_string(), **many) for _ in range(2)
    )
    assert one != two


@pytest.mark.parametrize(
    ("auth", "names"),
    [
        ({"client_id": "x"}, [""]),
        ({"client_id": "x", "client_kwargs": {"prompt": "login"}}, [""]),
        ({"google": {"client_id": "x"}, "okta": {"client_id": "y"}}, ["google", "okta"]),
    ],
)
def test_what_is_said_to_a_provider_is_no_provider(
    monkeypatch: pytest.MonkeyPatch, auth: dict[str, Any], names: list[str]
) -> None:
    monkeypatch.setattr(sign_in.st, "secrets", {"auth": auth})
    assert sign_in._providers() == names
