"""What rules of fewer episodes would have been, on the page Evidence."""

from __future__ import annotations

from concurrent.futures import Executor

import streamlit as st

from sarl_core.explaining.figures import evidence as figures
from sarl_core.mining.language import counted
from sarl_core.mining.validation.learning_curve import MiningCurve, learning_curve
from sarl_core.progress import Progress
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.components.worked_out import worked_out
from sarl_dashboard.views.evidence.evidence import RuleSetEvidence

ORDERS = 6


def show_curve(evidence: RuleSetEvidence) -> None:
    """What rules of fewer episodes would have been."""
    parts = evidence.parts
    if say_steps_needed("a learning curve", parts.mined):
        return
    if parts.mined.n_episodes < 2:
        st.info(
            "There is one episode only. A learning curve needs several; give demonstrations with "
            "more episodes.",
            icon=":material/info:",
        )
        return
    mined, held_out = parts.mined, parts.held_out
    thresholds, divider = evidence.thresholds, evidence.rule_set.divider
    learner = evidence.rule_set.learner
    st.caption(
        "Rules are mined from one episode, from a few more, and so on to all, at the present "
        f"thresholds, in {ORDERS} orders of the episodes. A curve that still climbs at its end "
        "says that more demonstrations would help. "
        + (
            "Tried on the held-out episodes."
            if held_out is not None
            else "Tried on the episodes that come later in the order, so the last point has none; "
            "hold some out above to have it."
        )
    )

    def work(executor: Executor, progress: Progress) -> MiningCurve:
        return learning_curve(
            mined,
            thresholds,
            divider=divider,
            learner=learner,
            held_out=held_out,
            orders=ORDERS,
            executor=executor,
            progress=progress,
        )

    worked_out(
        "curve",
        (evidence,),
        work,
        f"Mines up to {8 * ORDERS} rule sets.",
        _show_curve,
    )


def _show_curve(curve: MiningCurve) -> None:
    with st.grid(4, min_column_width=240, gap="small") as grid:
        for layer, title in figures.CURVE_TITLES.items():
            with grid.cell():
                st.markdown(f"**{title}**")
                chart(
                    figures.curve_figure(curve, layer),
                    f"curve_{layer}",
                    f"{title} over the number of episodes",
                )
    st.caption(
        f"Line: the mean of {counted(curve.orders, 'order')}. Band: from the least to the most."
    )
