"""Long work of the Evidence page: in processes, beside the page, kept for whoever asks again."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any, TypeVar

import streamlit as st

from sarl_core.progress import CancelledError, Progress
from sarl_dashboard.byte_cache import Kept
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.jobs.processes import processes

KEPT = 24

Result = TypeVar("Result")
Work = Callable[[Executor, Progress], Result]


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
        self._processes = processes()
        super().__init__(self._mine, 1)

    def _mine(self, _: Job) -> None:
        def progress(done: int, total: int) -> bool:
            self.done, self.total = done, total
            self.text = f"{done} of {total} rule sets mined"
            return self.wanted()

        try:
            self._keep(self._todo(self._processes, progress))
        except CancelledError:
            return
