"""Names: what features, units, actions and labels are called, and formulas on the features."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_dashboard.components.downloads import as_file, download
from sarl_dashboard.components.journey.steps_needed import say_steps_needed
from sarl_dashboard.state import given_names
from sarl_dashboard.state.data import all_demonstrations, raw_demonstrations, require_demonstrations
from sarl_dashboard.state.data_words import say_given
from sarl_dashboard.text import file_name, in_full
from sarl_dashboard.views.names.formulas import formula_editor, show_formulas
from sarl_dashboard.views.names.tables import (
    ACTIONS,
    FEATURES,
    LABELS,
    editor,
    forget,
    show_sentence,
    take,
)

st.title("Names")
st.caption(
    "What features, units, actions and labels are called in every sentence, axis and export, which "
    "changes no rule, and what formulas work out from the features, which rules may then ask about."
)
require_demonstrations()
raw = raw_demonstrations()
assert raw is not None
for table in (FEATURES, ACTIONS, LABELS):
    take(table, raw)
say_given(raw)
problem = given_names.problem(raw)
if problem:
    st.error(
        f"{in_full(problem)} Until then the names before this change are used.",
        icon=":material/error:",
    )
left, right = st.columns([5, 3], gap="medium")
with left:
    st.header(FEATURES)
    editor(FEATURES, raw)
with right:
    st.header(ACTIONS)
    editor(ACTIONS, raw)
    if raw.is_discrete:
        st.header(LABELS)
        editor(LABELS, raw)
    else:
        st.caption("The labels are intervals of these actions, named by their bounds.")
named = all_demonstrations()
assert named is not None
st.header("Formulas")
st.caption(
    "A formula makes one feature of several: a distance over a speed is the time that is left, a "
    "difference of speeds is how fast a gap closes. Rules are then mined with it, on every page."
)
if not say_steps_needed("trying a formula", raw):
    formula_editor(raw, named)
    show_formulas(raw, named)
with st.container(horizontal=True):
    download(
        "Download as Parquet" if raw.sample_of is None else "Download the sample as Parquet",
        partial(as_file, named),
        f"{file_name(named.env_id)}.parquet",
        key="names_parquet",
        meaning="All steps with the names and formulas in force; upload it to go on with them",
    )
    st.button(
        "Back to the original names",
        icon=":material/restart_alt:",
        key="names_back",
        on_click=forget,
        args=(raw,),
        disabled=given_names.given_names(raw) is None and not problem,
    )
show_sentence(require_demonstrations())
