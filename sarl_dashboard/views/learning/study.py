"""What the Learning page shows of a study: what it found, how it went, and what came of it."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import streamlit as st

from sarl_core.explaining.figures.learning import (
    afterwards_figure,
    arm_colour,
    curves_figure,
    outcome_figure,
)
from sarl_core.explaining.html.headings import term
from sarl_core.explaining.words.learning import HEADINGS, finding, table_rows
from sarl_core.learning.study_files import (
    COMPARED,
    CURVES,
    RESULTS,
    LearningStudy,
    policy_path,
)
from sarl_core.learning.summary import best, summarise_compared, summarise_study
from sarl_dashboard.components.chart import chart
from sarl_dashboard.text import escaped


def show_study(study: LearningStudy, name: str) -> None:
    """All that is known of the finished runs of a study.

    Args:
        study: With finished runs.
        name: Of the place on screen, for the charts' keys.
    """
    summaries, compared = summarise_study(study), summarise_compared(study)
    answer, *more = finding(study, summaries)
    way = best(summaries, study.choose)
    (st.success if way is not None else st.info)(
        escaped(answer), icon=":material/verified_user:" if way is not None else ":material/info:"
    )
    picture, words = st.columns([3, 2], gap="large")
    with picture:
        st.markdown("**Failures while learning, and what the learner is worth without its shield**")
        chart(
            outcome_figure(summaries, compared),
            f"outcome_{name}",
            "Failures while learning against the return afterwards without a shield",
        )
        st.caption("Large points are means, small ones single learners. Squares learn by replay.")
    with words:
        for paragraph in more[:-1]:
            st.markdown(escaped(paragraph))
        st.caption(escaped(more[-1]) if more else "")
    during, after, table, arms = st.tabs(
        ["While learning", "Afterwards", "All numbers", "The ways to learn"]
    )
    with during:
        show_curves(study, name)
    with after:
        chart(
            afterwards_figure(summaries, compared),
            f"after_{name}",
            "Return after learning with the shield on and off",
        )
        st.caption(
            f"{int(study.settings['trial_episodes'])} episodes of each learner, on seeds that "
            "none has met, each action the one the learner thinks best. The dotted line is PPO "
            "that never had a shield. The interval is over episodes; how much the learners "
            "themselves differ, the table says."
        )
    with table:
        st.dataframe(
            [dict(zip(HEADINGS, row, strict=True)) for row in table_rows(summaries, compared)],
            hide_index=True,
            height="content",
        )
        st.caption(
            "Means of the learners, in brackets the least and the largest. Failed: what the "
            "task must never let happen has happened. Changed: share of the steps at which the "
            "rules changed what the learner wanted. After: the shield is off, but in the last two "
            "columns. Freedom: what the rules leave to choose from."
        )
    with arms:
        for summary in summaries:
            arm = summary.arm
            st.html(term(arm_colour(arm), arm.title, arm.what))


def show_curves(study: LearningStudy, name: str) -> None:
    """How learning goes, or went.

    Args:
        study: At work or finished.
        name: Of the place on screen.
    """
    chart(
        curves_figure(study),
        f"curves_{name}",
        "Return, failures so far and share of changed actions while learning",
    )
    many = " A band reaches from the lowest learner to the highest." if len(study.seeds) > 1 else ""
    st.caption(
        "Returns are without any penalty. Changed by the rules: how often the network wanted "
        f"something else.{many} Click a name to hide it, double-click to see it alone."
    )


def archive(study: LearningStudy, folder: Path) -> bytes:
    """Everything that is finished, as one file.

    Args:
        study: With finished runs.
        folder: Where it is.

    Returns:
        A `.zip`: tables, rules, and each policy.
    """
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
        paths = [folder / name for name in (RESULTS, CURVES, COMPARED, "rules.json")]
        paths += [policy_path(folder, run.arm, run.seed) for run in study.finished]
        for path in paths:
            if path.is_file():
                file.write(path, path.relative_to(folder))
    return packed.getvalue()
