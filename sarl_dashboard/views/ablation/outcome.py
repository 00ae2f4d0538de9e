"""The work of the page Ablation: begun, on its way, and what is known so far."""

from __future__ import annotations

import streamlit as st

from sarl_core.mining.language import counted
from sarl_dashboard.jobs.ablation import Ablating, Wanted
from sarl_dashboard.state.compact_set import SHOWN_AS
from sarl_dashboard.text import in_full
from sarl_dashboard.views.ablation.settings import Choice
from sarl_dashboard.views.ablation.table import show

JOB = "_job_ablation"


def outcome(choice: Choice) -> None:
    """The button or the progress, and all that is known so far."""
    at_work = _working()

    @st.fragment(run_every=1.0 if at_work else None)
    def progress_and_result() -> None:
        if at_work != _working():
            st.rerun()  # as a whole: from now on every second, or no longer
        _bar(choice.wanted)
        known = choice.wanted.known
        if known is not None:
            show(known, choice.wanted, at_work=at_work, linked=SHOWN_AS.get(choice.rules))
        elif not at_work:
            st.info(
                "Choose an agent and the rules, then press Run. Only episodes in which a rule made "
                "a difference are run without it. The work goes on while you look at other pages, "
                "and what is finished stays when you cancel.",
                icon=":material/play_circle:",
            )

    progress_and_result()


def _job() -> Ablating | None:
    job: Ablating | None = st.session_state.get(JOB)
    return job


def _working() -> bool:
    """Whether an ablation of this visitor goes on."""
    job = _job()
    return job is not None and job.running


def _start(wanted: Wanted) -> None:
    """Begin the work beside the page; for a callback."""
    st.session_state[JOB] = Ablating(wanted)


def _bar(wanted: Wanted) -> None:
    """The button; or how far the work is, and a way to call it off."""
    job = _job()
    if job is not None and job.running:
        with st.container(horizontal=True, vertical_alignment="center"):
            st.progress(job.share, job.text)
            st.button("Cancel", icon=":material/close:", on_click=job.cancel, key="cancel_ablation")
        return
    known = wanted.known
    finished = known is not None and len(known.rules) >= min(
        wanted.most, len(known.rules) + len(known.left_out)
    )
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            "Run",
            type="primary",
            icon=":material/play_arrow:",
            key="run_ablation",
            on_click=_start,
            args=(wanted,),
            disabled=finished,
        )
        st.caption(
            f"{counted(wanted.episodes, 'episode')} with all rules, and again without each of the "
            f"{wanted.most} most used{'; all done already' if finished else ''}.",
            width="content",
        )
    if job is None or job.key != wanted.key:
        return
    if job.error is not None:
        st.error(in_full(str(job.error)), icon=":material/error:")
    if job.cancelled:
        st.info(
            "Cancelled. What had been finished is kept; Run goes on from there.",
            icon=":material/pause_circle:",
        )
