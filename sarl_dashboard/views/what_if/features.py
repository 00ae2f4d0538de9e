"""Which features of the state have a slider on the page What if: all, or of many those that matter.

A widget that is not drawn forgets its value, and so does the address: what was chosen for others
is remembered here, and stands in the address under one name (URL: further).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from sarl_core.demonstrations.words import Coded, indicated, words_of
from sarl_core.mining.language import counted
from sarl_dashboard.components.lists.feature_search import searched
from sarl_dashboard.components.lists.pages import follow, number_of_pages, page_choice
from sarl_dashboard.state.url import set_url_choice, url_text
from sarl_dashboard.views.what_if.situation import Situation
from sarl_dashboard.views.what_if.state import FIRST_ONES, draw, middle_state

FIRST = 8  # features whose sliders are not folded away, or that come first among many
MANY = 24  # sliders that are drawn at most before the others are searched for
PAGE_SLIDERS = 8
SEARCH, PAGE, FURTHER = "what_if_search", "what_if_page", "further"
_LONGEST = 20_000  # signs of what an address says of other features

Value = float | str


class ChosenState(NamedTuple):
    """A state, and the features that are looked at.

    Attributes:
        state: Shape (d,).
        drawn: Observed features in their order; all of them where there are few.
    """

    state: NDArray[np.float32]
    drawn: tuple[int, ...]


def sliders(situation: Situation) -> ChosenState:
    """A slider for each number of the state, a choice for each word.

    Of many features those have theirs that the rule in force there and most rules ask about; the
    others are searched for, and turned over a page at a time.
    """
    order = _widgets(situation)
    state = np.zeros(len(situation.spans), dtype=np.float32)
    if len(order) > MANY:
        return _some_sliders(situation, order)
    for index in order[:FIRST]:
        draw(state, situation, index)
    rest = order[FIRST:]
    if rest:
        with st.expander(counted(len(rest), "more feature"), icon=":material/unfold_more:"):
            for index in rest:
                draw(state, situation, index)
    return ChosenState(state, situation.order)


def _some_sliders(situation: Situation, order: Sequence[int]) -> ChosenState:
    values = _chosen_values(situation, order)
    state = _state_of(values, situation)
    first = _that_matter(situation, order, state)
    for index in first:
        _draw_as_chosen(state, situation, index, values)
    others = tuple(index for index in order if index not in first)
    st.markdown(f"**{counted(len(others), 'more feature')}**")
    named = searched([_name(situation, index) for index in others], SEARCH)
    if not named:
        st.caption("No other feature has such a name; clear the search to see all.")
    pages = number_of_pages(len(named), PAGE_SLIDERS)
    follow(PAGE, tuple(named), None, page=0, pages=pages)
    widgets = st.container()
    # Which page it is has to be known before the sliders, which stand above the choice.
    begin = page_choice(PAGE, pages) * PAGE_SLIDERS
    page = [others[place] for place in named[begin : begin + PAGE_SLIDERS]]
    with widgets:
        for index in page:
            _draw_as_chosen(state, situation, index, values)
    drawn = (*first, *page)
    _remember(situation, values, drawn)
    return ChosenState(state, _with_all_words(situation, drawn))


def _widgets(situation: Situation) -> tuple[int, ...]:
    """The features that have a widget, in their order: of a column of words it is the first."""
    first = {at: places[0] for places in situation.columns.values() for at in places}
    return tuple(dict.fromkeys(first.get(index, index) for index in situation.order))


def _name(situation: Situation, index: int) -> str:
    feature = situation.demonstrations.features[index]
    return feature.name if feature.indicator is None else feature.indicator.column


def _with_all_words(situation: Situation, drawn: Sequence[int]) -> tuple[int, ...]:
    """The features with all that say of one column of words which it is."""
    of_word = {places[0]: places for places in situation.columns.values()}
    return tuple(at for index in drawn for at in of_word.get(index, [index]))


def _that_matter(
    situation: Situation, order: Sequence[int], state: NDArray[np.float32]
) -> tuple[int, ...]:
    """The features that the rules in force there ask about, and those that most rules do.

    As long as no other state is taken they stay where they are, and others come behind them.
    """
    rule_set = situation.rules.rule_set
    features = rule_set.source.features
    widget = {at: places[0] for places in situation.columns.values() for at in places}
    queried: list[int] = []
    for rule in situation.neighbourhood.shield.rules_in_force(state[None])[0].tolist():
        for bounds in rule_set[rule].bounds if rule >= 0 else ():
            derived = features[bounds.feature].derived
            places = (bounds.feature,) if derived is None else derived.features
            queried += [widget.get(at, at) for at in places]
    of, before = st.session_state.get(FIRST_ONES, ("", ()))
    if of != rule_set.digest or not set(before) <= set(order):
        before = ()
    first = tuple(dict.fromkeys([*before, *queried]))
    if len(first) > MANY:
        first = tuple(dict.fromkeys(queried))[:MANY]
    if len(first) < FIRST:
        first = tuple(dict.fromkeys([*first, *order]))[:FIRST]
    st.session_state[FIRST_ONES] = rule_set.digest, first
    return first


# --- what was chosen for features that are not drawn -------------------------------------------


def _chosen_values(situation: Situation, order: Sequence[int]) -> dict[int, Value]:
    """What was chosen for features, as far as it was: number, or word of a column."""
    known = cast("dict[int, Value]", st.session_state.setdefault("_what_if_values", {}))
    for part in url_text(FURTHER, "", lambda text: len(text) <= _LONGEST).split("~"):
        place, _, text = part.partition(":")
        if place.isascii() and place.isdigit() and len(place) < 7:
            known.setdefault(int(place), text)
    values: dict[int, Value] = {}
    for index in order:
        key = f"x{index}"
        value = st.session_state.get(key, known.get(index, st.query_params.get(key)))
        fitting = None if value is None else _fitting(situation, index, value)
        if fitting is not None:
            values[index] = fitting
    return values


def _fitting(situation: Situation, index: int, value: Value) -> Value | None:
    """A value that the feature's widget takes; None for any other."""
    if situation.demonstrations.features[index].indicator is not None:
        return str(value) if value in _words(situation, index) else None
    try:
        number = float(value)
    except ValueError:  # an address may say anything
        return None
    span = situation.spans[index]
    return number if math.isfinite(number) and span.low <= number <= span.high else None


def _words(situation: Situation, index: int) -> Sequence[str]:
    return words_of(situation.indicators(_places(situation, index)))


def _places(situation: Situation, index: int) -> list[int]:
    return next(places for places in situation.columns.values() if places[0] == index)


def _state_of(values: dict[int, Value], situation: Situation) -> NDArray[np.float32]:
    """The state with these values, the middle of every other feature."""
    state = middle_state(situation.spans)
    for index, value in values.items():
        if not isinstance(value, str):
            state[index] = value
            continue
        places = _places(situation, index)
        words = words_of(situation.indicators(places))
        coded = Coded(np.array([words.index(value)]), words)
        state[places] = indicated(coded, situation.indicators(places))[0]
    return state


def _draw_as_chosen(
    state: NDArray[np.float32], situation: Situation, index: int, values: dict[int, Value]
) -> None:
    """Its widget, which stands where it stood when it was drawn last."""
    key = f"x{index}"
    if key not in st.session_state and index in values:
        st.session_state[key] = values[index]
    draw(state, situation, index)
    values[index] = st.session_state[key]


def _remember(situation: Situation, values: dict[int, Value], drawn: Sequence[int]) -> None:
    """Hold on to what was chosen; the address says it of what has no widget and was moved."""
    st.session_state["_what_if_values"] = values
    spans = situation.spans
    others = (
        f"{at}:{value}"
        for at, value in sorted(values.items())
        if at not in drawn and value != spans[at].middle
    )
    set_url_choice(FURTHER, "~".join(others))
