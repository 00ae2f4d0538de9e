"""The part of the page Measure that certifies."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from sarl_core import Shield, load_rules
from sarl_core.library import Library
from sarl_core.rollouts.seeds import CERTIFIED
from sarl_core.studies.certificate import certify
from sarl_core.studies.certificate_files import load_certificate
from sarl_core.studies.sequential_test import sequential_test
from sarl_dashboard.jobs import episodes as episode_jobs
from tests.app.screens import errors, finished, open_page, run_through, texts

COMPACT = {"data": "cartpole", "agents": "novice", "shields": "compact", "at_most": "20"}
RULES = Path(__file__).parents[2] / "data" / "rules" / "cartpole_compact.json"


@pytest.fixture(autouse=True)
def forgotten() -> Iterator[None]:
    """What one test has certified is no other's to look at."""
    yield
    episode_jobs.results.clear()


def test_a_shield_is_certified_and_the_certificate_is_kept(place: Path) -> None:
    app = open_page("shield", **COMPACT)
    assert "Without a failure 14 episodes certify 20 %" in texts(app)
    run_through(app, "certificate")
    assert not errors(app)
    (verdict,) = (one.value.replace("\\", "") for one in app.success)
    assert "Certified with 95 % certainty: at most 20 % of the episodes fail." in verdict
    assert "about nothing else" in verdict
    table = dict(app.dataframe[-1].value.itertuples(index=False))
    assert table["Seeds"] == f"{CERTIFIED} to {CERTIFIED + 13}"
    app.button(key="keep_certificate").click().run()
    assert not errors(app)
    with Library() as library:
        (item,) = library.items("Ada", kind="result")
        found = load_certificate(library.path(item))
    here = certify("CartPole-v1", "novice", Shield(load_rules(RULES)), at_most=0.2)
    assert (found.verdict, found.subject) == (here.verdict, here.subject)
    assert "--agent novice" in found.command
    page = open_page("library", item=item.id)
    assert "a certificate" in texts(page)
    assert "Certified with 95 % certainty" in str(page.dataframe[-1].value)
    # Whoever opens the link sees it, on another server too.
    episode_jobs.results.clear()
    again = open_page("shield", **COMPACT)
    assert "Certified" in again.success[0].value
    assert again.button(key="run_certificate").disabled


def test_rules_that_do_not_hold_are_refused() -> None:
    app = open_page("shield", data="cartpole", agents="novice", shields="filtered", at_most="10")
    run_through(app, "certificate")
    (verdict,) = (one.value.replace("\\", "") for one in app.warning if "Refused" in one.value)
    assert "more than 10 % of the episodes fail" in verdict


def test_what_was_called_off_goes_on_where_it_was() -> None:
    app = open_page("shield", **COMPACT | {"at_most": "5", "shields": "compact, two features"})
    app.button(key="run_certificate").click().run()
    app.button(key="cancel_certificate").click().run()
    finished(app, "certificate")
    assert not errors(app)
    assert not app.success
    run_through(app, "certificate")
    assert "at most 5 %" in app.success[0].value
    test = sequential_test(0.05)
    assert f"{CERTIFIED + test.certified[0] - 1}" in str(app.dataframe[-1].value)


@pytest.mark.parametrize(
    ("query", "sentence"),
    [
        (COMPACT | {"at_most": "0"}, "rate of 0 cannot be certified"),
        (COMPACT | {"at_most": "0.0001"}, "give a larger rate"),
    ],
)
def test_a_rate_that_cannot_be_tested_is_one_sentence(query: dict[str, str], sentence: str) -> None:
    app = open_page("shield", **query)
    assert [sentence in one for one in errors(app)] == [True]


def test_where_nothing_can_be_certified_the_page_says_why() -> None:
    pendulum = open_page("shield", data="pendulum", agents="novice")
    assert "There is nothing to certify: no end of this environment's episodes" in texts(pendulum)
    alone = open_page("shield", data="cartpole", agents="novice", shields="no shield")
    assert "there is none to certify" in texts(alone)
    assert not errors(pendulum)
    assert not errors(alone)


def test_a_link_to_a_line_that_is_not_chosen_falls_back_to_one_that_is() -> None:
    app = open_page("shield", **COMPACT, certify_which="nobody, nothing")
    assert not errors(app)
    assert app.selectbox(key="certify_which").value == "novice, compact"
