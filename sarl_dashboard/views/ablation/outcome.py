"""The work of the page Worth of each rule: begun, on its way, and what is known so far."""

from __future__ import annotations

import streamlit as st

from sarl_core.mining.language import counted
from sarl_core.studies.ablation_run import AblationRecord
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs.ablation import ablating
from sarl_dashboard.jobs.job import Place
from sarl_dashboard.views.ablation.settings import AblationChoice
from sarl_dashboard.views.ablation.table import show

PLACE = Place[AblationRecord]("ablation")


def outcome(choice: AblationChoice) -> None:
    """The button or the progress, and all that is known so far."""
    wanted = choice.wanted

    def progress_and_result(at_work: bool) -> None:
        known = wanted.known
        finished = known is not None and len(known.rules) >= min(
            wanted.most, len(known.rules) + len(known.left_out)
        )
        run_bar(
            PLACE,
            Offer(
                key=wanted.row.key,
                start=lambda: ablating(wanted),
                about=f"{counted(wanted.episodes, 'episode')} with all rules, and again without "
                f"each of the {wanted.most} most used{'; all done already' if finished else ''}.",
                complete=finished,
            ),
        )
        if known is not None:
            show(known, choice, at_work=at_work)
        elif not at_work:
            st.info(
                "Choose an agent and the rules, then press Run. Only episodes in which a rule made "
                "a difference are run without it. The work goes on while you look at other pages, "
                "and what is finished stays when you cancel.",
                icon=":material/play_circle:",
            )

    watched(PLACE, progress_and_result)
