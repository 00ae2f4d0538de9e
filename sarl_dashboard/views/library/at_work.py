"""Work that was begun, here or in a page that is closed by now: how far it is, and where it is."""

from __future__ import annotations

import re
import time
from typing import Any

import streamlit as st

from sarl_core.mining.language import counted
from sarl_dashboard import session
from sarl_dashboard.jobs.job import Job
from sarl_dashboard.jobs.queue import EndedJob, queue
from sarl_dashboard.text import escaped, in_full

_SECONDS = 2.0  # between two looks
_PROGRESS = 420  # pixels, beside two buttons
_LISTED = 5  # that have ended
_LISTED_FOR = 24 * 3600.0  # seconds
_ADDRESS = re.compile(r"[a-z_]+\?[\w%=&+.,|~*-]*")


def show_work(author: str) -> None:
    """What somebody has begun that goes on, waits or has ended; nothing where there is none.

    Args:
        author: Whose it is.
    """
    at_work = _of(author)

    @st.fragment(run_every=_SECONDS if at_work else None)
    def watch() -> None:
        jobs, ended = _of(author), _ended(author)
        if bool(jobs) != bool(at_work):
            st.rerun()
        if not jobs and not ended:
            return
        with st.container(border=True):
            st.header("Work")
            for job in jobs:
                _line(job)
            for place, record in enumerate(ended):
                _ended_line(record, place)

    watch()


def _of(author: str) -> list[Job[Any]]:
    jobs = (*queue().running, *queue().waiting)
    return [job for job in jobs if _is_of(job, author) and not job.cancelled]


def _ended(author: str) -> list[EndedJob]:
    since = time.time() - _LISTED_FOR
    return [one for one in queue().ended if _is_of(one, author) and one.ended > since][:_LISTED]


def _is_of(work: Job[Any] | EndedJob, author: str) -> bool:
    """Whether work is a visitor's: by the account, whatever it is called by now, or by name."""
    return work.visitor == session.visitor() or work.author == author


def _line(job: Job[Any]) -> None:
    # By the job and not by its place: what stands here moves up when another has ended, and a press
    # that is under way must not call off the next one.
    name = f"{id(job):x}"
    with st.container(horizontal=True, vertical_alignment="center"):
        st.progress(job.share, f"**{escaped(job.page)}.** {escaped(job.text)}", width=_PROGRESS)
        _open(job.address, f"open_job_{name}")
        if job.is_own:
            st.button(
                "Cancel", icon=":material/close:", key=f"cancel_job_{name}", on_click=job.cancel
            )
        else:
            st.caption("Another visitor began it, who alone can cancel it.", width="content")


def _ended_line(record: EndedJob, place: int) -> None:
    minutes = round((time.time() - record.ended) / 60)
    ago = f"{counted(minutes, 'minute')} ago" if minutes else "just now"
    said = f"Ended {ago}." if not record.error else f"Ended early {ago}. {in_full(record.error)}"
    with st.container(horizontal=True, vertical_alignment="center"):
        st.markdown(f"**{escaped(record.page)}.** {said}", width="content")
        _open(record.address, f"open_ended_{place}")


def _open(address: str, key: str) -> None:
    if _ADDRESS.fullmatch(address):
        st.link_button("Open", f"./{address}", icon=":material/open_in_new:", key=key)
