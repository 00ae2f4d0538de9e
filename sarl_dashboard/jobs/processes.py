"""The processes that work beside the pages: all visitors, and all kinds of work, take turns."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import streamlit as st

from sarl_core.clusters import VARIABLE, ClusterExecutor, lasting_executor
from sarl_core.processes import Processes


@st.cache_resource
def processes() -> Processes | ClusterExecutor:
    """Those of the cluster that the dashboard's owner named; else some of this machine.

    At least two, so that the server itself does no long work; whoever serves pages goes first. To
    be asked for where a page is drawn: a job's own thread has no session.
    """
    if address := os.environ.get(VARIABLE, ""):
        return lasting_executor(address)
    return Processes(min(max(os.cpu_count() or 1, 2), 8), gives_way=True)


@contextmanager
def own_process(*, gives_way: bool = False) -> Iterator[Processes]:
    """One for work on very many steps, which ends with it, whether it is done or called off.

    Growing a tree can be ended in no other way, and what a process has taken for it is given back.

    Args:
        gives_way: Whether whoever serves pages goes first: not where a page waits for it.
    """
    # scikit-learn would load pandas, of which a tree has no use: a third of its memory.
    executor = Processes(1, gives_way=gives_way, threads=os.cpu_count() or 1, without=("pandas",))
    try:
        yield executor
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
