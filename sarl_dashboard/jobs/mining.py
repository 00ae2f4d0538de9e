"""Long work of the Evidence page: in processes, beside the page, kept for whoever asks again."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any

import streamlit as st

from sarl_core.progress import Progress
from sarl_dashboard.jobs.job import Job, Result
from sarl_dashboard.jobs.processes import processes
from sarl_dashboard.memory_cache import BoundedCache

MOST_RESULTS = 24

Work = Callable[[Executor, Progress], Result]


@st.cache_resource
def mining_results() -> BoundedCache[Any]:
    """What such work gave, for all visitors."""
    return BoundedCache(MOST_RESULTS)


def mining(
    key: object, work: Work[Result], keep: Callable[[Result], None], *, lasts: bool = False
) -> Job[Result]:
    """Mine in these processes.

    Args:
        key: Of what the result depends on.
        work: Gives the result.
        keep: Called with it.
        lasts: Whether it goes on when its page is closed: whether somebody has asked for it.
    """
    executor = processes()

    def mine(job: Job[Result]) -> None:
        def progress(done: int, total: int) -> bool:
            job.text = f"{done} of {total} rule sets mined"
            return job.progress(done, total)

        keep(work(executor, progress))

    return Job(key, mine, 1, lasts=lasts)
