"""The state on the page What if: where it is taken from, and how a feature of it is chosen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.demonstrations.words import Coded, indicated, spelled, words_of
from sarl_core.shielding.sampling import Span, random_state, within
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.jobs.replays import latest
from sarl_dashboard.text import labelled
from sarl_dashboard.views.what_if.situation import Situation
from sarl_dashboard.views.what_if.slider import span_slider

MEDIAN = "the median of every feature"
DEMONSTRATED = "a demonstrated state"
REPLAY = "a step of the replay"
COVERED = "a random covered state"
UNCOVERED = "a random uncovered state"
FIRST_ONES = "_what_if_first"
"""Of many features those whose sliders come first, as long as no other state is taken."""
SOURCES = (MEDIAN, DEMONSTRATED, REPLAY, COVERED, UNCOVERED)


# --- where it is taken from --------------------------------------------------------------------


def source_choice(situation: Situation) -> None:
    """Where the state comes from."""
    with st.container(border=True):
        with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
            st.selectbox(
                "Take a state",
                SOURCES,
                key="take",
                bind="query-params",
                on_change=_take,
                args=(situation,),
                width=280,
                help=with_words(
                    "Where the sliders are put. Then move any of them. Covered: every action "
                    "dimension has a rule. Uncovered: some dimension has none."
                ),
            )
            st.number_input(
                "Number",
                0,
                2**31 - 1,
                0,
                key="number",
                bind="query-params",
                on_change=_take,
                args=(situation,),
                width=150,
                help=with_words(
                    "The row of the demonstrations, the step of the replay, or the seed of a "
                    "random state. The same number gives the same state."
                ),
            )
            st.button(
                "Take it",
                icon=":material/my_location:",
                on_click=_take,
                args=(situation,),
                key="take_it",
            )
            st.button(
                "Another",
                icon=":material/shuffle:",
                on_click=_take,
                args=(situation, 1),
                key="another",
                help="The next number",
            )
        problem = st.session_state.get("_what_if_none", "")
        if problem:
            st.info(problem, icon=":material/search_off:")
        moved = int(st.session_state.get("_what_if_moved", 0))
        if moved:
            st.caption(
                f":material/info: {moved} of its values lie beyond all demonstrated ones and were "
                "moved to the nearest that was."
            )


def _take(situation: Situation, more: int = 0) -> None:
    """Take the chosen state; for callbacks.

    Args:
        situation: From whose states it is taken.
        more: Added to the number first, for another one.
    """
    source = st.session_state.get("take", MEDIAN)
    number = max(int(st.session_state.get("number") or 0) + more, 0)
    if more:
        st.session_state["number"] = number
    state = _state(situation, source, number)
    st.session_state["_what_if_none"] = state if isinstance(state, str) else ""
    if not isinstance(state, str):
        _put(state, situation)


def _state(situation: Situation, source: str, number: int) -> NDArray[np.float32] | str:
    """A state of a source, shape (d,); or a sentence, where it has none."""
    observations = situation.demonstrations.raw_observations
    if source == MEDIAN:
        return middle_state(situation.spans)
    if source in (COVERED, UNCOVERED):
        shield = situation.neighbourhood.shield
        state = random_state(shield, observations, covered=source == COVERED, seed=number)
        if state is not None:
            return state
        return (
            "No state without a rule was found: these rules cover every state that was tried."
            if source == UNCOVERED
            else "No state was found that has a rule for every action dimension."
        )
    rows = observations if source == DEMONSTRATED else _replayed(len(situation.spans))
    if rows is None:
        return (
            "There is no replay of these features in this session. Run one on the Replay page, "
            "then take a step of it here."
        )
    row: NDArray[np.float32] = rows[number % len(rows)]
    return row


def _replayed(features: int) -> NDArray[np.float32] | None:
    """The states of the latest replay, if it is of as many features."""
    played = latest()
    if played is None:
        return None
    observations: NDArray[np.float32] = played.replay.steps.observation
    return observations if observations.shape[1] == features else None


# --- its sliders -------------------------------------------------------------------------------


def fit_sliders(situation: Situation) -> None:
    """Move the sliders where other data has other values; before they are drawn."""
    # Other data has other sliders under the same names.
    spans, columns = situation.spans, situation.columns
    data = repr((spans, columns))
    if st.session_state.get("_what_if_data", data) != data:
        _put(middle_state(spans), situation)
    st.session_state["_what_if_data"] = data
    of_words = {at for places in columns.values() for at in places}
    for index, span in enumerate(spans):
        value = st.session_state.get(f"x{index}")
        if index not in of_words and value is not None and not span.low <= value <= span.high:
            st.session_state[f"x{index}"] = span.middle


def draw(state: NDArray[np.float32], situation: Situation, index: int) -> None:
    """Ask for one feature of the state, or for the word of a column that several are about."""
    feature = situation.demonstrations.features[index]
    if feature.indicator is None:
        name = f"{feature.name} ({feature.unit})" if feature.unit else feature.name
        state[index] = span_slider(name, situation.spans[index], f"x{index}")
        return
    column = feature.indicator.column
    places = situation.columns[column]
    indicators = situation.indicators(places)
    words = words_of(indicators)
    middle = np.array([[situation.spans[at].middle for at in places]], dtype=np.float32)
    likeliest = int(spelled(middle, indicators).codes[0])
    with labelled(column) as label_visibility:
        word = st.selectbox(
            column,
            words,
            index=likeliest,
            key=f"x{index}",
            bind="query-params",
            label_visibility=label_visibility,
        )
    state[places] = indicated(Coded(np.array([words.index(word)]), words), indicators)[0]


def middle_state(spans: Sequence[Span]) -> NDArray[np.float32]:
    """The state in which every feature is in the middle, shape (d,)."""
    return np.array([span.middle for span in spans], dtype=np.float32)


def _put(state: NDArray[np.float32], situation: Situation) -> None:
    """Move the sliders; for callbacks, and before they are drawn."""
    near = within(state, situation.spans)
    st.session_state.pop(FIRST_ONES, None)
    for index, value in enumerate(near.tolist()):
        st.session_state[f"x{index}"] = value
    for places in situation.columns.values():
        indicators = situation.indicators(places)
        code = int(spelled(near[None, places], indicators).codes[0])
        for at in places[1:]:
            del st.session_state[f"x{at}"]  # the first of them has the widget
        st.session_state[f"x{places[0]}"] = words_of(indicators)[max(code, 0)]
    st.session_state["_what_if_moved"] = int((near != state).sum())
