"""The button that begins work beside the page, how far it is, and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, Literal

import streamlit as st

from sarl_core.mining.language import counted
from sarl_dashboard.jobs.episodes import EpisodeBatch, Row, known, run_batch
from sarl_dashboard.jobs.job import Job, Place, Result
from sarl_dashboard.text import escaped, refuse

# Pixels, and not as wide as there is room: the button that was pressed stays beside for a moment,
# and a Cancel that moves when it goes is missed by who is pressing it.
_PROGRESS = 560


@dataclass(frozen=True, eq=False)
class Offer(Generic[Result]):
    """Work that can be begun.

    Attributes:
        key: Of everything that its result depends on.
        start: Begins it.
        about: What it is, beside the button.
        complete: Whether all of it is known already.
        cancelled: What is said where it was called off.
        problems: Sentences on what of it could not be done.
        label: Of the button.
        icon: Of the button.
        type: Of the button.
    """

    key: object
    start: Callable[[], Job[Result]]
    about: str
    complete: bool
    cancelled: str = "Cancelled. What had been finished is kept; Run goes on from there."
    problems: Sequence[str] = ()
    label: str = "Run"
    icon: str = ":material/play_arrow:"
    type: Literal["primary", "secondary"] = "primary"


def run_bar(
    place: Place[Result],
    offer: Offer[Result] | None,
    *,
    cancel: str = "Cancel",
    cancel_icon: str = ":material/close:",
) -> None:
    """Begin work; or how far it is, and a way to call it off.

    Args:
        place: Of it; the buttons' keys are "run_<name>" and "cancel_<name>".
        offer: What the present choices ask for; None where they ask for nothing that can be had.
        cancel: The button that calls it off.
        cancel_icon: Of that button.
    """
    job = place.job
    if job is not None and job.running:
        with st.container(horizontal=True, vertical_alignment="center"):
            st.progress(job.share, escaped(job.text), width=_PROGRESS)
            st.button(cancel, icon=cancel_icon, on_click=job.cancel, key=f"cancel_{place.name}")
        return
    if place.at_work:
        st.info(place.gathering, icon=":material/hourglass_top:")
        return
    if offer is None:
        return
    if place.find_again(offer.key):
        st.rerun()
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            offer.label,
            type=offer.type,
            icon=offer.icon,
            key=f"run_{place.name}",
            on_click=place.begin,
            args=(offer.start,),
            disabled=offer.complete,
        )
        st.caption(offer.about, width="content")
    if job is None or job.key != offer.key or offer.complete:
        return
    for sentence in (*offer.problems, *([str(job.error)] if job.error is not None else [])):
        refuse(sentence)
    if job.cancelled:
        st.info(offer.cancelled, icon=":material/pause_circle:")


def watched(
    place: Place[Any], draw: Callable[[bool], None], *, seconds: float = 1.0, missed: bool = False
) -> None:
    """Draw what work beside the page changes, anew as long as it goes on.

    Args:
        place: Of the work.
        draw: Draws it; told whether the work goes on.
        seconds: Until it is drawn again.
        missed: Whether the work went on when the page looked for its result, so that its end would
            be missed where it came since.
    """
    job, at_work = place.job, missed or place.at_work

    @st.fragment(run_every=seconds if at_work else None)
    def watch() -> None:
        if job is not place.job or at_work != place.at_work:
            st.rerun()  # as a whole: from now on again and again, or no longer
        draw(at_work)

    watch()


def bars_at_work(*places: Place[Any]) -> None:
    """How far work is that was begun with other choices, and the way to call it off.

    Args:
        *places: Of a page whose present choices ask for nothing that can be had.
    """
    for place in places:
        if place.at_work:
            st.caption("What was begun with other choices goes on.")
            watched(place, partial(_bar, place))


def _bar(place: Place[Any], at_work: bool) -> None:
    run_bar(place, None)


def episodes_bar(place: Place[EpisodeBatch], rows: Sequence[Row], episodes: int) -> None:
    """Run what is missing of some episodes.

    Args:
        place: Of the work.
        rows: What is to be run.
        episodes: How many of each.
    """
    batch = place.job.result if place.job is not None else None
    keys = {row.key for row in rows}
    problems = batch.problems.items() if batch is not None else ()
    counts = [0 if some is None else len(some) for some in known(rows, episodes)]
    ready = counts.count(episodes)
    done = "all done already"
    if ready < len(rows):
        done = f"{sum(counts):,} of these {len(rows) * episodes:,} are done, and Run goes on there"
    run_bar(
        place,
        Offer(
            key=None,  # each row is kept by itself, so it goes on from whatever was run before
            start=lambda: run_batch(rows, episodes),
            about=f"{counted(episodes, 'episode')} for each of {counted(len(rows), 'setting')}"
            f"{f'; {done}.' if any(counts) else '.'}",
            complete=ready == len(rows),
            problems=sorted({str(error) for key, error in problems if key in keys}),
        ),
    )
