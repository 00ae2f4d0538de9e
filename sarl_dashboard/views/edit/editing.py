"""The edits of some rules and all that follows from them, on the page Edit."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_dashboard.components.keeping import keep_rules_form
from sarl_dashboard.state import edits, in_force
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.text import refuse
from sarl_dashboard.views.edit import form
from sarl_dashboard.views.edit.conflicts import conflicts
from sarl_dashboard.views.edit.part import part
from sarl_dashboard.views.edit.rule import chosen_rule
from sarl_dashboard.views.edit.table import table
from sarl_dashboard.views.edit.totals import bar, numbers


@st.fragment
def editing(of: Base) -> None:
    """The edits and all that follows from them; nothing else on the page does."""
    if in_force.has_changed():
        st.rerun()  # as a whole: the sidebar says how many edits are in force
    try:
        before = edits.verdicts_of(of, ())
        after = edits.verdicts_of(of, edits.history(of).edits)
    except SarlError as problem:
        refuse(problem)
        return
    bar(of)
    numbers(of, before, after)
    if after.rule_set.rules:
        rule = table(of, after)
        if rule is not None:
            wish = chosen_rule(of, rule, after)
            if wish:
                form.begin(of, rule, changing=wish == "change")
            if not of.rule_set.forbids:  # no tree of demands is cut here
                part(of, rule, after)
    else:
        st.info(
            "No rule is in force at these thresholds. Lower one of them on the Thresholds page, or "
            "add a rule by hand.",
            icon=":material/filter_alt_off:",
        )
    form.form(of, after)
    conflicts(of, after)
    if edits.history(of).edits and in_force.is_edited():
        if in_force.in_address():
            st.caption(
                "The address of this page holds these edits, for you and for whoever has it. In "
                "the list of the Library they stand once you keep the rules."
            )
        keep_rules_form(after.rule_set, in_force=True)
