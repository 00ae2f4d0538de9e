"""The formulas that a person writes: checked as they are typed, listed with their distributions."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations, derived_over, formula_feature
from sarl_core.demonstrations.derived import DerivedFeature, formula_text
from sarl_core.demonstrations.formula_units import unit_warnings
from sarl_core.demonstrations.names import Names, names_of, renamed
from sarl_core.demonstrations.warnings import constant_warnings
from sarl_core.environments.formulas import Formula
from sarl_core.errors import InputError
from sarl_core.explaining.figures.distributions import FeatureRow
from sarl_core.explaining.report.demonstrations import within
from sarl_core.mining.labels import label_dimensions
from sarl_dashboard.cache import cached
from sarl_dashboard.components.distributions import (
    Distribution,
    distribution_of,
    distributions,
    show_distribution,
    show_legend,
)
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.state import formulas, given_names
from sarl_dashboard.state.formulas import Derived
from sarl_dashboard.state.thresholds import chosen_divider
from sarl_dashboard.text import escaped, in_full, refuse
from sarl_dashboard.views.names.example import example_formula

_MOST_SIGNS = 1_000  # that can be typed: with its name, more than a formula may have


@dataclass(frozen=True, eq=False)
class TriedFormula:
    """A formula as it was typed, read and tried.

    Attributes:
        feature: Over the names of the data as they were read; None where it is none.
        problem: Why it is none, in one sentence; "" where it is one.
        warnings: What is odd about its units, or that it never changes.
        distribution: Its values in the demonstrations.
    """

    feature: DerivedFeature | None
    problem: str = ""
    warnings: tuple[str, ...] = ()
    distribution: Distribution | None = None


@cached()
def _read(
    raw: Demonstrations,
    names: Names | None,
    derived: Derived,
    text: str,
    place: int | None,
    divider: int,
) -> TriedFormula:
    """Read a formula under the names in force, and try it on every step.

    Args:
        raw: The data as they were read.
        names: In force; None for those of the data.
        derived: What there is already.
        text: As it was typed.
        place: Of the formula that it takes the place of; None for one more.
        divider: Number of intervals of continuous actions.
    """
    own = names_of(raw)
    try:
        plain = raw.deriving(())
        named = plain if names is None else renamed(plain, names)
        typed = formula_feature(text, named.observed)
        (feature,) = derived_over([typed], range(len(own.features)), own.features)
        ready = raw.deriving(formulas.placed(derived, feature, place))
        if names is not None:
            ready = renamed(ready, names)
    except InputError as error:
        return TriedFormula(None, str(error))
    index = len(own.features) + (len(derived) if place is None else place)
    dimension = label_dimensions(ready, divider)[0]
    return TriedFormula(
        feature,
        warnings=(
            *unit_warnings([*ready.observed, ready.features[index]]),
            *constant_warnings(feature.name, ready.observations[:, index]),
        ),
        distribution=distribution_of(ready, index, dimension, 0),
    )


# --- what is being written ---------------------------------------------------------------------


def _text_key(raw: Demonstrations) -> str:
    return f"formula_{raw.digest[:8]}"


def _place_key(raw: Demonstrations) -> str:
    return f"_formula_place_{raw.digest[:8]}"


def _draft(raw: Demonstrations) -> TriedFormula:
    return _read(
        raw,
        given_names.given_names(raw),
        formulas.derived_of(raw),
        str(st.session_state.get(_text_key(raw)) or ""),
        st.session_state.get(_place_key(raw)),
        chosen_divider(),
    )


def _write(raw: Demonstrations, text: str, place: int | None = None) -> None:
    """Put a text where formulas are typed; for callbacks."""
    st.session_state[_text_key(raw)] = text
    st.session_state[_place_key(raw)] = place


def _take(raw: Demonstrations) -> None:
    """Put what was typed in force, if it can be; for callbacks."""
    draft, place = _draft(raw), st.session_state.get(_place_key(raw))
    if draft.feature is not None:
        formulas.put(raw, formulas.placed(formulas.derived_of(raw), draft.feature, place))
        _write(raw, "")


def _remove(raw: Demonstrations, place: int) -> None:
    """Let a formula go; for callbacks."""
    formulas.put(raw, formulas.without(formulas.derived_of(raw), place))
    if st.session_state.get(_place_key(raw)) is not None:
        _write(raw, "")


def formula_editor(raw: Demonstrations, named: Demonstrations) -> None:
    """Where a formula is typed, and what comes of it at once.

    Args:
        raw: The data as they were read.
        named: The same with what is derived, under the names in force.
    """
    example = example_formula(named)
    place = st.session_state.get(_place_key(raw))
    text = st.text_input(
        "Formula"
        if place is None
        else f"Change the formula “{escaped(named.derived[place].name)}”",
        key=_text_key(raw),
        max_chars=_MOST_SIGNS,
        placeholder=example or "name [unit] = formula",
        live="300ms",
        persist_state="session",
        help=with_words(
            "A name, a unit in brackets (or none), an equals sign; then numbers, names of "
            "features, + - * /, min, max, abs and parentheses. A name is written as it is, with "
            "spaces or underscores, and in quotation marks where it has other signs."
        ),
    )
    is_empty = not (text or "").strip()
    if is_empty and place is None:
        _beginning(raw, example)
        return
    draft = _draft(raw)
    if draft.problem and not is_empty:
        refuse(draft.problem)
    for warning in draft.warnings:
        st.warning(in_full(warning), icon=":material/straighten:")
    with st.container(horizontal=True):
        st.button(
            "Add the formula" if place is None else "Change the formula",
            icon=":material/add:" if place is None else ":material/check:",
            key="formula_take",
            type="primary",
            on_click=_take,
            args=(raw,),
            disabled=draft.feature is None,
        )
        st.button("Cancel", key="formula_cancel", on_click=_write, args=(raw, ""))
    if draft.distribution is not None:
        if not _places(named):
            show_legend(label_dimensions(named, chosen_divider())[0])
        with st.container(border=True, width=420):
            show_distribution(draft.distribution, "formula_draft")
            st.caption(_numbers(draft.distribution.row))


def _beginning(raw: Demonstrations, example: str) -> None:
    """What a formula is good for, and one to begin with."""
    if not example:
        return
    with st.container(horizontal=True, vertical_alignment="center", gap="small"):
        st.caption("For example, with these data:", width="content")
        st.code(example, language=None, wrap_lines=True, width="content")
        st.button(
            "Begin with it",
            icon=":material/edit:",
            key="formula_example",
            on_click=_write,
            args=(raw, example),
        )


# --- those in force ----------------------------------------------------------------------------


def show_formulas(raw: Demonstrations, named: Demonstrations) -> None:
    """Each formula in force, with its distribution, to be changed or removed.

    Args:
        raw: The data as they were read.
        named: The same with what is derived, under the names in force.
    """
    places = _places(named)
    if not places:
        return
    divider, first = chosen_divider(), len(named.observed)
    pictures = distributions(named, divider, 0, tuple(first + place for place in places))
    show_legend(label_dimensions(named, divider)[0])
    with st.grid(3, min_column_width=300, gap="small") as grid:
        for place, distribution in zip(places, pictures, strict=True):
            with grid.cell(), st.container(border=True):
                _show_formula(raw, named, place, distribution)


def _places(named: Demonstrations) -> list[int]:
    """Where the formulas stand in what is derived."""
    return [place for place, one in enumerate(named.derived) if isinstance(one.definition, Formula)]


def _show_formula(
    raw: Demonstrations, named: Demonstrations, place: int, distribution: Distribution
) -> None:
    feature, one = named.features[len(named.observed) + place], named.derived[place]
    show_distribution(distribution, f"formula_{place}")
    st.caption(_numbers(distribution.row))
    st.code(str(one.definition), language=None, wrap_lines=True)
    for warning in unit_warnings([*named.observed, feature]):
        st.caption(f":material/straighten: {in_full(warning)}")
    with st.container(horizontal=True):
        st.button(
            "Change",
            icon=":material/edit:",
            key=f"formula_change_{place}",
            on_click=_write,
            args=(raw, formula_text(one), place),
        )
        st.button(
            "Remove",
            icon=":material/delete:",
            key=f"formula_remove_{place}",
            on_click=_remove,
            args=(raw, place),
        )


def _numbers(row: FeatureRow) -> str:
    """A feature in three numbers."""
    low, median, high = (within(value, row) for value in (row.low, row.median, row.high))
    return f"Least {low}, median {median}, largest {high}"
