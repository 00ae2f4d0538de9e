"""Uploading demonstrations: files, the environment they are from, and which column is what."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import ColumnPreview, ColumnRole, read_files
from sarl_core.demonstrations.formats.missing import Missing
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.shared import in_shared_memory
from sarl_core.environments.environment import Environment
from sarl_core.errors import InputError, SarlError
from sarl_core.memory import release
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.distributed.mined_files import is_mined_file, read_mined_data
from sarl_core.mining.language import counted
from sarl_core.processes import run_each
from sarl_dashboard.components.column_form import ColumnForm, previews_of
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs.job import Job, Place
from sarl_dashboard.jobs.queue import memory_shortage
from sarl_dashboard.state import library
from sarl_dashboard.state.data import set_upload, steps_of, uncombined_demonstrations
from sarl_dashboard.state.environments import registered, usual_environments
from sarl_dashboard.state.url import with_own
from sarl_dashboard.text import refuse
from sarl_dashboard.views.demonstrations.stored_files import StoredFile, stored_files

_UPLOADER = "upload_files"
_LEFT_OUT = "--missing drop"  # what an error says where steps that lack a value can be left out
_Looked = dict[tuple[str, ...], Sequence[ColumnPreview]]  # by the ids of the files
_LOGGER = logging.getLogger(__name__)
_AT_ONCE = 20_000_000  # bytes that are read while one waits
_BYTES_A_SECOND = 30_000_000  # of text, which takes longest
_MOST = 0.95  # of a bar that only knows how long such work usually takes


class _Request(NamedTuple):
    """What is to be read, and how."""

    files: Sequence[StoredFile]
    columns: Mapping[str, ColumnRole] | None
    env_id: Environment | None
    missing: Missing

    @property
    def name(self) -> str:
        """Of what is read."""
        return ", ".join(file.name for file in self.files)

    @property
    def title(self) -> str:
        """The same, short however many files there are."""
        others = len(self.files) - 1
        first = self.files[0].name
        return f"{first} and {counted(others, 'other file')}" if others else first


@dataclass(frozen=True, eq=False)
class LargeUpload:
    """Large files that are read beside the page, and what came of it so far.

    Attributes:
        request: What is to be read.
        previews: Of the columns; None while nobody has looked at them.
        upload: What was read; None while it is not.
    """

    request: _Request
    previews: Sequence[ColumnPreview] | None
    upload: Demonstrations | MinedData | None = None


PLACE = Place[LargeUpload]("reading")
_ANY = "upload"  # whichever files they are: a page that was left does not know them any more


def uploaded_files() -> Sequence[StoredFile]:
    """The files in the uploader; where the page was left, which empties it, those being read."""
    reading = PLACE.job.result if PLACE.job is not None else None
    return stored_files(_UPLOADER) or (reading.request.files if reading is not None else ())


def read_upload(columns: Mapping[str, ColumnRole] | None = None) -> None:
    """Read what was uploaded; keep what was chosen before where that fails.

    Args:
        columns: Which column is what; guessed where not given.
    """
    st.session_state.pop("_upload_error", None)
    st.session_state["_upload_columns"] = columns
    files = uploaded_files()
    if not files:
        return
    try:
        if shortage := memory_shortage():
            raise InputError(f"{shortage}, so nothing is read now; try again in a few minutes")
        request = _request()
        if sum(file.size for file in files) > _AT_ONCE:
            PLACE.begin(_job_of(request))
            return
        with st.spinner("Reading and checking …"):
            upload = _read(request)
    except SarlError as error:
        PLACE.clear()
        st.session_state["_upload_error"] = str(error)
        return
    _take(upload, request.name)


def _take(upload: Demonstrations | MinedData, name: str) -> None:
    """Keep what was read, and choose it."""
    release()  # what reading has left, before writing needs room
    with st.spinner("Keeping it in the library …"):
        set_upload(upload, file_name=name)
    release()
    st.toast(f"Read {steps_of(upload).whole.steps:,} steps.", icon=":material/check:")


def _request() -> _Request:
    """What the uploader holds, with what is said of it."""
    return _Request(
        uploaded_files(),
        st.session_state.get("_upload_columns"),
        environment(),
        "drop" if st.session_state.get("upload_missing") else "refuse",
    )


def _read(request: _Request) -> Demonstrations | MinedData:
    files = [(file.getvalue(), file.name) for file in request.files]
    try:
        if not any(is_mined_file(name) for _, name in files):
            # At once, so that nobody holds them twice.
            return in_shared_memory(
                read_files(
                    files, env_id=request.env_id, columns=request.columns, missing=request.missing
                )
            )
        (content, name), *others = files
        if others:
            raise InputError(
                f"{len(files)} files: a mined file holds everything by itself; upload it alone"
            )
        with naming(name):
            return read_mined_data(content)
    except SarlError:
        raise
    except Exception as error:  # whatever a reader did not foresee, what was chosen before stays
        _LOGGER.exception("An upload could not be read")
        raise InputError(
            f"{files[0][1]}: it cannot be read, and this program does not know why "
            f"({type(error).__name__}); save it again in another format"
        ) from error


def _job_of(request: _Request) -> Callable[[], Job[LargeUpload]]:
    """What begins to read large files beside the page."""
    looked: _Looked = st.session_state.get("_upload_previews", {})
    reading = LargeUpload(request, looked.get(_ids(request.files)))
    size = sum(file.size for file in request.files)

    def work(job: Job[LargeUpload]) -> None:
        begun = time.monotonic()

        def progress(done: int, total: int) -> bool:
            seconds = time.monotonic() - begun
            job.text = f"Reading {request.title} ({size / 1e6:,.0f} MB): {seconds:.0f} s"
            job.done = min(seconds * _BYTES_A_SECOND / size, _MOST)
            return job.wanted()

        # A thread: what it has read is many times as large as what is said of it, and whoever calls
        # it off need not wait for its end.
        executor = ThreadPoolExecutor(1)
        previews = reading.previews
        try:
            if previews is None:  # at first: beside what is read they need too much room
                (previews,) = run_each(
                    previews_of, [(request.files,)], executor=executor, progress=progress
                )
                job.result = replace(reading, previews=previews)
                release()
            (upload,) = run_each(_read, [(request,)], executor=executor, progress=progress)
        finally:
            executor.shutdown(wait=False)
        release()
        job.text = f"Keeping {request.title} in the library …"
        with suppress(SarlError):  # a page that looks says that keeping fails
            job.address = f"demonstrations?data={library.upload_item(upload, request.name).id}"
        job.result = LargeUpload(request, previews, upload)

    return lambda: Job(_ANY, work, 1, reading, lasts=True)


def _ids(files: Sequence[StoredFile]) -> tuple[str, ...]:
    return tuple(file.file_id for file in files)


def _find_reading() -> None:
    """Look at what this visitor has left being read, where nothing else is uploaded here."""
    if not stored_files(_UPLOADER) and PLACE.find_again(_ANY):
        job = PLACE.job
        assert job is not None
        assert job.result is not None
        st.session_state["_upload_columns"] = job.result.request.columns


def _show_reading() -> bool:
    """How far reading beside the page is, or that it was called off; whether either is so."""
    job = PLACE.job
    if job is None:
        return False
    running = job.running
    if not (running or job.cancelled):
        if _finish(job):
            st.rerun()
        return False
    offer = Offer(
        key=job.key,
        start=lambda: _job_of(_request())(),
        about="Large files are read beside the page.",
        complete=False,
        cancelled="Cancelled. Nothing has changed: what was chosen before still is.",
        label="Read",
    )
    watched(PLACE, lambda _: run_bar(PLACE, offer), missed=running)
    return True


def _finish(job: Job[LargeUpload]) -> bool:
    """Take what was read, or what was wrong with it; whether that was still to be done."""
    if not (job.is_here or job.is_left):
        PLACE.clear()  # another page of this visitor takes it
        return True
    reading, error = job.result, job.error
    if reading is None or (reading.upload is None and error is None):
        return False
    if reading.previews is not None:
        st.session_state["_upload_previews"] = {_ids(reading.request.files): reading.previews}
    if reading.upload is not None:
        job.result = None
        _take(reading.upload, reading.request.name)
    else:
        job.error = None
        st.session_state["_upload_error"] = str(error)
    if not st.session_state.get("_upload_mapped"):
        _form().open_for(st.session_state.get("_upload_error"))
    return True


def _read_again() -> None:
    """Read again with the columns that were mapped, if any were."""
    read_upload(st.session_state.get("_upload_columns"))


def environment() -> Environment | None:
    """The environment that names and bounds are taken from, None for none.

    Raises:
        InputError: If the dashboard does not take it.
    """
    env_id = str(st.session_state.get("upload_env") or "").strip()
    return registered(env_id) if env_id else None


def _form() -> ColumnForm:
    looked: _Looked = st.session_state.get("_upload_previews", {})
    files = uploaded_files()
    return ColumnForm.of_files("map", files, previews=looked.get(_ids(files)))


def _read_mapped() -> None:
    """Read again, with the columns as they stand in the form."""
    try:
        roles = _form().roles()
    except InputError as error:
        st.session_state["_upload_error"] = str(error)
        return
    finally:
        st.session_state["_upload_mapped"] = True
    read_upload(roles)


def read_new_upload() -> None:
    """Read what was uploaded just now; open the form where the columns are not clear."""
    # Streamlit calls a file whose content it no longer has another one, and says so once.
    uploaded = _ids(stored_files(_UPLOADER))
    if uploaded and uploaded == st.session_state.get("_upload_ids"):
        return
    PLACE.clear()  # it is about other files
    st.session_state["_upload_ids"] = uploaded
    st.session_state["_upload_mapped"] = False
    read_upload()
    if not PLACE.at_work:
        _form().open_for(st.session_state.get("_upload_error"))


def upload_section(*, expanded: bool) -> None:
    """Upload files, say what is wrong with them, map their columns."""
    _find_reading()
    with st.expander(
        "Use your own demonstrations",
        icon=":material/upload_file:",
        expanded=expanded or bool(uploaded_files()),
    ):
        left, right = st.columns([3, 2], gap="medium")
        left.file_uploader(
            "A file, several of one kind, or the ZIP of a folder",
            accept_multiple_files=True,
            key=_UPLOADER,
            on_change=read_new_upload,
            help=with_words(
                "Parquet, CSV, TSV, JSON lines, Arrow, Excel, HDF5 (D4RL) or NPZ, text also as "
                ".gz; the pair obs.csv and actions.csv; one file an episode; the ZIP of a folder "
                "as Minari, LeRobot or Hugging Face's datasets write it. A table has one row a "
                "step: episode, step, obs_<name> …, action or action_<name> …, and if there are "
                "any reward, terminated, truncated. Or a .mined file, which is what a cluster "
                "leaves of more steps than fit into memory."
            ),
        )
        right.selectbox(
            "Environment (optional)",
            with_own(usual_environments(), "upload_env"),
            index=None,
            accept_new_options=True,
            placeholder="none",
            key="upload_env",
            on_change=_read_again,
            bind="query-params",
            help=with_words(
                "Names, units and bounds are taken from it where the file has none. Any id "
                "that Gymnasium knows."
            ),
        )
        if _show_reading():
            return
        form = _form()
        # What is wrong with a choice in the form stands beside its button.
        in_form = form.is_open and bool(st.session_state.get("_upload_mapped"))
        if not in_form:
            _problem()
        form.draw(_read_mapped, _problem if in_form else None)


def _problem() -> None:
    """What was wrong with the last reading, and what may be done about it."""
    error = st.session_state.get("_upload_error")
    if error:
        refuse(error)
        if uncombined_demonstrations() is not None:
            st.caption("Nothing has changed: the set below is still the one chosen.")
    lacking = error is not None and _LEFT_OUT in error
    if uploaded_files() and (lacking or st.session_state.get("upload_missing")):
        st.toggle(
            "Leave out the steps that lack a value",
            key="upload_missing",
            on_change=_read_again,
            help=with_words(
                "An empty cell, NaN, null or NA among observations, actions and rewards. "
                "What is left of an episode keeps its number and the numbers of its steps."
            ),
        )
