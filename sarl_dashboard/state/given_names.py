"""The names that a visitor gave to features, units, actions and labels; kept in the session.

They belong to the data as they were read, whatever episodes are left out or held out of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import Names, names_of, renamed, tidy
from sarl_core.errors import InputError
from sarl_core.library.annotations import names_details, names_in
from sarl_dashboard.cache import cached
from sarl_dashboard.state import formulas, library


def _given() -> dict[str, Names]:
    return cast("dict[str, Names]", st.session_state.setdefault("_names", {}))


def _drafts() -> dict[str, Names]:
    return cast("dict[str, Names]", st.session_state.setdefault("_name_drafts", {}))


def named(raw: Demonstrations) -> Demonstrations:
    """Demonstrations with what a visitor derives, under the names that were given to them.

    Args:
        raw: As they were read.

    Returns:
        The same object where nothing was derived or renamed.
    """
    names, ready = _given().get(raw.digest), formulas.deriving(raw)
    return ready if names is None else _renamed(ready, names)


def given_names(raw: Demonstrations | None) -> Names | None:
    """The names in force; None where nothing was renamed."""
    return None if raw is None else _given().get(raw.digest)


def draft(raw: Demonstrations) -> Names:
    """What stands in the tables, which may not be in force yet."""
    return _drafts().get(raw.digest) or _given().get(raw.digest) or names_of(raw)


def problem(raw: Demonstrations) -> str:
    """Why what stands in the tables is not in force; "" where it is."""
    try:
        _renamed(formulas.deriving(raw), tidy(draft(raw)))
    except InputError as error:
        return str(error)
    return ""


def give(raw: Demonstrations, names: Names) -> None:
    """Keep what was typed, and put it in force if it can be; for callbacks."""
    _drafts()[raw.digest] = names
    if not problem(raw):
        put = tidy(names)
        own = put == names_of(raw)
        if own:
            _given().pop(raw.digest, None)
        else:
            _given()[raw.digest] = put
        library.annotate(raw, names_details(None if own else put))


def leave(raw: Demonstrations) -> None:
    """Go back to the names that the data came with in this visit; what is kept stays."""
    _drafts().pop(raw.digest, None)
    _given().pop(raw.digest, None)
    # The tables on the page Names become others, which know nothing of what was typed.
    st.session_state["_names_reset"] = st.session_state.get("_names_reset", 0) + 1


def reset(raw: Demonstrations) -> None:
    """Go back to the names that the data came with; for callbacks."""
    leave(raw)
    library.annotate(raw, names_details(None))


def restore(raw: Demonstrations, details: Mapping[str, Any]) -> None:
    """Give the names that were given in another visit, if there are some and they fit."""
    put = names_in(details)
    if put is not None:
        _renamed(formulas.deriving(raw), put)
        _given()[raw.digest] = put


@cached()
def _renamed(ready: Demonstrations, names: Names) -> Demonstrations:
    return renamed(ready, names)
