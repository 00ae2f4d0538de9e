"""Keeping a rule set in the library, from the pages where one is made."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.state import library
from sarl_dashboard.state.data import raw_demonstrations
from sarl_dashboard.text import refuse


def keep_rules_form(rule_set: RuleSet) -> None:
    """A name and a button; once kept, where it is.

    Args:
        rule_set: As it stands on the page.
    """
    raw = raw_demonstrations()
    if raw is None:
        return
    usual = f"{counted(len(rule_set), 'rule')} for {rule_set.source.env_id or 'these data'}"
    with st.container(horizontal=True, vertical_alignment="bottom"):
        name = st.text_input("Keep in the library as", usual, key="keep_name", max_chars=200)
        pressed = st.button("Keep", key="keep_rules", icon=":material/inventory_2:")
    if not pressed:
        return
    try:
        item = library.keep_rules(rule_set, name, raw)
    except SarlError as error:
        refuse(error)
        return
    st.page_link(
        "library.py",
        label=f"Kept: {item.name}" if item.name == name else f"Kept already: {item.name}",
        icon=":material/check:",
        query_params={"item": item.id},
    )
