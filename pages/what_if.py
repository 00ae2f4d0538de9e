"""What if: one state, and what the shield would do in it, why, and what would change that."""

from __future__ import annotations

from typing import Any

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.decimals import digits_telling
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.html.lit_path import PathFinder
from sarl_core.explaining.words.what_if import by_use
from sarl_core.mining.language import label_text
from sarl_core.mining.rule_order import fits, rules_for
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.near import Neighbourhood, feature_spreads
from sarl_core.shielding.sampling import Span, feature_spans, random_state, within
from sarl_core.shielding.shield import Outside, Projection, Shield
from sarl_dashboard.cache import cached
from sarl_dashboard.components.settings import (
    no_boxes_notice,
    notes_notice,
    outside_choice,
    projection_choice,
)
from sarl_dashboard.jobs.replays import kept_replays
from sarl_dashboard.state import compact_set, edits
from sarl_dashboard.state.agents import PROJECTIONS
from sarl_dashboard.state.data import data_key, require_demonstrations
from sarl_dashboard.state.mined import grown_trees, mined_rules
from sarl_dashboard.state.thresholds import chosen_divider
from sarl_dashboard.text import escaped
from sarl_dashboard.views.what_if.answer import show

MEDIAN = "the median of every feature"
DEMONSTRATED = "a demonstrated state"
REPLAY = "a step of the replay"
COVERED = "a random covered state"
UNCOVERED = "a random uncovered state"
SOURCES = (MEDIAN, DEMONSTRATED, REPLAY, COVERED, UNCOVERED)
IN_FORCE, EDITED = "as mined", "edited"
FIRST = 8  # features whose sliders are not folded away
STEPS = 400  # of a slider


@cached(show_spinner="Laying out the rules …")
def prepared(
    key: str, projection: Projection, outside: Outside, _rule_set: RuleSet
) -> Neighbourhood:
    """A shield, and its rules laid out for questions about single states."""
    return Neighbourhood(Shield(_rule_set, projection=projection, outside=outside))


@cached()
def spans_of(
    digest: str, _demonstrations: Demonstrations
) -> tuple[tuple[Span, ...], NDArray[np.float64]]:
    """Where the values of each feature lie, and what a change of it is measured in."""
    return feature_spans(_demonstrations.observations), feature_spreads(
        _demonstrations.observations
    )


@cached()
def order_of(key: str, _rule_set: RuleSet) -> tuple[int, ...]:
    """The features that most rules ask about first."""
    return by_use(_rule_set)


@cached()
def finder_of(key: str, _rule_set: RuleSet) -> PathFinder:
    """Follows a state through rules that are of no tree at hand."""
    return PathFinder(_rule_set)


def put(values: NDArray[np.float32], spans: tuple[Span, ...]) -> None:
    """Move the sliders; for callbacks, and before they are drawn."""
    near = within(values, spans)
    for index, value in enumerate(near.tolist()):
        st.session_state[f"x{index}"] = value
    moved = int((near != values).sum())
    st.session_state["_what_if_moved"] = moved


def replayed() -> NDArray[np.float32] | None:
    """The states of the latest replay, if it is of as many features."""
    order = st.session_state.get("_replay")
    found = kept_replays().get(order.request) if order is not None else None
    if found is None or found.shown.steps is None:
        return None
    observations: NDArray[np.float32] = found.shown.steps.observation
    return observations if observations.shape[1] == len(spans) else None


def take(more: int = 0) -> None:
    """Take the chosen state; for callbacks.

    Args:
        more: Added to the number first, for another one.
    """
    st.session_state["_what_if_none"] = ""
    source = st.session_state.get("take", MEDIAN)
    number = max(int(st.session_state.get("number") or 0) + more, 0)
    if more:
        st.session_state["number"] = number
    if source == MEDIAN:
        put(np.array([span.middle for span in spans], dtype=np.float32), spans)
        return
    if source in (COVERED, UNCOVERED):
        found = random_state(
            neighbourhood.shield,
            demonstrations.observations,
            covered=source == COVERED,
            seed=number,
        )
        if found is None:
            st.session_state["_what_if_none"] = (
                "No state without a rule was found: these rules cover every state that was tried."
                if source == UNCOVERED
                else "No state was found that has a rule for every action dimension."
            )
            return
        put(found, spans)
        return
    rows = demonstrations.observations if source == DEMONSTRATED else replayed()
    if rows is None:
        st.session_state["_what_if_none"] = (
            "There is no replay of these features in this session. Run one on the Replay page, "
            "then take a step of it here."
        )
        return
    put(rows[number % len(rows)], spans)


def settings() -> None:
    """Where the state comes from."""
    with st.container(border=True):
        with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
            st.selectbox(
                "Take a state",
                SOURCES,
                key="take",
                bind="query-params",
                on_change=take,
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
                on_change=take,
                width=150,
                help="The row of the demonstrations, the step of the replay, or the seed of a "
                "random state. The same number gives the same state.",
            )
            st.button("Take it", icon=":material/my_location:", on_click=take, key="take_it")
            st.button(
                "Another",
                icon=":material/shuffle:",
                on_click=take,
                args=(1,),
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


def slider(index: int) -> float:
    """One feature's slider."""
    feature = demonstrations.features[index]
    name = escaped(f"{feature.name} ({feature.unit})" if feature.unit else feature.name)
    return slide(name, spans[index], f"x{index}")


def slide(name: str, span: Span, key: str) -> float:
    """A slider with as many digits as its steps need."""
    step = (span.high - span.low) / STEPS
    digits = digits_telling(step, max(abs(span.low), abs(span.high)))
    return float(
        st.slider(
            name,
            span.low,
            span.high,
            span.middle,
            step=step,
            key=key,
            bind="query-params",
            format=f"%.{digits}g",
        )
    )


def sliders() -> NDArray[np.float32]:
    """The state."""
    order = order_of(rules_key, rule_set)
    values = dict.fromkeys(order, 0.0)
    for index in order[:FIRST]:
        values[index] = slider(index)
    rest = order[FIRST:]
    if rest:
        with st.expander(f"{len(rest)} more features", icon=":material/unfold_more:"):
            for index in rest:
                values[index] = slider(index)
    return np.array([values[index] for index in range(len(order))], dtype=np.float32)


def proposal() -> Any:
    """What the agent wants to do, in the environment's own form."""
    several = len(rule_set.actions) > 1
    values: list[float] = []
    for index, dimension in enumerate(rule_set.actions):
        title = f"The agent wants: {dimension.name}" if several else "The agent wants"
        if dimension.is_interval:
            low, high = dimension.edges[0], dimension.edges[-1]
            if low == high:  # the rules know a single value; the agent may want another
                low, high = low - 1.0, high + 1.0
            values.append(slide(title, Span(low, (low + high) / 2, high), f"a{index}"))
            continue
        names = [label_text(label, dimension) for label in range(dimension.n_labels)]
        chosen = st.selectbox(title, names, key=f"a{index}", bind="query-params")
        values.append(dimension.first + names.index(chosen))
    if rule_set.actions[0].is_interval:
        return np.array(values, dtype=np.float32)
    return np.array(values, dtype=np.int64) if several else int(values[0])


def chosen_rules() -> tuple[RuleSet, str]:
    """The set in force, or the same with the edits, and what tells it from others."""
    if compact is not None:
        found, key = compact.counted, compact.digest
    else:
        found = mined_rules(grown)
        key = repr((data_key(), found.source.digest, found.thresholds, found.divider))
    if edits.offered() and (
        st.segmented_control(
            "Rules",
            [IN_FORCE, EDITED],
            default=IN_FORCE,
            key="edits",
            bind="query-params",
            required=True,
        )
        == EDITED
    ):
        edited, digest = edits.edited_rules()
        if fits(edited, demonstrations):
            edited, notes = rules_for(edited, demonstrations)
            notes_notice(notes)
            return edited, f"edited {digest}"
        st.info(
            "The edited rules speak of other features or actions than the chosen demonstrations, "
            "so the rules in force are shown instead; choose the demonstrations of their "
            "environment in the sidebar.",
            icon=":material/swap_horiz:",
        )
    return found, key


@st.fragment
def body() -> None:
    """Everything that answers to a slider."""
    settings()
    left, right = st.columns([4, 7], gap="large")
    with left:
        action = proposal()
        st.markdown("**The state**")
        values = sliders()
    show(
        right,
        neighbourhood,
        values,
        action,
        spans,
        spreads,
        order_of(rules_key, rule_set),
        trees=compact.trees if compact is not None else grown,
        leaves=compact is not None,
        finder=lambda: finder_of(rules_key, rule_set),
        key=rules_key,
    )


# --- the page ----------------------------------------------------------------------------------

st.title("What if")
st.caption(
    "One state, and what the shield would do in it: the rule that applies, the rules that nearly "
    "do, and the least change that makes it decide otherwise."
)
demonstrations = require_demonstrations()
compact = compact_set.chosen_compact(demonstrations)
grown = grown_trees(demonstrations, chosen_divider()) if compact is None else compact.trees
rule_set, rules_key = chosen_rules()
if not rule_set.rules:
    st.info(
        "No rule is in force, so there is nothing to ask. Lower a threshold on the Thresholds "
        "page, whose maps show where there are rules.",
        icon=":material/filter_alt_off:",
    )
    st.page_link("thresholds.py", label="Go to Thresholds", icon=":material/arrow_forward:")
    st.stop()
with st.container(horizontal=True, vertical_alignment="bottom", gap="small"):
    beyond = outside_choice(220)
    projection: Projection = PROJECTIONS[0]
    if rule_set.actions[0].is_interval:
        projection = projection_choice(220)
no_boxes_notice([rule_set], beyond)
neighbourhood = prepared(rules_key, projection, beyond, rule_set)
spans, spreads = spans_of(demonstrations.digest, demonstrations)
# Other data has other sliders under the same names.
told = repr(spans)
if st.session_state.get("_what_if_data", told) != told:
    put(np.array([span.middle for span in spans], dtype=np.float32), spans)
st.session_state["_what_if_data"] = told
for place, span in enumerate(spans):
    kept = st.session_state.get(f"x{place}")
    if kept is not None and not span.low <= kept <= span.high:
        st.session_state[f"x{place}"] = span.middle
body()
