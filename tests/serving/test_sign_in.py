"""Whose name a visitor goes by, and with whom one may sign in."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import pytest
from streamlit.web.server.starlette.starlette_app_utils import generate_xsrf_token_string

from sarl_core.serving.limits import VARIABLE, ServerLimits
from sarl_dashboard import session
from sarl_dashboard.components.journey import sign_in
from sarl_dashboard.jobs.queue import JobQueue
from sarl_dashboard.views.library import at_work

VERIFIED = {"email_verified": True}


class QueryParameters(dict[str, list[str]]):
    """As Streamlit has them."""

    def get_all(self, name: str) -> list[str]:
        return self[name]


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
        name_of(monkeypatch, email="bob@example.org", **VERIFIED),
        name_of(monkeypatch, name="Bob", email="bob@example.org", **VERIFIED),
    }
    assert known == {"bob@example.org", "Bob <bob@example.org>"}
    assert name_of(monkeypatch, **said, sub="2", **VERIFIED) not in {"", *known}
    assert name_of(monkeypatch, **said, sub="2") not in {"", *known}


@pytest.mark.parametrize("verified", [{}, {"email_verified": False}, {"email_verified": "false"}])
def test_an_address_that_nobody_verified_makes_nobody_its_holder(
    monkeypatch: pytest.MonkeyPatch, verified: dict[str, Any]
) -> None:
    eve = {"iss": "https://login.example.org", "email": "bob@example.org", **verified}
    by_address, by_name = (
        name_of(monkeypatch, **eve, **more) for more in ({"sub": "1"}, {"sub": "1", "name": "Bob"})
    )
    assert re.fullmatch(r"bob at example.org \(account \w{12}\)", by_address)
    assert re.fullmatch(r"Bob \(account \w{12}\)", by_name)
    other = name_of(monkeypatch, **eve, sub="2", name="Bob")
    assert other != by_name  # of two Bobs each is one
    assert name_of(monkeypatch, **eve, sub="2", name=by_name) != by_name
    assert name_of(monkeypatch, **eve, name="Bob") == ""  # as nobody can tell which


@pytest.mark.parametrize("name", ["", "Ada", "Ada Lovelace" * 30])
def test_no_name_is_longer_than_things_can_be_kept_under(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    names = set()
    for length in (20, 150, 196, 197, 254):
        email = f"ada@{'x' * (length - 8)}.org"
        author = name_of(monkeypatch, name=name, email=email, sub=str(length), **VERIFIED)
        assert 0 < len(author) <= 200
        assert (email in author) == (length <= 196)  # never a part of one, which others may share
        names.add(author)
    assert len(names) == 5


def test_of_an_account_that_is_called_otherwise_work_stays_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    visitors, listed = [], []
    jobs = JobQueue()
    monkeypatch.setattr(at_work, "queue", lambda: jobs)
    for sub, name in (("1", "Ada Byron"), ("1", "Ada Lovelace"), ("2", "Ada Lovelace")):
        author = name_of(monkeypatch, iss="https://login.example.org", sub=sub, name=name)
        visitors.append(session.visitor())
        if not jobs.waiting:
            begun: Any = SimpleNamespace(
                **{"visitor": visitors[0], "author": author, "cancelled": False, "error": None},
                **{"page": "Measure", "address": "measure?data=cartpole", "began": 0.0},
            )
            jobs.enter(begun)
            jobs.leave(begun)
            jobs.enter(begun)
        listed.append((len(at_work._of(author)), len(at_work._ended(author))))
    assert visitors[0] == visitors[1] != visitors[2]
    assert listed == [(1, 1), (1, 1), (0, 0)]


def test_who_comes_back_from_signing_in_sees_what_was_wanted_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = 0.0
    monkeypatch.setattr(sign_in.time, "monotonic", lambda: now)
    monkeypatch.setattr(session, "is_signed_in", lambda: True)
    monkeypatch.setattr(sign_in.st, "session_state", {})

    def wanted(browser: str, **query: list[str]) -> Any:
        monkeypatch.setattr(session, "browser", lambda: browser)
        if query:
            monkeypatch.setattr(sign_in.st, "query_params", QueryParameters(query))
            sign_in._remember("rules")
        return sign_in.link_before_sign_in

    came_back = wanted("one", rule=["3", "4"])
    assert wanted("two")() is None
    wanted("one")
    assert (came_back().page, came_back()) == ("rules", None)
    came_back = wanted("one", rule=["3"])
    now = 4000.0  # by then it is another visit
    assert came_back() is None


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
    monkeypatch.setattr(sign_in.providers, "section", lambda: auth)
    assert sign_in._providers() == names
