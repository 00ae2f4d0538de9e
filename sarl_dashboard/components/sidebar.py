"""What stands beside every page: the choice of data, and the thresholds in force."""

from __future__ import annotations

import contextlib

import streamlit as st
from streamlit.errors import StreamlitAPIException

from sarl_core.environments.formulas import Formula
from sarl_core.mining.language import counted, threshold_text
from sarl_core.mining.rules import FILTERED, Thresholds
from sarl_dashboard.components.hold_out import parting_lines
from sarl_dashboard.state import combining, compact_set
from sarl_dashboard.state.data import (
    all_demonstrations,
    choose_dataset,
    chosen_dataset,
    data_problem,
    dataset_labels,
    uncombined_demonstrations,
)
from sarl_dashboard.state.thresholds import (
    MIN_DIVIDER,
    choose_divider,
    choose_thresholds,
    chosen_divider,
    chosen_thresholds,
)
from sarl_dashboard.text import refuse


def _keep_in_url(thresholds: Thresholds, divider: int) -> None:
    """Write what is in force into the URL, on a page whose widgets do not."""
    for name, value, default in (
        ("support", thresholds.support, FILTERED.support),
        ("confidence", thresholds.confidence, FILTERED.confidence),
        ("lift", thresholds.lift, 0.0),
        ("depth", thresholds.max_depth or 0, 0),
        ("divider", divider, MIN_DIVIDER),
    ):
        # Just after a change of page the parameter may still belong to the other page's widget.
        with contextlib.suppress(StreamlitAPIException):
            if value == default:
                st.query_params.pop(name, None)
            elif st.query_params.get(name) != threshold_text(value):
                st.query_params[name] = threshold_text(value)


def require_data(title: str) -> None:
    """Where a link names what is not here, say so and stop: nothing takes its place.

    Args:
        title: Of the page.
    """
    if problem := data_problem():
        st.title(title)
        refuse(problem)
        st.page_link("library.py", label="Go to Library", icon=":material/arrow_forward:")
        st.stop()


def sidebar(*, with_thresholds: bool = True) -> None:
    """The choice of data, and which rules are in force.

    Args:
        with_thresholds: Whether to say which thresholds are in force; a page with their sliders
            says so itself.
    """
    name = chosen_dataset()
    thresholds, divider = chosen_thresholds(), chosen_divider()
    # A page without sliders keeps what a link says, for the page that has them.
    choose_thresholds(thresholds)
    choose_divider(divider)
    if with_thresholds:
        _keep_in_url(thresholds, divider)
    # The widget follows the URL, so a link and the browser's "back" both reach it.
    st.session_state["_data_choice"] = name
    labels = dataset_labels()
    with st.sidebar:
        st.selectbox(
            "Data",
            list(labels),
            format_func=labels.__getitem__,
            key="_data_choice",
            on_change=lambda: choose_dataset(st.session_state["_data_choice"]),
        )
        problem = data_problem()
        demonstrations = None if problem else uncombined_demonstrations()
        if problem:
            st.caption("What the address names is not here.")
            return
        if demonstrations is None:
            st.caption("Nothing uploaded yet: see the Demonstrations page.")
            return
        lines = [
            f"{counted(len(demonstrations), 'step')} in "
            f"{counted(demonstrations.n_episodes, 'episode')}"
        ]
        whole = all_demonstrations()
        lines += parting_lines(whole) if whole is not None else []
        formulas = sum(isinstance(one.definition, Formula) for one in demonstrations.derived)
        if formulas:
            lines.append(f"**{counted(formulas, 'formula')}** among the features")
        # On pages that do not ask for it the choice keeps its place in the URL by this.
        if combining.chosen().on:
            lines.append("**Combinations** of two features on")
        if compact := compact_set.in_force():
            lines.append(f"**{compact_set.set_title(compact)}** in force")
            if with_thresholds:
                lines.append("Thresholds, set aside:")
        if not with_thresholds:
            st.caption("  \n".join(lines))
            return
        lines += [
            f"Support at least **{threshold_text(thresholds.support)}**",
            f"Confidence at least **{threshold_text(thresholds.confidence)}**",
        ]
        if not demonstrations.is_discrete:
            lines.append(f"Divider **{divider}**")
        if thresholds.lift:
            lines.append(f"Lift at least **{threshold_text(thresholds.lift)}**")
        if thresholds.max_depth:
            lines.append(f"Depth at most **{thresholds.max_depth}**")
        st.caption("  \n".join(lines))
