"""Edit: rules switched off, pinned, moved and added by hand, each with what it changes at once."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.mining.language import counted
from sarl_dashboard.state import edits
from sarl_dashboard.state.edits import Base
from sarl_dashboard.state.rule_files import OWN_FILE
from sarl_dashboard.text import escaped, in_full
from sarl_dashboard.views.edit import form
from sarl_dashboard.views.edit.conflicts import conflicts
from sarl_dashboard.views.edit.table import bar, chosen_rule, numbers, table


def take_file() -> None:
    """Keep what was uploaded; what was there before stays where it cannot be read."""
    file = st.session_state.get("edit_rule_file")
    if file is None:
        return
    try:
        edits.take_file(file.getvalue(), file.name)
    except SarlError as error:
        st.session_state["_edit_error"] = str(error)


def choose() -> None:
    """Which rules are edited: what the visitor clicked."""
    chosen = st.session_state["_edit_base"]
    if chosen:
        edits.choose_kind(chosen)


@st.fragment
def editing(of: Base) -> None:
    """The edits and all that follows from them; nothing else on the page does."""
    try:
        before = edits.verdicts_of(of, ())
        after = edits.verdicts_of(of, edits.history(of).edits)
    except SarlError as problem:
        st.error(in_full(str(problem)), icon=":material/error:")
        return
    bar(of)
    numbers(of, before, after)
    if after.rule_set.rules:
        rule = table(of, after)
        if rule is not None:
            wish = chosen_rule(of, rule, after)
            if wish:
                form.begin(of, rule, changing=wish == "change")
    else:
        st.info(
            "No rule is in force at these thresholds. Lower one of them on the Thresholds page, or "
            "add a rule by hand.",
            icon=":material/filter_alt_off:",
        )
    form.form(of, after)
    conflicts(of, after)


st.title("Edit")
st.caption(
    "Switch rules off, pin them, move them, add your own. Edits lie on top of the rules in force, "
    "stay while the thresholds move, and last as long as this session: the rule file keeps them."
)
st.session_state["_edit_base"] = edits.chosen_kind()
st.segmented_control(
    "Rules to edit",
    edits.kinds(),
    key="_edit_base",
    on_change=choose,
    required=True,
    help="Those at the thresholds in the sidebar, the compact ones where there are some, or those "
    "of a rule file.",
)
if edits.chosen_kind() == OWN_FILE:
    st.file_uploader("Rule file (.json)", key="edit_rule_file", on_change=take_file)
try:
    of = edits.base()
except SarlError as problem:
    error = st.session_state.pop("_edit_error", None)
    if error:
        st.error(in_full(error), icon=":material/error:")
    st.info(in_full(str(problem)), icon=":material/upload_file:")
    st.stop()
if of.name:
    st.caption(f"The rules of {escaped(of.name)}, {len(of.rule_set):,} of them.")
others = edits.waiting(of)
if others:
    st.caption(
        f":material/schedule: The edits of {counted(others, 'other rule set')} wait until "
        f"{'it is' if others == 1 else 'they are'} chosen again."
    )
editing(of)
