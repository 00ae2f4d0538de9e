"""A dashboard for many: two people sign in, work takes turns, and whoever runs it can watch."""

from __future__ import annotations

import json
import re
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from sarl_core.serving.limits import VARIABLE, ServerLimits
from tests.browser.conftest import PATIENCE, dashboard
from tests.browser.identity import identity_provider, secrets_text
from tests.browser.walking import no_trace, visit

PEOPLE = {
    "ada": {"name": "Ada <bob@example.org>", "email": "ada@example.org", "email_verified": True},
    "bob": {"name": "", "email": "bob@example.org", "email_verified": True},
    "eve": {"name": "Eve", "email": "bob@example.org", "email_verified": False},
    "nobody": {},
}
LIMITS = ServerLimits(jobs=2, jobs_each=1)
LONG = "/improve?data=cartpole&rounds=200&max_rules=5"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("server")


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[str]:
    (folder / ".streamlit").mkdir()
    with identity_provider(PEOPLE) as provider:
        text = secrets_text(provider, "http://127.0.0.1:{port}")
        (folder / ".streamlit" / "secrets.toml").write_text(text)
        with dashboard(folder, SARL_LOG="json", **{VARIABLE: LIMITS.to_text()}) as url:
            yield url


def signed_in(chromium: Browser, server: str, person: str) -> Page:
    context = chromium.new_context(base_url=server, viewport={"width": 1440, "height": 900})
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto("/library?data=cartpole")
    expect(page.get_by_role("heading", name="Sign in", level=1)).to_be_visible()
    assert page.get_by_role("link", name="Library").count() == 0
    page.get_by_role("button", name="Sign in").click()
    page.get_by_role("link", name=person, exact=True).click()
    expect(page.get_by_role("button", name="Sign out")).to_be_visible()
    return page


def begin(page: Page, address: str) -> None:
    page.goto(address)  # it does not stand still where work goes on that it shows
    page.get_by_test_id("stMain").get_by_role("button", name="Run", exact=True).click()


def test_two_people_have_work_and_things_of_their_own(chromium: Browser, server: str) -> None:
    ada, bob = signed_in(chromium, server, "ada"), signed_in(chromium, server, "bob")
    # Nobody takes the name of somebody else. (After @ stands what keeps it from being a link.)
    expect(
        ada.get_by_text(re.compile("Signed in as Ada bob@.example.org <ada@.example.org>"))
    ).to_be_visible()
    expect(bob.get_by_text(re.compile("Signed in as bob@.example.org"))).to_be_visible()
    begin(ada, LONG)
    expect(ada.get_by_text(re.compile(r"Round \d+ of 200")).first).to_be_visible()
    begin(ada, LONG + "&round_episodes=11")
    expect(ada.get_by_text("you run 1 job (Improve), as many as one visitor may")).to_be_visible()
    begin(bob, "/measure?data=cartpole&episodes=2&agents=novice&shields=no+shield")
    expect(bob.get_by_text("all done already")).to_be_visible(timeout=4 * PATIENCE)
    visit(bob, "/library", "Library")
    expect(bob.get_by_text("Ended just now.")).to_be_visible()
    assert bob.get_by_text("of 200").count() == 0
    other = ada.context.new_page()
    ada.close()
    visit(other, "/library", "Library")
    for left in (2, 1):
        expect(other.get_by_role("button", name="Cancel")).to_have_count(left)
        other.get_by_role("button", name="Cancel").first.click()
    expect(other.get_by_role("button", name="Cancel")).to_have_count(0)
    for page in (other, bob):
        no_trace(page)
        page.context.close()


def test_signing_in_leads_to_the_link_and_an_unverified_address_is_nobodys(
    chromium: Browser, server: str
) -> None:
    page = signed_in(chromium, server, "eve")
    expect(page.get_by_role("heading", name="Library", level=1)).to_be_visible()
    expect(page).to_have_url(f"{server}/library?data=cartpole")
    expect(page.get_by_text(re.compile(r"Signed in as Eve \(account \w{12}\)"))).to_be_visible()
    page.context.close()


def test_who_signs_in_without_a_name_is_told(chromium: Browser, server: str) -> None:
    page = signed_in(chromium, server, "nobody")
    expect(page.get_by_text("You have signed in without a name")).to_be_visible()
    assert page.get_by_role("link", name="Overview").count() == 0
    page.get_by_role("button", name="Sign out").click()
    expect(page.get_by_role("heading", name="Sign in", level=1)).to_be_visible()
    page.context.close()


def test_whoever_runs_it_can_watch(server: str, folder: Path) -> None:
    with urllib.request.urlopen(f"{server}/health") as answer:
        assert json.load(answer)["status"] == "ok"
    with urllib.request.urlopen(f"{server}/metrics") as answer:
        lines = [line for line in answer.read().decode().splitlines() if line[0] != "#"]
    numbers = {name: float(value) for name, value in map(str.split, lines)}
    assert numbers["sarl_memory_bytes"] > 10e6
    assert {"sarl_sessions", "sarl_jobs_running", "sarl_jobs_waiting"} <= set(numbers)
    logged = [line for line in (folder / "log.txt").read_text().splitlines() if line[:1] == "{"]
    assert {"time", "level", "logger", "message"} <= set(json.loads(logged[0]))
