"""Large files are read beside the page, which says so and lets one call it off."""

from __future__ import annotations

import errno
import threading
import time
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations
from sarl_dashboard.views.demonstrations import stored_files
from sarl_dashboard.views.demonstrations import upload as view
from tests.app.screens import ROUTER, errors, metrics, open_page, page_file, texts
from tests.app.test_demonstrations_page import upload
from tests.bad_inputs import ROWS, csv_bytes

WAIT = 60.0


@pytest.fixture(autouse=True)
def large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every file counts as large."""
    monkeypatch.setattr(view, "_AT_ONCE", 0)


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """Reading goes on for as long as the test wants."""
    go_on, read = threading.Event(), view._read

    def waiting(*given: Any) -> object:
        assert go_on.wait(WAIT)
        return read(*given)

    monkeypatch.setattr(view, "_read", waiting)
    yield go_on
    go_on.set()


def finished(app: AppTest) -> AppTest:
    until = time.monotonic() + WAIT
    while app.session_state["_job_reading"].running and time.monotonic() < until:
        time.sleep(0.05)
    return app.run()


def test_what_was_read_is_chosen_when_it_is_there() -> None:
    app = finished(upload(open_page("demonstrations"), ("mine.csv", csv_bytes(*ROWS))))
    assert not app.exception
    assert not errors(app)
    assert metrics(app)["Steps"] == "5"
    app.run()
    assert metrics(app)["Steps"] == "5"


def test_reading_is_called_off_at_once_and_begun_again(slow: threading.Event) -> None:
    app = upload(open_page("demonstrations", data="cartpole"), ("mine.csv", csv_bytes(*ROWS)))
    before = app.session_state["_job_reading"]
    assert metrics(app)["Steps"] == "15,000"  # what is chosen stays on the page
    app.button(key="cancel_reading").click().run()
    assert "what was chosen before still is" in texts(app)
    assert not before.running
    slow.set()
    app.button(key="run_reading").click().run()
    assert metrics(finished(app))["Steps"] == "5"
    assert "Cancelled" not in texts(app)


def test_a_file_that_is_taken_away_is_not_read_any_further(slow: threading.Event) -> None:
    app = upload(open_page("demonstrations"), ("mine.csv", csv_bytes(*ROWS)))
    job = app.session_state["_job_reading"]
    app.file_uploader(key="upload_files").set_value([]).run()
    assert job.cancelled
    slow.set()
    app.run()
    assert not app.exception
    assert metrics(app)["Steps"] == "15,000"


def progress(app: AppTest) -> str:
    return " ".join(bar.proto.text for bar in app.get("progress"))


@pytest.mark.parametrize("looked", [True, False])
def test_reading_goes_on_when_the_page_is_left(slow: threading.Event, *, looked: bool) -> None:
    app = upload(open_page("demonstrations", data="cartpole"), ("my_own.csv", csv_bytes(*ROWS)))
    job = app.session_state["_job_reading"]
    app.switch_page("library.py").run()
    if looked:
        app.switch_page("demonstrations.py").run()
        assert not app.file_uploader(key="upload_files").value
        assert "Reading my\\_own.csv" in progress(app)
        app.button(key="cancel_reading").click().run()
        assert job.cancelled
        app.button(key="run_reading").click().run()  # of the same file
        assert metrics(app)["Steps"] == "15,000"
    slow.set()
    finished(app).switch_page("demonstrations.py").run()
    assert not app.exception
    assert not errors(app)
    assert metrics(app)["Steps"] == "5"
    assert app.query_params["data"] not in ("upload", "cartpole")


def test_a_page_that_was_left_helps_with_what_is_wrong_with_the_file(
    slow: threading.Event,
) -> None:
    content = csv_bytes(*ROWS, header="episode,step,obs_x,obs_y,thrust")
    app = upload(open_page("demonstrations"), ("mine.csv", content))
    app.switch_page("library.py").run()
    slow.set()
    finished(app).switch_page("demonstrations.py").run()
    assert errors(app)[0].startswith("mine.csv: there is no action")
    assert app.toggle(key="map_columns").value


def test_another_page_finds_what_is_read_and_the_library_keeps_it(slow: threading.Event) -> None:
    # A name that no other test uploads.
    left = upload(open_page("demonstrations", data="cartpole"), ("left.csv", csv_bytes(*ROWS[:4])))
    job = left.session_state["_job_reading"]
    assert "left.csv" in progress(open_page("library", data="cartpole"))
    anew = open_page("demonstrations", data="cartpole")  # as after it was loaded anew
    assert anew.session_state["_job_reading"] is job
    assert "Reading left.csv" in progress(anew)
    slow.set()
    finished(left)  # and nothing looks at it
    later = AppTest.from_file(ROUTER, default_timeout=120)
    later.query_params["data"] = job.address.removeprefix("demonstrations?data=")
    later.run().switch_page(page_file("demonstrations")).run()
    assert metrics(later)["Steps"] == "4"


def test_what_is_wrong_with_a_large_file_is_one_sentence_and_the_form_helps() -> None:
    content = csv_bytes(*ROWS, header="episode,step,obs_x,obs_y,thrust")
    app = finished(upload(open_page("demonstrations"), ("mine.csv", content)))
    assert len(errors(app)) == 1
    assert errors(app)[0].startswith("mine.csv: there is no action")
    assert app.toggle(key="map_columns").value


def test_what_a_reader_did_not_foresee_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> Demonstrations:
        raise ZeroDivisionError

    monkeypatch.setattr(view, "read_files", broken)
    app = finished(upload(open_page("demonstrations"), ("mine.csv", csv_bytes(*ROWS))))
    assert "does not know why (ZeroDivisionError)" in errors(app)[0]


def test_the_session_holds_no_content_of_a_file_whose_name_stands_there() -> None:
    app = finished(upload(open_page("demonstrations"), ("mine.csv", csv_bytes(*ROWS))))
    (stored,) = app.session_state["_stored_files"].values()
    assert bytes(stored.getvalue()) == csv_bytes(*ROWS)
    assert all(not getattr(one, "getvalue", bytes)() for one in app.session_state["upload_files"])
    # And what Streamlit then takes for another file is not read another time.
    job = app.session_state["_job_reading"]
    app.run()
    assert app.session_state["_job_reading"] is job


def test_where_the_disk_is_full_an_upload_stays_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(stored_files, "tempfile", SimpleNamespace(TemporaryFile=full))
    app = finished(upload(open_page("demonstrations"), ("mine.csv", csv_bytes(*ROWS))))
    assert not app.exception
    assert not errors(app)
    assert metrics(app)["Steps"] == "5"
    (stored,) = app.session_state["_stored_files"].values()
    assert bytes(stored.getvalue()) == csv_bytes(*ROWS)
