"""Names: what features, units, actions and labels are called, everywhere."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import streamlit as st

from sarl_core.decimals import decimal_on_scale
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import save_demonstrations
from sarl_core.demonstrations.names import Names, names_of
from sarl_core.mining.language import sentence
from sarl_dashboard.state import given_names
from sarl_dashboard.state.data import all_demonstrations, raw_demonstrations, require_demonstrations
from sarl_dashboard.state.mined import grown_trees, largest_rules
from sarl_dashboard.state.thresholds import chosen_divider, chosen_thresholds
from sarl_dashboard.text import escaped, file_name, in_full

FEATURES, ACTIONS, LABELS = "Features", "Actions", "Labels"


# --- the tables --------------------------------------------------------------------------------


def columns_of(table: str, names: Names, raw: Demonstrations) -> dict[str, list[Any]]:
    """A table as columns, the names as they stand."""
    own = names_of(raw)
    if table == FEATURES:
        low, high = raw.observations.min(axis=0), raw.observations.max(axis=0)
        return {
            "Name": list(names.features),
            "Unit": list(names.units),
            "Came as": list(own.features),
            "Least": list(map(decimal_on_scale, low.tolist(), low.tolist(), high.tolist())),
            "Largest": list(map(decimal_on_scale, high.tolist(), low.tolist(), high.tolist())),
        }
    if table == ACTIONS:
        return {"Name": list(names.actions), "Came as": list(own.actions)}
    dimensions = raw.action_dimensions
    return {
        "Action": [
            number + dimension.first
            for dimension in dimensions
            for number in range(len(dimension.labels))
        ],
        "Name": [name for labels in names.labels for name in labels],
        "Came as": [name for labels in own.labels for name in labels],
        "Of": [dimension.name for dimension in dimensions for _ in dimension.labels],
    }


def changed(table: str, names: Names, rows: dict[int, dict[str, Any]]) -> Names:
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
    return f"names_{table}_{raw.digest[:8]}_{st.session_state.get('_names_reset', 0)}"


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
    rows = st.session_state[key]["edited_rows"]
    began = changed(table, begun[key], rows)
    now = given_names.draft(raw)
    parts: dict[str, dict[str, Any]] = {
        FEATURES: {"features": began.features, "units": began.units},
        ACTIONS: {"actions": began.actions},
        LABELS: {"labels": began.labels},
    }
    given_names.give(raw, now._replace(**parts[table]))


def editor(table: str, raw: Demonstrations) -> None:
    """One table in which names are typed."""
    import pandas as pd

    began = begin(table, raw)
    frame = pd.DataFrame(columns_of(table, began, raw))
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
            "Least": column.NumberColumn(format="%.12g", width=78),
            "Largest": column.NumberColumn(format="%.12g", width=82),
            "Action": column.NumberColumn(format="%d", width="small"),
        },
    )


# --- what follows ------------------------------------------------------------------------------


def forget(raw: Demonstrations) -> None:
    """Back to the names of the data."""
    given_names.reset(raw)
    st.session_state["_names_reset"] = st.session_state.get("_names_reset", 0) + 1


def as_parquet(demonstrations: Demonstrations) -> bytes:
    """The data with the names in its metadata."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "demonstrations.parquet"
        save_demonstrations(demonstrations, path)
        return path.read_bytes()


def show_sentence(demonstrations: Demonstrations) -> None:
    """How a rule reads under these names."""
    grown = grown_trees(demonstrations, chosen_divider())
    rules = largest_rules(grown, chosen_thresholds(), 5).part
    if not rules.rules:
        return
    longest = max(rules.rules, key=lambda rule: rule.merged_length)
    with st.container(border=True):
        st.caption("So a rule reads now")
        st.markdown(escaped(sentence(longest, rules)))


st.title("Names")
st.caption(
    "What features, units, actions and labels are called, in every sentence, axis and export. The "
    "rules stay the same. Names are kept while this page is open in your browser; the Parquet file "
    "takes them along."
)
require_demonstrations()
data = raw_demonstrations()
assert data is not None
for each in (FEATURES, ACTIONS, LABELS):
    take(each, data)
refused = given_names.problem(data)
if refused:
    st.error(
        f"{in_full(refused)} Until then the names before this change are used.",
        icon=":material/error:",
    )
left, right = st.columns([5, 3], gap="medium")
with left:
    st.subheader(FEATURES)
    editor(FEATURES, data)
with right:
    st.subheader(ACTIONS)
    editor(ACTIONS, data)
    if data.is_discrete:
        st.subheader(LABELS)
        editor(LABELS, data)
    else:
        st.caption("The labels are intervals of these actions, named by their bounds.")
named = all_demonstrations()
assert named is not None
with st.container(horizontal=True):
    st.download_button(
        "Download as Parquet",
        partial(as_parquet, named),
        file_name=f"{file_name(named.env_id)}.parquet",
        mime="application/vnd.apache.parquet",
        on_click="ignore",
        icon=":material/download:",
        key="names_parquet",
        help="All steps with the names in force; upload it to go on with them",
    )
    st.button(
        "Back to the original names",
        icon=":material/restart_alt:",
        key="names_back",
        on_click=forget,
        args=(data,),
        disabled=given_names.given_names(data) is None and not refused,
    )
show_sentence(require_demonstrations())
