"""Long work of the Evidence page: in processes, beside the page, kept for whoever asks again."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Executor
from threading import Lock
from typing import Any, TypeVar

import streamlit as st
from _jobs import Job
from _kept import Kept
from _words import in_full

from sarl_core.errors import WorkError
from sarl_core.mining.progress import CancelledError, Progress
from sarl_core.rollouts.workers import beginning

KEPT = 24
_IDLE_SECONDS = 300  # after which a process that nobody needs ends

Result = TypeVar("Result")
Work = Callable[[Executor, Progress], Result]


class Processes:
    """Processes that mine; they start when first needed, and anew after one was lost."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._executor: Any = None

    def get(self) -> Executor:
        """Those that run, or new ones."""
        from joblib.externals.loky.process_executor import ProcessPoolExecutor

        with self._lock:
            if self._executor is None:
                self._executor = ProcessPoolExecutor(
                    min(max(os.cpu_count() or 1, 2), 8),
                    timeout=_IDLE_SECONDS,
                    **beginning(gives_way=True),
                    env={"OMP_NUM_THREADS": "1"},
                )
            executor: Executor = self._executor
            return executor

    def drop(self) -> None:
        """Let go of them: one was lost."""
        with self._lock:
            self._executor = None


@st.cache_resource
def _processes() -> Processes:
    return Processes()


@st.cache_resource
def _results() -> Kept:
    return Kept(KEPT)


class Mining(Job):
    """One piece of such work.

    Attributes:
        key: Of what it depends on.
    """

    def __init__(self, key: object, work: Work[Any], keep: Callable[[Any], None]) -> None:
        self.key, self._todo, self._keep = key, work, keep
        # Streamlit's caches are asked here: the work's own thread has no session.
        self._pool = _processes()
        super().__init__(self._mine, 1)

    def _mine(self, _: Job) -> None:
        def progress(done: int, total: int) -> bool:
            self.done, self.total = done, total
            self.text = f"{done} of {total} rule sets mined"
            return self.wanted()

        try:
            self._keep(self._todo(self._pool.get(), progress))
        except CancelledError:
            return
        except WorkError:
            self._pool.drop()
            raise


def _job(place: str) -> Mining | None:
    found = st.session_state.get(f"_job_{place}")
    return found if isinstance(found, Mining) else None


def _at_work(place: str) -> bool:
    asked = _job(place)
    return asked is not None and asked.running


def _start(place: str, key: object, work: Work[Any]) -> None:
    kept = _results()
    st.session_state[f"_job_{place}"] = Mining(key, work, lambda found: kept.put(key, found))


def worked_out(
    place: str, key: object, work: Work[Result], hint: str, show: Callable[[Result], None]
) -> None:
    """A button that begins work, how far it is, and what came of it.

    Args:
        place: Name on screen; the buttons are "run_<place>" and "cancel_<place>".
        key: Of everything that the result depends on.
        work: Gives the result.
        hint: Beside the button.
        show: Draws the result.
    """
    going = _at_work(place)

    @st.fragment(run_every=1.0 if going else None)
    def progress_and_result() -> None:
        if going != _at_work(place):
            st.rerun()  # as a whole: from now on every second, or no longer
        asked, kept = _job(place), _results().get(key)
        with st.container(horizontal=True, vertical_alignment="center"):
            if asked is not None and asked.running:
                st.progress(asked.share, asked.text)
                st.button(
                    "Cancel", icon=":material/close:", on_click=asked.cancel, key=f"cancel_{place}"
                )
            elif kept is None:
                st.button(
                    "Run",
                    type="primary",
                    icon=":material/play_arrow:",
                    key=f"run_{place}",
                    on_click=_start,
                    args=(place, key, work),
                )
                st.caption(hint, width="content")
        if asked is not None and asked.key == key and not asked.running and kept is None:
            if asked.error is not None:
                st.error(in_full(str(asked.error)), icon=":material/error:")
            elif asked.cancelled:
                st.info("Cancelled; nothing was kept.", icon=":material/pause_circle:")
        if kept is not None:
            show(kept)  # type: ignore[arg-type]

    progress_and_result()
