"""Whose name a visitor goes by, and with whom one may sign in."""

from __future__ import annotations

from typing import Any

import pytest

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
