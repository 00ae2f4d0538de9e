"""Keeping rule sets and results in the library, from the pages where they are made."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.mining.editing.edits import Edit
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.state import edits, library, rule_base
from sarl_dashboard.state import in_force as rules_in_force
from sarl_dashboard.state.data import chosen_dataset, dataset_label, raw_demonstrations
from sarl_dashboard.state.url import page_address
from sarl_dashboard.text import refuse


def keep_rules_form(
    rule_set: RuleSet, *, in_force: bool, command: Callable[[], str] = lambda: ""
) -> None:
    """A name and a button; once kept, where it is.

    Args:
        rule_set: As it stands on the page.
        in_force: Whether these are the rules in force, whose edits and parent are known.
        command: Says what makes them again, when they are kept.
    """
    raw = raw_demonstrations()
    if raw is None:
        return
    switched_on = sum(rule.enabled for rule in rule_set)
    # In a list of everything that is kept nobody knows which data "these" were.
    task = rule_set.source.env_id or dataset_label(chosen_dataset())
    usual = f"{counted(switched_on, 'rule')} for {task}"
    with st.container(horizontal=True, vertical_alignment="bottom"):
        name = st.text_input("Keep in the library as", usual, key="keep_name", max_chars=200)
        pressed = st.button("Keep", key="keep_rules", icon=":material/inventory_2:")
    if not pressed:
        return
    try:
        made, parent = _history() if in_force else ((), "")
        item = library.keep_rules(rule_set, name, raw, edits=made, parent=parent, command=command())
    except SarlError as error:
        refuse(error)
        return
    st.page_link(
        "library.py",
        label=f"Kept: {item.name}" if item.name == name else f"Kept already: {item.name}",
        icon=":material/check:",
        query_params={"item": item.id},
    )


def _history() -> tuple[tuple[Edit, ...], str]:
    """The edits of the rules in force, and the id of the version that they were made on."""
    base = rule_base.base()
    made = edits.history(base).edits if rules_in_force.is_edited() else ()
    name = rule_base.base_name()
    return made, name if rule_base.is_in_library(name) else ""


def keep_result_button(
    content: str | bytes | Callable[[], str | bytes],
    file: str,
    *,
    key: str,
    beside: Callable[[], Sequence[str]] = tuple,
) -> None:
    """A button that keeps a result, with the address that opens it as it is.

    Args:
        content: Of the file, or what makes it.
        file: Its name.
        key: Of the button.
        beside: Keeps what belongs to it, and gives the ids.
    """
    if not st.button(
        "Keep",
        icon=":material/inventory_2:",
        key=key,
        help="In the library, with the address of this page as it is now",
    ):
        return
    names = (chosen_dataset(), rule_base.base_name())
    try:
        made = content() if callable(content) else content
        about = [*beside(), *(name for name in names if library.is_id(name))]
        item = library.keep_result(
            made.encode() if isinstance(made, str) else made, file, about, page_address()
        )
    except SarlError as error:
        refuse(error)
        return
    st.page_link(
        "library.py",
        label=f"Kept: {item.name}",
        icon=":material/check:",
        query_params={"item": item.id},
    )
