"""A study of a visitor's own: how far it is, what is known of it, and what can be taken away."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.learning.study_files import RESULTS, LearningStudy, policy_path, save_tables
from sarl_core.mining.language import counted
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.journey.environment_needed import require_own_environment
from sarl_dashboard.components.keeping import keep_result_button
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs.job import Place
from sarl_dashboard.jobs.learning import LearningOrder, keep_study, learning, study_of
from sarl_dashboard.text import escaped, file_name, refuse
from sarl_dashboard.views.learning.settings import settings
from sarl_dashboard.views.learning.study import archive, show_curves, show_study

PLACE = Place[LearningStudy]("learning")
LOOK_SECONDS = 2.0


def show_own() -> None:
    """Settings, progress, and all that is known so far."""
    if not PLACE.at_work:  # what learns can be looked at, and stopped, whatever is chosen
        require_own_environment()
    order = settings()
    if order is None and not PLACE.at_work:
        return

    def outcome(at_work: bool) -> None:
        job = PLACE.job
        study = job.result if at_work and job is not None else begun(order)
        run_bar(
            PLACE,
            offer_of(order, study) if order is not None else None,
            cancel="Stop",
            cancel_icon=":material/stop:",
        )
        if (
            at_work
            and order is not None
            and PLACE.job is not None
            and PLACE.job.key != order.folder
        ):
            st.caption("The settings have changed since; what is learning goes on as it began.")
        if study is None or not study.runs:
            if not at_work:
                st.info(
                    "Choose how the agents learn, then press Start. Their curves appear here "
                    "while they learn; you can look at other pages meanwhile, and stop at any "
                    "time: what was learned is kept.",
                    icon=":material/school:",
                )
        elif at_work or order is None or not study.finished:
            show_curves(study, "own")
        else:
            show_study(study, "own")
            downloads(order, study)

    watched(PLACE, outcome, seconds=LOOK_SECONDS)


def begun(order: LearningOrder | None) -> LearningStudy | None:
    """What there is of a study; why it cannot be read is said."""
    if order is None:
        return None
    try:
        return study_of(order)
    except SarlError as error:
        refuse(error)
        return None


def offer_of(order: LearningOrder, study: LearningStudy | None) -> Offer[LearningStudy]:
    """What the button starts, or goes on with.

    Args:
        order: What is asked for.
        study: What there is of it.
    """
    complete = study is not None and study.complete
    runs = order.seeds * len(order.arms)
    finished = len(study.finished) if study is not None else 0
    after = ", all finished." if complete else f", {finished} finished." if finished else "."
    return Offer(
        key=order.folder,
        start=lambda: learning(order),
        about=f"{counted(runs, 'run')} of {order.steps:,} steps in "
        f"{escaped(str(order.env_id))}{after}",
        complete=complete,
        cancelled="Stopped. What was learned is kept, and Go on takes it up from there, with new "
        "episodes: the numbers will be as good, but not the same as without the pause.",
        label="Go on" if study is not None and study.runs and not complete else "Start",
    )


def downloads(order: LearningOrder, study: LearningStudy) -> None:
    """What was learned, to take away."""
    with st.container(horizontal=True, vertical_alignment="bottom"):
        run = st.selectbox(
            "What was learned",
            study.finished,
            format_func=lambda run: f"{run.arm.title}, learner {run.seed + 1}",
            key="learn_policy",
            width=320,
        )
        download(
            "Download policy (.npz)",
            lambda: policy_path(order.folder, run.arm, run.seed).read_bytes(),
            f"{file_name(str(order.env_id))}-{run.name}.npz",
            key="learn_npz",
        )
        download(
            "Download everything (.zip)",
            lambda: archive(study, order.folder),
            "learned.zip",
            key="learn_zip",
        )
        keep_result_button(
            lambda: _results(order, study),
            f"learned-{file_name(str(order.env_id))}.json",
            key="keep_study",
            beside=lambda: _keep(order),
        )
    st.caption(
        "A policy is an agent everywhere: on Replay and Shield as “own file”, on the command line "
        "as `--agent`. It is the network alone, without the rules."
    )


def _results(order: LearningOrder, study: LearningStudy) -> bytes:
    path = order.folder / RESULTS
    if not path.is_file():  # its process was ended before it could write them
        save_tables(order.folder, study, {})
    return path.read_bytes()


def _keep(order: LearningOrder) -> tuple[str, ...]:
    keep_study(order)
    return ()
