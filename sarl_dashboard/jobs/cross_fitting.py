"""What the rules in force are worth in episodes that they were not mined from.

Trees are grown without each fold of the episodes, in processes beside the page, once for the data:
after that it is known at all thresholds. Nobody waits for it: pages are drawn without it, and have
it as soon as it is there.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import digest_of_pairs
from sarl_core.explaining.html.headings import note
from sarl_core.explaining.words.cross_fit import judged_sentence, parting_text
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.validation.cross_fitting import CrossFit, Judged, cross_fit
from sarl_core.progress import Progress
from sarl_dashboard.cache import RESULTS, cached, keep, owner
from sarl_dashboard.jobs.job import Job, Place
from sarl_dashboard.jobs.mining import mining
from sarl_dashboard.state import compact_set
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.thresholds import MIN_DIVIDER, chosen_divider
from sarl_dashboard.text import in_full

UNASKED = 250_000  # steps up to which it is made without being asked for
_PLACE = Place[CrossFit]("elsewhere")
_LOOK_SECONDS = 1.0


def _key(demonstrations: Demonstrations, divider: int) -> tuple[object, ...]:
    if demonstrations.is_discrete:
        divider = MIN_DIVIDER
    return ("elsewhere", digest_of_pairs(demonstrations), divider)


def judged(thresholds: Thresholds) -> Judged | None:
    """The rules at some thresholds in other episodes; None while that is not known.

    Args:
        thresholds: Of the chosen demonstrations.

    Returns:
        Of mined rules alone: a compact set was built from other states.
    """
    demonstrations = chosen_demonstrations()
    if demonstrations is None or compact_set.in_force():
        return None
    key = _key(demonstrations, chosen_divider())
    fit = RESULTS.get(key)
    return _judged(key, thresholds, fit) if isinstance(fit, CrossFit) else None


@cached()
def _judged(key: tuple[object, ...], thresholds: Thresholds, _fit: CrossFit) -> Judged:
    return _fit.at(thresholds)


def _job(key: tuple[object, ...]) -> Job[CrossFit] | None:
    """The work of this session, if it is about these data."""
    job = _PLACE.job
    return job if job is not None and job.key == key else None


def _begin(demonstrations: Demonstrations, divider: int) -> None:
    key, whose = _key(demonstrations, divider), owner()
    if _PLACE.job is not None:
        _PLACE.job.cancel()

    def work(executor: Executor, progress: Progress) -> CrossFit:
        return cross_fit(demonstrations, divider=divider, executor=executor, progress=progress)

    _PLACE.begin(lambda: mining(key, work, lambda fit: keep(key, fit, whose)))


def make_ready() -> None:
    """Begin to make it, where it is not there and not on its way: once the page is drawn."""
    demonstrations = chosen_demonstrations()
    if demonstrations is None or compact_set.in_force() or len(demonstrations) > UNASKED:
        return
    divider = chosen_divider()
    key = _key(demonstrations, divider)
    job = _job(key)
    # What was made may have been let go of since, for want of room.
    if key not in RESULTS and (job is None or not (job.running or job.error)):
        _begin(demonstrations, divider)


def told(
    thresholds: Thresholds, fidelity: float, more: Callable[[Judged], str] = lambda _: ""
) -> None:
    """What is known of the rules in other episodes, and a warning where that is much less.

    Args:
        thresholds: At which they were mined.
        fidelity: On what they were mined from.
        more: HTML to stand below.
    """
    demonstrations = chosen_demonstrations()
    if demonstrations is None or compact_set.in_force():
        return
    divider = chosen_divider()
    key = _key(demonstrations, divider)
    waiting = key not in RESULTS

    @st.fragment(run_every=_LOOK_SECONDS if waiting else None)
    def as_soon_as_it_is_there() -> None:
        found = judged(thresholds)
        if found is not None:
            if waiting:
                st.rerun()  # as a whole: the numbers above have it too, and nobody looks any more
            warning = parting_text(fidelity, found)
            if warning:
                st.warning(warning, icon=":material/warning:")
            st.html(note(judged_sentence(found)) + more(found))
            return
        job = _job(key)
        if job is not None and job.error is not None:
            st.caption(
                in_full(f"what the rules are worth in other episodes is not known: {job.error}")
            )
        elif job is None and len(demonstrations) > UNASKED:
            st.button(
                "Find out what they are worth in other episodes",
                key="elsewhere",
                icon=":material/play_arrow:",
                on_click=_begin,
                args=(demonstrations, divider),
                help=f"Of more than {UNASKED:,} steps this takes minutes, and a processor",
            )
        else:
            done = "" if job is None else f" ({job.done} of {max(job.total, 1)})"
            st.caption(
                "Finding out what the rules are worth in episodes that they were not mined from "
                f"…{done}"
            )

    as_soon_as_it_is_there()
