"""What visitors and whoever runs it see of a server that was set up as the example says."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from socket import create_connection

from playwright.sync_api import Browser, BrowserContext, Page, Response, expect, sync_playwright

from benchmarks.chromium import ARGUMENTS, CHROMIUM, PATIENCE, WATCH, settle
from benchmarks.deployment.machines import ADDRESSES, DOMAIN, Deployment
from benchmarks.measure import Row
from benchmarks.visitor_client import VisitorClient
from benchmarks.visitors import (
    LONG,
    PAGE,
    QUERY,
    SLIDER,
    VISITORS,
    begin_work,
    metric,
    move_rows,
    moved,
)

SERVER = f"https://{DOMAIN}"
PEOPLE = {
    name.lower(): {"name": name, "email": f"{name.lower()}@example.org", "email_verified": True}
    for name in ("Ada", "Bob", *(f"Visitor{number:02}" for number in range(VISITORS - 2)))
}
_DIRECT = f"http://{ADDRESSES['dashboard']}:8501"
_LANDER, _POLE = "data=lunar_lander", "data=cartpole"
_KEPT = "Ada's rules"
_PAGES = {
    **{"": _LANDER, "demonstrations": _LANDER, "names": _LANDER, "thresholds": _LANDER},
    **{"rules": _LANDER, "what_if": _LANDER, "evidence": _LANDER, "edit": _LANDER},
    **{"compare": _LANDER, "replay": _POLE + "&agent=novice&seed=1", "episodes": _POLE},
    **{"measure": _POLE, "worth": _POLE, "audit": _POLE, "export": _LANDER, "report": _LANDER},
    **{"improve": _POLE, "learning": _POLE, "paper": "", "library": _LANDER},
}


def visited(deployment: Deployment, moves: int) -> Iterator[Row]:
    """Start the dashboard and look at all of it.

    Args:
        deployment: Its database and proxy run.
        moves: Of the visitor in a browser, while others move too.

    Yields:
        What was measured.

    Raises:
        AssertionError: If something is not as it should be.
    """
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=CHROMIUM,
            args=[*ARGUMENTS, f"--host-resolver-rules=MAP {DOMAIN} {ADDRESSES['proxy']}"],
        )
        with deployment.dashboard() as server:
            _watched(deployment)
            ada, bob = _signed_in(browser, "ada"), _signed_in(browser, "bob")
            _protected(ada)
            _every_page(ada)
            kept = _shared(ada, bob)
            _turns(ada, bob)
            yield from _many(deployment, browser, ada, moves)
            server.kill()  # as where the power fails
        with deployment.dashboard():
            page = ada.new_page()
            _open(page, "library", kept)
            page.get_by_role("heading", name=_KEPT, level=2).wait_for()
            _seen("after a sudden end the server starts, and what was kept is there")
        browser.close()
    assert "Traceback" not in deployment.log.read_text(), deployment.log
    _seen("no trace in the log")


def _seen(what: str) -> None:
    print(f"seen: {what}", flush=True)


def _output(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True).stdout


def _watched(deployment: Deployment) -> None:
    """Whoever runs it can watch it, and visitors cannot."""
    assert deployment.health() == "", deployment.health()
    curl = ["curl", "--insecure", "--silent", "--output", "/dev/null", "--write-out"]
    curl += ["%{http_code}"]
    near = ["ip", "netns", "exec", "proxy", *curl]
    far = [*curl, "--resolve", f"{DOMAIN}:443:{ADDRESSES['proxy']}"]
    for path in ("health", "metrics"):
        assert _output(*near, f"https://127.0.0.1/{path}") == "200", path
        assert _output(*far, f"{SERVER}/{path}") == "403", path
    assert _output(*far, f"{SERVER}/_stcore/metrics") == "403"
    with create_connection((ADDRESSES["proxy"], 443)) as plain:
        deployment.trust.wrap_socket(plain, server_hostname=DOMAIN).close()
    _seen("the container's check passes; health and metrics are for the proxy's machine alone")


def _signed_in(browser: Browser, person: str) -> BrowserContext:
    context = browser.new_context(
        ignore_https_errors=True, viewport={"width": 1440, "height": 900}, base_url=SERVER
    )
    context.set_default_timeout(2 * PATIENCE)
    context.add_init_script(WATCH)
    page = context.new_page()
    page.goto(f"/{PAGE}?{QUERY}")
    page.get_by_role("button", name="Sign in").click()
    page.get_by_role("link", name=person, exact=True).click()
    page.get_by_role("button", name="Sign out").wait_for()
    expect(page).to_have_url(re.compile(rf"/{PAGE}\?.*{QUERY}"))
    page.close()
    return context


def _protected(context: BrowserContext) -> None:
    """What the browser is told keeps pages out of others' frames; cookies are for the server."""
    page = context.new_page()
    answer = page.goto(f"/{PAGE}?{QUERY}")
    assert answer is not None
    headers = answer.all_headers()
    assert headers["x-frame-options"] == "DENY"
    assert "frame-ancestors 'none'" in headers["content-security-policy"]
    cookies = context.cookies()
    signed = [one for one in cookies if one["name"].startswith("_streamlit_user")]
    assert signed
    assert all(one["httpOnly"] for one in signed)
    assert all(one["secure"] for one in signed), "the cookie of who signed in is sent unencrypted"
    page.close()
    _seen("two people signed in through the proxy and came to the link that they had opened")


def _open(page: Page, name: str, query: str) -> None:
    page.goto(f"/{name}?{query}")
    page.get_by_role("heading", level=1).first.wait_for()
    settle(page)


def _every_page(context: BrowserContext) -> None:
    """Pages show no exception, and the browser holds nothing back that they bring."""
    page = context.new_page()
    held = list[str]()
    page.on("console", lambda one: held.append(one.text) if _is_against_us(one.text) else None)
    page.on("pageerror", lambda one: held.append(str(one)))
    page.on("response", lambda one: held.append(one.url) if _is_missing(one) else None)
    for name, query in _PAGES.items():
        _open(page, name, query)
        assert page.get_by_test_id("stException").count() == 0, name
        assert not held, (name, held)
    _open(page, "replay", _PAGES["replay"])
    page.get_by_role("heading", name="Flight recorder").wait_for()  # an episode was played
    settle(page)
    assert not held, held
    page.close()
    _seen(f"{len(_PAGES)} pages without an exception or a word of the browser against them")


def _is_against_us(word: str) -> bool:
    """Whether a word of the browser is of something that it did not let a page do."""
    return word.startswith("Refused") or "Content Security Policy" in word


def _is_missing(answer: Response) -> bool:
    """Whether a page did not get what it needs."""
    # Streamlit looks below the page's own address first for where its server is.
    looks = re.search(r"/\w+/_stcore/(health|host-config)$", answer.url)
    return answer.status >= 400 and not looks


def _shared(ada: BrowserContext, bob: BrowserContext) -> str:
    """What one keeps in the database, the other finds once it is shared, and not before."""
    page = ada.new_page()
    _open(page, "export", _POLE)
    page.get_by_role("textbox", name="Keep in the library as").fill(_KEPT)
    page.get_by_role("button", name="Keep", exact=True).first.click()
    page.get_by_role("link", name="Kept").click()
    page.get_by_text("Shared with all").first.wait_for()
    settle(page)
    kept = page.url.partition("?")[2]
    other = bob.new_page()
    for shared in (False, True):
        if shared:
            page.get_by_text("Shared with all").first.click()
            settle(page)
        _open(other, "library", _POLE)
        assert other.locator("td", has_text=_KEPT).count() == shared
    assert other.locator("td", has_text="Ada <ada@example.org>").count()
    page.close()
    other.close()
    _seen("what Ada keeps is hers in PostgreSQL, and Bob finds it once it is shared")
    return kept


def _turns(ada: BrowserContext, bob: BrowserContext) -> None:
    """Work goes on when its page is closed, and is for whoever began it to call off."""
    begin_work(ada.new_page(), LONG)
    page, other = ada.new_page(), bob.new_page()
    for one, cancels in ((page, 1), (other, 0)):
        _open(one, "library", _POLE)
        expect(one.get_by_role("button", name="Cancel")).to_have_count(cancels)
    _open(other, "measure", f"{_POLE}&episodes=2&agents=novice&shields=no+shield")
    other.get_by_test_id("stMain").get_by_role("button", name="Run", exact=True).click()
    other.get_by_text("all done already").wait_for()
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_role("button", name="Cancel")).to_have_count(0)
    page.close()
    other.close()
    _seen("work of one goes on with its page closed, beside that of another; its owner ends it")


def _many(
    deployment: Deployment, browser: Browser, ada: BrowserContext, moves: int
) -> Iterator[Row]:
    """Twenty people who have signed in, one of them in a browser, while rules are improved."""
    begin_work(ada.new_page(), LONG)
    page = ada.new_page()
    _open(page, PAGE, QUERY)
    with ExitStack() as opened:
        clients = []
        for person in list(PEOPLE)[1:]:
            context = _signed_in(browser, person)
            cookies = {one["name"]: one["value"] for one in context.cookies(SERVER)}
            context.close()
            door = {
                "sock": create_connection((ADDRESSES["proxy"], 443)),
                "ssl": deployment.trust,
            }
            client = VisitorClient(SERVER, PAGE, QUERY, SLIDER, cookies=cookies, door=door)
            clients.append(opened.enter_context(client))
        in_browser, others = moved(page, clients, moves)
        at_work, sessions = (metric(_DIRECT, f"sarl_{one}") for one in ("jobs_running", "sessions"))
        memory = metric(_DIRECT, "sarl_memory_bytes")
        errors = sum(client.errors for client in clients)
        errors += page.get_by_test_id("stException").count()
    page.close()
    assert sessions >= VISITORS, f"only {sessions} of {VISITORS} pages are open"
    _seen(f"{sessions:.0f} pages open, {at_work:.0f} job, {memory / 1e6:,.0f} MB in all processes")
    yield from move_rows(in_browser, others, errors, at_work == 1 and not errors)
