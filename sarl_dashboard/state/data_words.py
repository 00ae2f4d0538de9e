"""The names and formulas given to data that are not one's own to change, kept and in the address.

Those of one's own kept demonstrations stand with these. Shipped demonstrations, and what others
have shared, stay as they are: an id under which the names are kept stands in the address (URL:
wording), so that a reload, and whoever has the link, sees them too.
"""

from __future__ import annotations

import json
from typing import Any, cast

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError, SarlError, quoted
from sarl_core.library.annotations import formulas_details, is_annotated, names_details
from sarl_dashboard.state import formulas, given_names, library
from sarl_dashboard.state.data import UPLOAD, chosen_dataset, data_problem, raw_demonstrations
from sarl_dashboard.state.url import set_url_choice, url_name

UNKEPT = "unkept"


def take_up() -> None:
    """Give the names that the address names, or say in it which ones are given.

    Once a run, before anything is drawn.
    """
    st.session_state.pop("_names_problem", None)
    named = url_name("wording")
    if data_problem():
        return
    raw = raw_demonstrations()
    if raw is None:
        return
    if named != st.session_state.get("_wording_named", ""):
        try:
            if named:
                _give(raw, named)
            elif _is_in_address(raw):  # the browser went back to where there were none
                _leave(raw)
        except SarlError as error:
            st.session_state["_names_problem"] = str(error)
            return
    say_given(raw)


def say_given(raw: Demonstrations) -> None:
    """Say in the address which names are given; after what changes them while a page runs."""
    named = _name_of(raw)
    set_url_choice("wording", named)
    st.session_state["_wording_named"] = named


def problem() -> str:
    """Why the names that a link names cannot be given; "" where they can."""
    return cast("str", st.session_state.get("_names_problem", ""))


def go_on_without() -> None:
    """Leave names that cannot be had; for callbacks."""
    set_url_choice("wording", "")
    st.session_state["_wording_named"] = ""


def _leave(raw: Demonstrations) -> None:
    """Have the data as they came; what could not be kept can still be gone forward to."""
    if st.session_state.get("_wording_named") == UNKEPT:
        _unkept()[raw.digest] = _given(raw)
    formulas.leave(raw)
    given_names.leave(raw)


def _unkept() -> dict[str, dict[str, Any]]:
    """What was given in this visit, could not be kept, and was left, by the data."""
    return cast("dict[str, dict[str, Any]]", st.session_state.setdefault("_wording_unkept", {}))


def _give(raw: Demonstrations, named: str) -> None:
    if named == UNKEPT:
        if left := _unkept().pop(raw.digest, None):
            formulas.restore(raw, left)
            given_names.restore(raw, left)
        if _given(raw):
            return
        raise InputError(
            "the names of this address could not be kept and are gone with the visit in which they "
            "were given; give them again on the page Names, or go on without them"
        )
    if not library.is_id(named):
        raise InputError(f"there are no names called {quoted(named)}; check the address")
    item = library.linked_item(named, "names", "names of data")
    if item.details.get("of") != raw.digest:
        raise InputError(
            "the names of this address belong to other data than it names; ask whoever sent it "
            "for a new link, or go on without them"
        )
    _leave(raw)
    try:
        formulas.restore(raw, item.details)
        given_names.restore(raw, item.details)
    except (KeyError, TypeError) as error:  # written by another version
        raise InputError("the names of this address cannot be read; give them again") from error


def _given(raw: Demonstrations) -> dict[str, Any]:
    """What was given to data in this visit, as JSON has it."""
    given = names_details(given_names.given_names(raw)) | formulas_details(formulas.changed(raw))
    return given if is_annotated(given) else {}


def _is_in_address(raw: Demonstrations) -> bool:
    """Whether names of data stand in the address, and not with the data."""
    return chosen_dataset() != UPLOAD and not library.is_own(raw)


def _name_of(raw: Demonstrations) -> str:
    """The id under which they are kept; "" where there are none, or they stand with the data."""
    given = _given(raw)
    if not given or not _is_in_address(raw):
        return ""
    ids = cast("dict[str, str]", st.session_state.setdefault("_names_ids", {}))
    text = json.dumps({"of": raw.digest, **given}, sort_keys=True)
    if text not in ids:
        try:
            ids[text] = library.keep_names(json.loads(text)).id
        except SarlError as error:
            library.say_once(error)
            ids[text] = UNKEPT
    return ids[text]
