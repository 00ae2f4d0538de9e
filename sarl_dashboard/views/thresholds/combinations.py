"""The switch that lets rules ask about combinations of two features, and which these may be."""

from __future__ import annotations

import streamlit as st

from sarl_core.mining.language import counted
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.state import combining, rule_base
from sarl_dashboard.state.combining import CombinationChoice
from sarl_dashboard.state.data import data_parts, uncombined_parts
from sarl_dashboard.text import in_full

_FEATURES = "_combined_features"


def combinations_choice() -> None:
    """The switch; where it is on, the features that may be combined, and what came of it."""
    observed, parts = uncombined_parts(), data_parts()
    if observed is None or parts is None or observed.mined.sample_of is not None:
        return  # combinations are among the features of a mined file, or its trees know of none
    choice = combining.chosen()
    # The widgets follow the URL, so a link and the browser's "back" both reach them.
    st.session_state["_combinations"] = choice.on
    with st.container(horizontal=True, vertical_alignment="center", gap="medium", key="combining"):
        st.toggle(
            "Combinations of two features",
            key="_combinations",
            on_change=_switch,
            help=with_words(
                "Let rules ask about two features together, as “position plus 0.5 s of "
                "velocity”: the ratios that tell most about the actions are chosen from the "
                "episodes that rules are mined from."
            ),
        )
        if not choice.on:
            return
        possible = combining.combinable(observed.mined)
        names = [feature.name for feature in observed.mined.features]
        some = [index for index in choice.features if index in possible]
        # The first of several is no choice yet, and waits in its box for the second.
        waiting = [index for index in st.session_state.get(_FEATURES, ()) if index in possible]
        waits = not some and len(waiting) == 1
        st.session_state[_FEATURES] = waiting if waits else some
        with st.popover("Features to combine", icon=":material/join:"):
            st.multiselect(
                "Features to combine",
                possible,
                key=_FEATURES,
                format_func=names.__getitem__,
                placeholder="all that are numbers",
                on_change=_choose_features,
            )
            if waits:
                st.caption("Until there is a second one, all are combined.")
        count = len(parts.mined.derived) - len(observed.mined.derived)
        if count:
            st.caption(
                f"Rules may ask about {counted(count, 'combination')} as well.", width="content"
            )
    problem = combining.problem(observed)
    if problem:
        st.warning(in_full(problem), icon=":material/join:")


def _switch() -> None:
    rule_base.choose()
    combining.choose(
        CombinationChoice(st.session_state["_combinations"], combining.chosen().features)
    )


def _choose_features() -> None:
    rule_base.choose()
    combining.choose(CombinationChoice(True, tuple(st.session_state[_FEATURES])))
