"""The state on the page What if: where it is taken from, and a slider for each feature of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.shielding.sampling import Span, random_state, within
from sarl_dashboard.jobs.replays import latest
from sarl_dashboard.text import escaped
from sarl_dashboard.views.what_if.situation import Situation
from sarl_dashboard.views.what_if.slider import span_slider

MEDIAN = "the median of every feature"
DEMONSTRATED = "a demonstrated state"
REPLAY = "a step of the replay"
COVERED = "a random covered state"
UNCOVERED = "a random uncovered state"
SOURCES = (MEDIAN, DEMONSTRATED, REPLAY, COVERED, UNCOVERED)
FIRST = 8  # features whose sliders are not folded away


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
                help="Where the sliders are put. Then move any of them. Covered: every action "
                "dimension has a rule. Uncovered: some dimension has none.",
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
                help="The row of the demonstrations, the step of the replay, or the seed of a "
                "random state. The same number gives the same state.",
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
        _put(state, situation.spans)


def _state(situation: Situation, source: str, number: int) -> NDArray[np.float32] | str:
    """A state of a source, shape (d,); or a sentence, where it has none."""
    observations = situation.demonstrations.observations
    if source == MEDIAN:
        return _middle(situation.spans)
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


def fit_sliders(spans: Sequence[Span]) -> None:
    """Move the sliders where other data has other values; before they are drawn."""
    # Other data has other sliders under the same names.
    data = repr(spans)
    if st.session_state.get("_what_if_data", data) != data:
        _put(_middle(spans), spans)
    st.session_state["_what_if_data"] = data
    for index, span in enumerate(spans):
        value = st.session_state.get(f"x{index}")
        if value is not None and not span.low <= value <= span.high:
            st.session_state[f"x{index}"] = span.middle


def sliders(situation: Situation) -> NDArray[np.float32]:
    """The state, shape (d,)."""
    order = situation.order
    values = dict.fromkeys(order, 0.0)
    for index in order[:FIRST]:
        values[index] = _slider(situation, index)
    rest = order[FIRST:]
    if rest:
        with st.expander(f"{len(rest)} more features", icon=":material/unfold_more:"):
            for index in rest:
                values[index] = _slider(situation, index)
    return np.array([values[index] for index in range(len(order))], dtype=np.float32)


def _slider(situation: Situation, index: int) -> float:
    """One feature's."""
    feature = situation.demonstrations.features[index]
    name = escaped(f"{feature.name} ({feature.unit})" if feature.unit else feature.name)
    return span_slider(name, situation.spans[index], f"x{index}")


def _middle(spans: Sequence[Span]) -> NDArray[np.float32]:
    return np.array([span.middle for span in spans], dtype=np.float32)


def _put(state: NDArray[np.float32], spans: Sequence[Span]) -> None:
    """Move the sliders; for callbacks, and before they are drawn."""
    near = within(state, spans)
    for index, value in enumerate(near.tolist()):
        st.session_state[f"x{index}"] = value
    st.session_state["_what_if_moved"] = int((near != state).sum())
