"""The names of features, units, actions and labels: tables to type them in, and how they read."""

from __future__ import annotations

from typing import Any

import streamlit as st

from sarl_core.decimals import decimal_on_scale, decimal_text
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import Names, names_of
from sarl_core.mining.language import sentence
from sarl_dashboard.components.lists.feature_search import searched, with_words
from sarl_dashboard.state import given_names
from sarl_dashboard.state.mined import grown_trees, largest_rules
from sarl_dashboard.state.thresholds import chosen_divider, chosen_thresholds
from sarl_dashboard.text import escaped

FEATURES, ACTIONS, LABELS = "Features", "Actions", "Labels"
SEARCH = "name_search"
_MANY = 24  # features, among which one searches


def columns_of(table: str, names: Names, raw: Demonstrations) -> dict[str, list[Any]]:
    """A table as columns, the names as they stand."""
    own = names_of(raw)
    if table == FEATURES:
        low, high = raw.raw_observations.min(axis=0), raw.raw_observations.max(axis=0)
        return {
            "Name": list(names.features),
            "Unit": list(names.units),
            "Came as": list(own.features),
            **{
                title: [
                    decimal_text(decimal_on_scale(value, *ends))
                    if feature.indicator is None
                    else "–"
                    for feature, value, *ends in zip(
                        raw.observed, values.tolist(), low.tolist(), high.tolist(), strict=True
                    )
                ]
                for title, values in (("Least", low), ("Largest", high))
            },
        }
    if table == ACTIONS:
        return {"Name": list(names.actions), "Came as": list(own.actions)}
    dimensions = raw.action_dimensions
    return {
        "Action": [action for dimension in dimensions for action in dimension.actions],
        "Name": [name for labels in names.labels for name in labels],
        "Came as": [name for labels in own.labels for name in labels],
        "Of": [dimension.name for dimension in dimensions for _ in dimension.labels],
    }


def with_typed(table: str, names: Names, rows: dict[int, dict[str, Any]]) -> Names:
    """Names with what was typed into one table."""

    def typed(column: str, before: tuple[str, ...], first: int = 0) -> tuple[str, ...]:
        return tuple(
            str(rows.get(first + place, {}).get(column, name) or "")
            for place, name in enumerate(before)
        )

    if table == FEATURES:
        return names._replace(
            features=typed("Name", names.features), units=typed("Unit", names.units)
        )
    if table == ACTIONS:
        return names._replace(actions=typed("Name", names.actions))
    labels, first = [], 0
    for before in names.labels:
        labels.append(typed("Name", before, first))
        first += len(before)
    return names._replace(labels=tuple(labels))


def key_of(table: str, raw: Demonstrations) -> str:
    """The widget's key; another after a reset, so that it forgets what was typed."""
    rows = "" if table != FEATURES else "_".join(_words(raw))
    return f"names_{table}_{raw.digest[:8]}_{st.session_state.get('_names_reset', 0)}{rows}"


def _words(raw: Demonstrations) -> list[str]:
    """What is searched for among many features."""
    text = st.session_state.get(SEARCH) or st.query_params.get(SEARCH) or ""
    return str(text).lower().split() if len(raw.observed) > _MANY else []


def rows_of(table: str, raw: Demonstrations, began: Names) -> list[int] | None:
    """The rows of a table that are shown; None for all.

    What is searched for is one of the names that the table began with, or that came with the data:
    a row does not go while it is being renamed.
    """
    words = _words(raw)
    if table != FEATURES or not words:
        return None
    both = [" ".join(pair) for pair in zip(began.features, names_of(raw).features, strict=True)]
    return with_words(both, " ".join(words))


def begin(table: str, raw: Demonstrations) -> Names:
    """The names that a table began with on this visit: what is typed is told as changes to it."""
    key = key_of(table, raw)
    begun = st.session_state.setdefault("_names_begun", {})
    if key not in st.session_state or key not in begun:
        begun[key] = given_names.draft(raw)
    began: Names = begun[key]
    return began


def take(table: str, raw: Demonstrations) -> None:
    """Keep what was typed since the last run, and put it in force if it can be."""
    key, begun = key_of(table, raw), st.session_state.get("_names_begun", {})
    if key not in st.session_state or key not in begun:
        return
    rows, places = st.session_state[key]["edited_rows"], rows_of(table, raw, begun[key])
    if places is not None:
        rows = {places[row]: typed for row, typed in rows.items()}
    typed = with_typed(table, begun[key], rows)
    parts: dict[str, dict[str, Any]] = {
        FEATURES: {"features": typed.features, "units": typed.units},
        ACTIONS: {"actions": typed.actions},
        LABELS: {"labels": typed.labels},
    }
    given_names.give(raw, given_names.draft(raw)._replace(**parts[table]))


def editor(table: str, raw: Demonstrations) -> None:
    """One table in which names are typed."""
    import pandas as pd

    if table == FEATURES and len(raw.observed) > _MANY:
        searched(names_of(raw).features, SEARCH)
    began = begin(table, raw)
    frame = pd.DataFrame(columns_of(table, began, raw))
    places = rows_of(table, raw, began)
    if places is not None:
        frame = frame.iloc[places]
    fixed = [str(name) for name in frame if name not in ("Name", "Unit")]
    if table == LABELS and len(raw.action_dimensions) == 1:
        frame = frame.drop(columns="Of")
        fixed.remove("Of")
    column = st.column_config
    st.data_editor(
        frame,
        key=key_of(table, raw),
        hide_index=table == LABELS,  # the others are counted in what is said about them
        disabled=fixed,
        num_rows="fixed",
        height="content" if len(frame) <= 24 else 620,
        column_config={
            "Name": column.TextColumn(width=170, max_chars=200, help="Click to change it"),
            "Unit": column.TextColumn(width=72, max_chars=40, help="As rad or m/s; may be empty"),
            "Came as": column.TextColumn(help="The name in the data as they were read"),
            "Least": column.TextColumn(width=78),
            "Largest": column.TextColumn(width=82),
            "Action": column.NumberColumn(format="%d", width="small"),
            "_index": column.Column(disabled=True),
        },
    )


def forget(raw: Demonstrations) -> None:
    """Back to the names of the data."""
    given_names.reset(raw)


def show_sentence(demonstrations: Demonstrations) -> None:
    """How a rule reads under these names."""
    grown = grown_trees(demonstrations, chosen_divider())
    rules = largest_rules(grown, chosen_thresholds(), 5).part
    if not rules.rules:
        return
    longest = max(rules.rules, key=lambda rule: rule.length)
    with st.container(border=True):
        st.caption("So a rule reads now")
        st.markdown(escaped(sentence(longest, rules)))
