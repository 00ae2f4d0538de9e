"""What the Improve page shows where there is nobody to ask: which states need a demonstration."""

from __future__ import annotations

from typing import Any

import numpy as np
import streamlit as st

from sarl_core.decimals import digits_across
from sarl_core.explaining.figures.gaps import gap_figure, gap_histograms
from sarl_core.improving.gaps import Gaps
from sarl_core.mining.language import counted, share_text
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.keeping import keep_result_button
from sarl_dashboard.components.tables import table_height
from sarl_dashboard.jobs.improving import Outcome, keep_outcome
from sarl_dashboard.text import escaped, file_name

MOST_FEATURES = 12
GAP_ROWS = 200


def show_gaps(outcome: Outcome, gaps: Gaps, *, at_work: bool) -> None:
    """Which states need a demonstration, and where they lie."""
    st.markdown(
        f"**{len(gaps):,}** of the {gaps.met:,} states that the novice met in "
        f"{counted(gaps.episodes, 'episode')} ({share_text(gaps.share)}) have no rule"
        + (" for some action" if gaps.missing.shape[1] > 1 else "")
        + " and need a demonstration."
    )
    if not len(gaps):
        if not at_work:
            st.info(
                "Wherever the novice went, the rules had an answer. That says nothing of whether "
                "it was the right one: for that, somebody must be asked.",
                icon=":material/check:",
            )
        return
    if at_work:
        return
    if gaps.missing.shape[1] > 1:
        shares = [
            f"{escaped(dimension.name)} {share_text(float(part))}"
            for dimension, part in zip(
                outcome.order.start.action_dimensions, gaps.missing.mean(axis=0), strict=True
            )
        ]
        st.caption(f"Share of them in which each action lacks a rule: {', '.join(shares)}.")
    show_where(outcome, gaps)
    st.markdown("**Some of these states**")
    show_states(outcome, gaps)
    file = f"gaps-{file_name(str(outcome.order.env_id))}.csv"
    with st.container(horizontal=True):
        download("Download all as CSV", lambda: _table(gaps), file, key="gaps_csv")
        keep_result_button(
            lambda: _table(gaps), file, key="keep_gaps", beside=lambda: _keep(outcome)
        )
    st.caption(
        "The file has the columns of a demonstration file, except the action. Have somebody who "
        "knows fill that in, and upload it on the Demonstrations page."
    )


def _table(gaps: Gaps) -> str:
    return str(gaps.to_frame().to_csv(index=False))


def _keep(outcome: Outcome) -> tuple[str, ...]:
    keep_outcome(outcome)
    return ()


def show_where(outcome: Outcome, gaps: Gaps) -> None:
    """A histogram a feature: states without a rule against the demonstrated ones."""
    st.markdown("**Where they lie**")
    st.caption(
        "Grey: the demonstrated states. Orange: the states without a rule. The features in which "
        "they differ most come first."
    )
    histograms = gap_histograms(outcome.order.start, gaps)
    features = outcome.order.start.observed
    with st.grid(3, min_column_width=280) as grid:
        for one in histograms[:MOST_FEATURES]:
            feature = features[one.feature]
            with grid.cell():
                st.markdown(f"**{escaped(feature.name)}**")
                chart(
                    gap_figure(one, feature),
                    f"gap_{one.feature}",
                    f"{feature.name}: demonstrated states and states without a rule",
                )
    if len(histograms) > MOST_FEATURES:
        st.caption(f"{MOST_FEATURES} of {len(histograms)} features.")


def show_states(outcome: Outcome, gaps: Gaps) -> None:
    """A table of some of the states, spread over all."""
    rows = np.unique(np.linspace(0, len(gaps) - 1, min(GAP_ROWS, len(gaps))).astype(np.int64))
    columns: dict[str, Any] = {"Episode": gaps.episode[rows], "Step": gaps.step[rows]}
    dimensions = outcome.order.start.action_dimensions
    if len(dimensions) > 1:
        columns["Without a rule"] = [
            ", ".join(
                dimension.name for dimension, lacks in zip(dimensions, row, strict=True) if lacks
            )
            for row in gaps.missing[rows]
        ]
    for index, feature in enumerate(outcome.order.start.observed):
        name = f"{feature.name} ({feature.unit})" if feature.unit else feature.name
        columns[name if name not in columns else f"{name} [{index}]"] = gaps.observations[
            rows, index
        ]
    st.dataframe(
        columns,
        hide_index=True,
        height=table_height(len(rows), 10),
        key="gaps_table",
        column_config={
            name: st.column_config.NumberColumn(format=f"%.{digits_across(values)}g")
            for name, values in columns.items()
            if name not in ("Episode", "Step", "Without a rule")
        },
        alt="States without a rule",
    )
    if len(rows) < len(gaps):
        st.caption(f"{len(rows):,} of {len(gaps):,}, spread over all episodes.")
