"""The processes that work beside the pages: all visitors, and all kinds of work, take turns."""

from __future__ import annotations

import os

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
