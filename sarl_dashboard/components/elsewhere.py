"""What rules are worth in episodes that they were not mined from, beside what they say here."""

from __future__ import annotations

from collections.abc import Callable

import streamlit as st
from markupsafe import Markup

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import needs_steps_text
from sarl_core.explaining.html.headings import note
from sarl_core.explaining.words.cross_fit import judged_sentence, parting_text
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.validation.cross_fitting import Judged
from sarl_dashboard.cache import RESULTS
from sarl_dashboard.components.run_bar import run_bar
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.data import chosen_demonstrations, mined_data
from sarl_dashboard.state.thresholds import chosen_divider
from sarl_dashboard.text import in_full

_LOOK_SECONDS = 1.0


def elsewhere_notice(
    thresholds: Thresholds,
    fidelity: float,
    more: Callable[[Judged], Markup] = lambda _: Markup(),
    *,
    missed: bool = False,
) -> None:
    """What is known of the rules in other episodes, and a warning where that is much less.

    Args:
        thresholds: At which they were mined.
        fidelity: On what they were mined from.
        more: HTML to stand below.
        missed: Whether what stands above was drawn before it was known, so that it would go on
            without it where that has come since.
    """
    demonstrations = chosen_demonstrations()
    if demonstrations is None or not rule_base.at_thresholds():
        return
    if demonstrations.sample_of is not None:
        mined = mined_data()
        if mined is not None and mined.held_out and not mined.counted(thresholds):
            return
        _notice_of_file(demonstrations, cross_fitting.judged(thresholds), fidelity, more)
        return
    divider = chosen_divider()
    key = cross_fitting.key_of(demonstrations, divider)
    if thresholds.support < cross_fitting.least_support(demonstrations):
        st.caption(
            f"What rules with a support of less than {cross_fitting.LEAST_SUPPORT:.2%} are worth "
            "in other episodes is not found out where there are so many steps."
        )
        return
    waiting = missed or key not in RESULTS

    @st.fragment(run_every=_LOOK_SECONDS if waiting else None)
    def as_soon_as_it_is_there() -> None:
        elsewhere = cross_fitting.judged(thresholds)
        if elsewhere is not None:
            if waiting:
                st.rerun()  # as a whole: the numbers above have it too, and nobody looks any more
            _say(elsewhere, fidelity, more)
            return
        job = cross_fitting.job_of(key)
        takes_minutes = len(demonstrations) > cross_fitting.UNASKED
        if job is not None and job.error is not None:
            st.caption(
                in_full(f"what the rules are worth in other episodes is not known: {job.error}")
            )
        elif takes_minutes and (job is None or not job.running):
            st.button(
                "Find out what they are worth in other episodes",
                key="elsewhere",
                icon=":material/play_arrow:",
                on_click=cross_fitting.begin,
                args=(demonstrations, divider),
                help=f"Of more than {cross_fitting.UNASKED:,} steps this takes minutes, and "
                "what nobody else needs of the processors",
            )
        elif takes_minutes:
            run_bar(cross_fitting.PLACE, None)
        else:
            done = "" if job is None else f" ({job.done} of {max(job.total, 1)})"
            st.caption(
                "Finding out what the rules are worth in episodes that they were not mined from "
                f"…{done}"
            )

    as_soon_as_it_is_there()


def _notice_of_file(
    sample: Demonstrations,
    judged: Judged | None,
    fidelity: float,
    more: Callable[[Judged], Markup],
) -> None:
    """What a mined file knows of other episodes, of which it has the counts alone."""
    if judged is not None:
        _say(judged, fidelity, more)
        return
    st.caption(
        "No episodes were held out when this file was mined, so what its rules are worth in others "
        f"is not known. {in_full(needs_steps_text('finding it out', sample))}"
    )


def _say(judged: Judged, fidelity: float, more: Callable[[Judged], Markup]) -> None:
    warning = parting_text(fidelity, judged)
    if warning:
        st.warning(warning, icon=":material/warning:")
    st.html(note(judged_sentence(judged)) + more(judged))
