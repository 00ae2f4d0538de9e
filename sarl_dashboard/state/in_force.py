"""The one rule set in force: which rules, and with which edits.

It is chosen in the sidebar, is the default on every page, and every link carries it: the rules
(URL: set), and an id under which their edits are kept (URL: edits).
"""

from __future__ import annotations

from typing import cast

import streamlit as st

from sarl_core.errors import InputError, SarlError, quoted
from sarl_core.mining.editing.edits import Edit, History, check_edit
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.state import edits, library, rule_base
from sarl_dashboard.state.data import chosen_dataset, data_problem, dataset_label
from sarl_dashboard.state.rule_base import Base
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT_ENDINGS, EDITED, IN_FORCE, UNEDITED
from sarl_dashboard.state.thresholds import THRESHOLDS
from sarl_dashboard.state.url import set_url_choice, url_name

UNKEPT = "unkept"
"""In the place of an id: edits of a visit that could not be kept."""


def take_up() -> None:
    """Put the edits in force that the address names, or say in it which ones are.

    Once a run, before anything is drawn.
    """
    st.session_state.pop("_edits_changed", None)
    st.session_state.pop("_edits_problem", None)
    named = url_name("edits")
    if data_problem():  # it is said on the page, and the address keeps what it names
        rule_base.base_name()
        return
    rule_base.leave_what_is_of_other_data()
    if named == st.session_state.get("_edits_named", ""):
        name_edits()
        return
    try:
        _put_in_force(named)
    except SarlError as error:
        st.session_state["_edits_problem"] = str(error)
    else:
        st.session_state["_edits_named"] = named


def name_edits() -> None:
    """Let the address name the edits in force; at the end of what changes them."""
    named = ""
    if is_edited():
        key = rule_base.base_key(rule_base.base_name())
        named = _id_of(key)
    set_url_choice("edits", named)
    st.session_state["_edits_named"] = named


def _put_in_force(named: str) -> None:
    key = rule_base.base_key(rule_base.base_name())
    if not named:  # the browser went back to where there were none
        _plain().add(key)
        return
    if named == UNKEPT:
        if not edits.history_of(key).edits:
            raise InputError(
                "the edits of this address could not be kept and are gone with the visit in which "
                "they were made; ask for the rule file, or go on without them"
            )
    else:
        if not library.is_id(named):
            raise InputError(f"there are no edits called {quoted(named)}; check the address")
        item = library.linked_item(named, "edits", "edits")
        base = rule_base.base()
        if item.details.get("base") != key:
            raise InputError(
                f"the {item.name} of this address belong to other rules than those it names (other "
                "data, formulas, episodes or divider); ask whoever sent it for a new link, or go "
                "on without them"
            )
        made = library.stored_edits(item, base.rule_set)
        if made != edits.history_of(key).edits:
            edits.put(key, History(made))
        _ids()[key, made] = named
    _plain().discard(key)


def problem() -> str:
    """Why the rules in force that a link names cannot be had; "" where they can."""
    return rule_base.problem() or cast("str", st.session_state.get("_edits_problem", ""))


def go_on_without() -> None:
    """Leave what cannot be had; for callbacks."""
    if rule_base.problem():
        rule_base.choose()
    set_url_choice("edits", "")
    st.session_state["_edits_named"] = ""


def is_edited() -> bool:
    """Whether the rules in force have edits; nothing is mined to say that they have none."""
    if not edits.any_made() or data_problem():
        return False
    try:
        key = rule_base.base_key(rule_base.base_name())
    except SarlError:
        return False
    return bool(edits.history_of(key).edits) and key not in _plain()


def kind() -> str:
    """What is in force, as it is called on screen."""
    return EDITED if is_edited() else rule_base.base_kind()


def rules() -> RuleSet:
    """The rules in force.

    Raises:
        InputError: If they cannot be had.
    """
    base = rule_base.base()
    return edits.edited(base) if is_edited() else base.rule_set


def in_address() -> bool:
    """Whether the address names edits that are kept."""
    return st.session_state.get("_edits_named", "") not in ("", UNKEPT)


def count() -> int:
    """How many edits the rules in force have."""
    return edits_made(rule_base.base_name()) if is_edited() else 0


def address_of(choice: str) -> dict[str, str] | None:
    """What an address says to put rules in force that were chosen on a page.

    Args:
        choice: What they are called there.

    Returns:
        None where no address says it.
    """
    here = rule_base.base_name()
    if choice in (kind(), IN_FORCE):
        return {"set": here, "edits": cast("str", st.session_state.get("_edits_named", ""))}
    if choice == UNEDITED:
        return {"set": here, "edits": ""}
    if choice == CHOSEN or choice in COMPACT_ENDINGS:
        return {"set": THRESHOLDS if choice == CHOSEN else choice, "edits": ""}
    return None


def title() -> str:
    """What the rules in force are called, as "At the thresholds, with 2 edits"."""
    return options()[chosen()]


# --- what changes it ---------------------------------------------------------------------------


def edit(of: Base, one: Edit) -> None:
    """Make one more edit, and put it in force; for callbacks. An error is said on the page."""
    try:
        check_edit(edits.edited(of), one)
        edits.grown(of, (*edits.history(of).edits, one))
    except InputError as error:
        st.session_state["_edit_error"] = str(error)
    else:
        _change(of, edits.history(of).done(one))


def undo(of: Base) -> None:
    """Take the latest edit back; for callbacks."""
    _change(of, edits.history(of).undo())


def redo(of: Base) -> None:
    """Make the edit again that was taken back last; for callbacks."""
    _change(of, edits.history(of).redo())


def _change(of: Base, history: History) -> None:
    edits.put(of.key, history)
    _plain().discard(of.key)
    name_edits()
    st.session_state["_edits_changed"] = True


def has_changed() -> bool:
    """Whether an edit was made that the sidebar does not know of yet."""
    return "_edits_changed" in st.session_state


# --- the choice in the sidebar -----------------------------------------------------------------


def options() -> dict[str, str]:
    """What may be in force, and what it is called: rules, and the same with the edits made here."""
    named: dict[str, str] = {}
    for name, label in rule_base.labels().items():
        count = edits_made(name)
        if count:
            named[_edited_option(name)] = f"{label}, with {counted(count, 'edit')}"
            label = f"{label}, unedited"
        named[name] = label
    return named


def chosen() -> str:
    """Which of the options is in force."""
    name = rule_base.base_name()
    return _edited_option(name) if is_edited() else name


def choose(option: str) -> None:
    """Put one of the options in force; for callbacks."""
    name = option.removesuffix(_WITH_EDITS)
    rule_base.choose(name)
    key = rule_base.base_key(name)
    if option != name:
        _plain().discard(key)
    elif edits.history_of(key).edits:
        _plain().add(key)
    name_edits()


_WITH_EDITS = " with edits"


def _edited_option(name: str) -> str:
    return f"{name}{_WITH_EDITS}"


def edits_made(name: str) -> int:
    """How many edits there are of some rules, in force or set aside."""
    if not edits.any_made():
        return 0
    try:
        return len(edits.history_of(rule_base.base_key(name)).edits)
    except SarlError:
        return 0


def _plain() -> set[str]:
    """Keys of the rules whose edits are set aside in this visit."""
    return cast("set[str]", st.session_state.setdefault("_without_edits", set()))


def _ids() -> dict[tuple[str, tuple[Edit, ...]], str]:
    """Under which id edits are kept, as far as this visit knows."""
    return cast(
        "dict[tuple[str, tuple[Edit, ...]], str]",
        st.session_state.setdefault("_edits_ids", {}),
    )


def _id_of(key: str) -> str:
    """The id under which the edits of some rules are kept."""
    made = edits.history_of(key).edits
    if (key, made) not in _ids():
        words = f"{rule_base.labels()[rule_base.base_name()]}, {dataset_label(chosen_dataset())}"
        try:
            _ids()[key, made] = library.keep_edits(made, key, words).id
        except SarlError as error:
            library.say_once(error)
            _ids()[key, made] = UNKEPT
    return _ids()[key, made]
