"""What came of a replay, in numbers."""

from __future__ import annotations

import numpy as np
import streamlit as st

from sarl_core.decimals import rounded_text
from sarl_core.explaining.words.fork import ending_texts
from sarl_core.mining.language import counted, share_text
from sarl_core.mining.rules import UNFILTERED
from sarl_core.rollouts.episodes import Episodes
from sarl_dashboard.components.journey.words import with_words, word_help
from sarl_dashboard.components.safety import freedom_cell
from sarl_dashboard.jobs.replays import ReplayPair
from sarl_dashboard.state.rule_files import CHOSEN

FEW = 0.3  # share of the steps below which the rules say little about an episode


def numbers(replay: ReplayPair) -> None:
    """Returns, lengths and interventions."""
    plain, shielded = replay.plain, replay.shielded
    alone = float(plain.returns[0])
    if shielded is None:
        with st.grid(6, min_column_width=130):
            st.metric("Return", f"{alone:,.1f}", border=True)
            st.metric("Length", f"{int(plain.lengths[0]):,} steps", border=True)
        (ended,) = ending_texts(plain)
        st.caption(f"{ended[0].upper()}{ended[1:]}.{_cost(plain)}")
        return
    with_rules, length = float(shielded.returns[0]), int(shielded.lengths[0])
    changed, covered = int(shielded.interventions[0]), int(shielded.covered[0])
    with st.grid(7, min_column_width=120):
        st.metric("Return with rules", f"{with_rules:,.1f}", border=True, height="stretch")
        st.metric("Return without", f"{alone:,.1f}", border=True, height="stretch")
        st.metric("Length with rules", f"{length:,}", border=True, height="stretch")
        st.metric("Length without", f"{int(plain.lengths[0]):,}", border=True, height="stretch")
        st.metric(
            "Changed",
            share_text(changed / length),
            border=True,
            height="stretch",
            help=with_words(f"The rules changed the action at {changed:,} of {length:,} steps."),
        )
        st.metric(
            "Covered",
            share_text(covered / length),
            border=True,
            height="stretch",
            help=with_words(f"Some rule applied at {covered:,} of {length:,} steps."),
        )
        st.metric(
            "Freedom",
            freedom_cell(shielded),
            border=True,
            height="stretch",
            help=word_help("freedom"),
        )
    (with_them,), (without,) = ending_texts(shielded), ending_texts(plain)
    ends = f"With the rules {with_them}. Without them {without}."
    if with_them == without:
        ends = f"With the rules, and without them, {without}."
    st.caption(ends + _cost(shielded, plain))
    beyond, withheld = int(shielded.outside[0]), int(shielded.withheld[0])
    if beyond:
        st.caption(
            f":material/frame_inspect: At {counted(beyond, 'step')} a rule was broken outside the "
            "data it was mined from"
            + (
                f"; at {withheld:,} of them it left the action as it is."
                if withheld
                else ": these interventions are marked as outside the data."
            )
        )
    if covered < FEW * length:
        followed = "" if changed else ", and the agent did what it says"
        st.markdown(
            ":material/info: :gray["
            + (
                f"A rule applied at {share_text(covered / length)} of the steps{followed}; "
                "elsewhere the agent acted alone.]"
                if covered
                else "No rule applied at any step: the agent acted alone.]"
            )
        )
        if _unfiltered_differ(replay):
            st.button("Try the unfiltered rules", key="try_unfiltered", on_click=_try_unfiltered)
    elif not changed:
        st.markdown(
            ":material/info: :gray[The rules changed nothing in this episode: wherever one "
            "applied, the agent did what it says.]"
        )


def _cost(*runs: Episodes) -> str:
    """What an episode with the rules cost, and what it cost without them, where it is known."""
    costs = [float(run.costs[0]) for run in runs]
    if any(np.isnan(cost) for cost in costs):
        return ""
    return f" Cost: {', without them '.join(rounded_text(cost, 2) for cost in costs)}."


def _unfiltered_differ(replay: ReplayPair) -> bool:
    """Whether the rules were filtered, from demonstrations that are at hand."""
    return (
        replay.order.rules in (CHOSEN, "filtered")
        and replay.rule_set is not None
        and replay.rule_set.thresholds != UNFILTERED
    )


def _try_unfiltered() -> None:
    """Choose the unfiltered rules and run; for a callback."""
    st.session_state["rules"] = "unfiltered"
    st.session_state["_run"] = True
