"""Addresses for whoever watches the server: whether it is well, and how much it does."""

from __future__ import annotations

import logging
import time

from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from streamlit import runtime

from sarl_core import __version__
from sarl_core.errors import SarlError
from sarl_dashboard.session import memory_used

_LOGGER = logging.getLogger(__name__)
_STARTED = time.time()


def routes() -> list[Route]:
    """Of both, beside those of the pages."""
    return [Route("/health", _health), Route("/metrics", _metrics)]


def _health(_: Request) -> Response:
    """200 where pages are served and what is made can be kept, else 503; the log says why."""
    from sarl_dashboard.state.library import library

    try:
        library().usage("")
    except SarlError as error:
        _LOGGER.warning("%s", error)  # with addresses that are not for everybody
        return JSONResponse({"status": "no library"}, status_code=503)
    return JSONResponse({"status": "ok", "version": __version__})


def _metrics(_: Request) -> Response:
    """In the text format of Prometheus."""
    from sarl_dashboard.jobs.queue import queue

    jobs = queue()
    lines = []
    for name, kind, what, value in (
        ("sarl_jobs_running", "gauge", "Long work that goes on.", len(jobs.running)),
        ("sarl_jobs_waiting", "gauge", "Long work that waits for its turn.", len(jobs.waiting)),
        ("sarl_jobs_ended_total", "counter", "Long work that has ended.", jobs.ended_in_all),
        ("sarl_sessions", "gauge", "Pages that are open in browsers.", _sessions()),
        ("sarl_memory_bytes", "gauge", "Of the server and its processes.", memory_used()),
        ("sarl_started_seconds", "gauge", "When the server began, in Unix time.", int(_STARTED)),
    ):
        lines += [f"# HELP {name} {what}", f"# TYPE {name} {kind}", f"{name} {value}"]
    return PlainTextResponse("\n".join(lines) + "\n", media_type="text/plain; version=0.0.4")


def _sessions() -> int:
    stats = runtime.get_instance().stats_mgr.get_stats(family_names=["active_sessions"])
    return sum(int(stat.value) for one in stats.values() for stat in one if hasattr(stat, "value"))
