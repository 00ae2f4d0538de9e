"""Long work of the Evidence page: in processes, beside the page, kept for whoever asks again."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Executor
from threading import Lock
from typing import Any, TypeVar

import streamlit as st

from sarl_core.errors import WorkError
from sarl_core.progress import CancelledError, Progress
from sarl_core.rollouts.workers import beginning
from sarl_dashboard.byte_cache import Kept
from sarl_dashboard.jobs.job import Job

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
def mining_results() -> Kept[Any]:
    """What such work gave, for all visitors."""
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
