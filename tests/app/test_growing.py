"""Trees of many states grow beside the page, which says so and lets one call it off."""

from __future__ import annotations

import time

import pytest
from streamlit.testing.v1 import AppTest

from sarl_dashboard.cache import RESULTS
from sarl_dashboard.jobs import growing
from tests.app.growing_work import failing, slow
from tests.app.screens import errors, metrics, open_page, page_file, texts

WAIT = 60.0


@pytest.fixture(autouse=True)
def many(monkeypatch: pytest.MonkeyPatch) -> None:
    """The shipped states count as many, and no tree of theirs is there."""
    monkeypatch.setattr(growing, "EXACT_UP_TO", 1_000)
    RESULTS.clear()


def work_of(app: AppTest) -> growing.Job[growing.Trees]:
    job: growing.Job[growing.Trees] = app.session_state["_job_growing"]
    return job


def test_a_page_waits_for_the_tree_and_goes_on_by_itself() -> None:
    app = open_page("thresholds", data="cartpole")
    if not app.select_slider:  # it may be there already
        assert app.title[0].value == "Thresholds"
        until = time.monotonic() + WAIT
        while work_of(app).running and time.monotonic() < until:
            time.sleep(0.1)
        app.run()
    assert metrics(app)["Rules"] != "0"
    job = work_of(app)
    app.switch_page(page_file("rules")).run()
    assert not app.exception
    assert work_of(app) is job  # grown once, for all pages


def test_it_says_how_long_it_takes_and_can_be_called_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "grow_structures", slow)
    app = open_page("rules", data="cartpole")
    assert app.title[0].value == "Rules"
    assert not app.dataframe
    until = time.monotonic() + WAIT
    while "15,000 states" not in work_of(app).text and time.monotonic() < until:
        time.sleep(0.1)
    assert "s of about" in work_of(app).text
    app.run()
    app.button(key="cancel_growing").click().run()
    assert "Cancelled" in texts(app)
    assert not work_of(app).running
    # Pages that need no rules are open all the while, and it does not begin again by itself.
    app.switch_page(page_file("demonstrations")).run()
    assert "15,000" in texts(app)
    app.switch_page(page_file("rules")).run()
    assert "Cancelled" in texts(app)
    monkeypatch.undo()
    monkeypatch.setattr(growing, "EXACT_UP_TO", 1_000)
    app.button(key="run_growing").click().run()
    while work_of(app).running and time.monotonic() < until:
        time.sleep(0.1)
    app.run()
    assert "Cancelled" not in texts(app)
    assert not app.exception


def test_what_went_wrong_is_said_with_a_way_to_try_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "grow_structures", failing)
    app = open_page("rules", data="cartpole")
    until = time.monotonic() + WAIT
    while work_of(app).running and time.monotonic() < until:
        time.sleep(0.1)
    app.run()
    assert errors(app) == ["The memory is full; close something."]
    assert app.button(key="run_growing").label == "Grow the tree"


def test_a_choice_that_asks_for_a_tree_nobody_wants_is_taken_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(growing, "grow_structures", slow)
    choices = {"learner": "histogram", "holdout": "0.2", "combine": "every"}
    app = open_page("rules", data="cartpole", **choices)
    labels = {
        "learner": "Choose the learner automatically",
        "holdout": "Hold out no episodes",
        "combine": "Combine no features",
    }
    assert not [button for button in app.button if button.label in labels.values()]
    for name, label in labels.items():
        app.button(key="cancel_growing").click().run()
        assert not app.exception
        (button,) = (button for button in app.button if button.label == label)
        button.click().run()
        assert name not in app.query_params
        assert work_of(app).running  # the tree that is asked for now
    app.button(key="cancel_growing").click().run()
    assert not [button for button in app.button if button.label in labels.values()]


def test_of_many_states_nobody_waits_for_all_rules_to_compare_with() -> None:
    app = open_page("difference", data="cartpole", support="0.02")
    until = time.monotonic() + WAIT
    while work_of(app).running and time.monotonic() < until:
        time.sleep(0.1)
    app.run()
    assert app.multiselect(key="_sets_choice").value == ["in force", "filtered"]
    assert not app.exception
