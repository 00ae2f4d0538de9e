"""Which rules, before any edits: at the thresholds, a compact set, a kept one, or those of a file.

Chosen once, in the sidebar. The URL holds it (set), and nothing takes the place of what a link
names and is not here.
"""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.errors import InputError, SarlError, quoted
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.state import library
from sarl_dashboard.state.data import (
    chosen_dataset,
    chosen_demonstrations,
    data_key,
    dataset_label,
    raw_demonstrations,
)
from sarl_dashboard.state.mined import rules_at
from sarl_dashboard.state.rule_files import (
    CHOSEN,
    COMPACT_ENDINGS,
    IN_LIBRARY,
    OWN_FILE,
    as_named,
    compact_rules,
    compact_sets,
    rules_in_file,
    unnamed_compact_rules,
)
from sarl_dashboard.state.thresholds import (
    DEMAND,
    MIN_DIVIDER,
    THRESHOLDS,
    chosen_divider,
    chosen_mode,
)
from sarl_dashboard.state.url import set_url_choice, url_name
from sarl_dashboard.text import digest_of

_MOST_LISTED = 12  # of what is kept; the page Library has all


@dataclass(frozen=True, eq=False)
class Base:
    """Rules without edits.

    Attributes:
        kind: One of the words on screen.
        key: To which edits belong, whatever the thresholds and names.
        rule_set: The rules.
        name: Of the file, or of what is kept; "" for none.
    """

    kind: str
    key: str
    rule_set: RuleSet
    name: str = ""


def base_name() -> str:
    """What is chosen (URL: set): thresholds, a compact set, an id of the library, a file."""
    return url_name("set", THRESHOLDS)


def choose(name: str = THRESHOLDS) -> None:
    """Choose rules, those at the thresholds where no others are named; for callbacks."""
    set_url_choice("set", name, THRESHOLDS)


def at_thresholds() -> bool:
    """Whether the thresholds say which rules these are."""
    return base_name() == THRESHOLDS


def compact_name() -> str | None:
    """Name of the compact set that is chosen; None for other rules."""
    name = base_name()
    return name if name in compact_sets() else None


def base_kind() -> str:
    """What is chosen, as it is called on screen."""
    name = base_name()
    if name == THRESHOLDS:
        return CHOSEN
    return name if name in (*COMPACT_ENDINGS, OWN_FILE) else IN_LIBRARY


def problem() -> str:
    """Why the rules that a link or a choice names cannot be had; "" where they can."""
    name = base_name()
    if name == THRESHOLDS:
        return ""
    try:
        _fixed_base(name)
    except SarlError as error:
        return str(error)
    return ""


def leave_what_is_of_other_data() -> None:
    """Go back to the thresholds where a compact set was in force on data that were chosen before.

    With other data chosen, there may be none of that name; that of a link is not left.
    """
    name, data = base_name(), chosen_dataset()
    before = st.session_state.get("_set_of", (data, name))
    missing = name in COMPACT_ENDINGS and name not in compact_sets()
    if missing and before[0] != data and before[1] == name:
        choose()
        name = THRESHOLDS
    st.session_state["_set_of"] = (data, name)


def base() -> Base:
    """The chosen rules.

    Raises:
        InputError: If they cannot be had.
    """
    name = base_name()
    if name != THRESHOLDS:
        return _fixed_base(name)
    rule_set = rules_at()
    # A rule's number is its node's, the same at all thresholds.
    return Base(CHOSEN, _thresholds_key(), rule_set)


def base_key(name: str) -> str:
    """To which edits of some rules belong; nothing is mined to say it.

    Raises:
        InputError: If the rules cannot be had.
    """
    return _thresholds_key() if name == THRESHOLDS else _fixed_base(name).key


def _thresholds_key() -> str:
    demonstrations = chosen_demonstrations()
    discrete = demonstrations is None or demonstrations.is_discrete
    key = repr((data_key(), MIN_DIVIDER if discrete else chosen_divider()))
    # Rules that forbid have other numbers than those that demand.
    return key if chosen_mode() == DEMAND else f"{key} {chosen_mode()}"


def _fixed_base(name: str) -> Base:
    """Rules that no threshold moves."""
    if name in COMPACT_ENDINGS:
        if name not in compact_sets():
            data = dataset_label(chosen_dataset())
            raise InputError(
                f"there are no rules called {quoted(name)} for {data}; choose others in the sidebar"
            )
        return Base(name, f"compact {unnamed_compact_rules(name).digest}", compact_rules(name))
    if name == OWN_FILE:
        uploaded = st.session_state.get("_rule_file")
        if uploaded is None:
            raise InputError(
                "the rule file that was chosen was not kept and is gone with the visit in which "
                "it was uploaded; upload it again, or choose other rules in the sidebar"
            )
        file_name, content = uploaded
        rule_set = rules_in_file(content, file_name)
        return Base(OWN_FILE, f"file {digest_of(content)}", as_named(rule_set), file_name)
    if not library.is_id(name):
        raise InputError(
            f"there are no rules called {quoted(name)}; check the address, or choose others in the "
            "sidebar"
        )
    item = library.standing_item(name)
    return Base(IN_LIBRARY, f"kept {item.digest}", as_named(library.stored_rules(item)), item.name)


def take_file(content: bytes, name: str) -> None:
    """Keep an uploaded rule file and choose it; what was chosen before stays where that fails.

    Args:
        content: Of the file.
        name: Of the file.

    Raises:
        InputError: If it is no rule file.
    """
    rule_set = rules_in_file(content, name)
    try:
        choose(library.keep_rule_file(rule_set, name).id)
    except SarlError as error:
        library.say_once(error)
        st.session_state["_rule_file"] = (name, content)
        choose(OWN_FILE)


def labels() -> dict[str, str]:
    """What may be chosen, and what it is called; no two are called alike.

    What a link names and cannot be had is among them.
    """
    named = {THRESHOLDS: "At the thresholds"}
    named |= {name: set_title(name) for name in compact_sets()}
    if "_rule_file" in st.session_state:
        named[OWN_FILE] = st.session_state["_rule_file"][0]
    chosen, raw = base_name(), raw_demonstrations()
    env_id = "" if raw is None else raw.env_id
    for item in library.own_rules():
        if len(named) >= _MOST_LISTED:
            break
        own = chosen_dataset() in item.came_from
        if own or item.id == chosen or (item.details.get("environment") or "") == env_id:
            named[item.id] = _free(named, item.name, library_label(item.id))
    if chosen not in named:
        named[chosen] = _free(named, _name_of(chosen), f"{_name_of(chosen)} ({chosen[:26]})")
    return named


def is_in_library(name: str) -> bool:
    """Whether rules are called by an id of the library."""
    return library.is_id(name)


def library_label(identifier: str) -> str:
    """What kept rules are called beside other versions of them."""
    try:
        item = library.standing_item(identifier)
    except SarlError:
        return f"Not here ({identifier[:6]}…)"
    return f"{item.name} ({item.created.astimezone():%d %b, %H:%M:%S})"


def library_rules(identifier: str) -> RuleSet:
    """Rules of the library, in the order and under the names of the chosen demonstrations.

    Raises:
        SarlError: If they cannot be had.
    """
    return as_named(library.stored_rules(library.standing_item(identifier)))


def _free(taken: dict[str, str], *names: str) -> str:
    free = [name for name in names if name not in taken.values()]
    return free[0] if free else f"{names[-1]} ({len(taken)})"


def _name_of(chosen: str) -> str:
    try:
        return _fixed_base(chosen).name or "Not here"
    except SarlError:
        return "Not here"


def set_title(name: str) -> str:
    """What a compact set is called.

    Args:
        name: Of the set.

    Returns:
        As "Compact rules, two features".
    """
    size, comma, features = name.partition(",")
    return f"{size.capitalize()} rules{comma}{features}"
