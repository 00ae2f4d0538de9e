"""The formulas that a visitor wrote on the features of the data; kept in the session.

They belong to the data as they were read and are over the names there: another name for a feature
changes no formula.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import DerivedFeature, formula_texts
from sarl_core.environments.formulas import Formula
from sarl_core.library.annotations import derived_in, formulas_details
from sarl_dashboard.cache import cached
from sarl_dashboard.state import library

Derived = tuple[DerivedFeature, ...]


def _written() -> dict[str, Derived]:
    return cast("dict[str, Derived]", st.session_state.setdefault("_formulas", {}))


def derived_of(raw: Demonstrations) -> Derived:
    """What is derived of the features: what the file derives, until a visitor changes it.

    Of a sample it is what the trees know, and nobody changes that.
    """
    if raw.sample_of is not None:
        return raw.derived
    return _written().get(raw.digest, raw.derived)


def texts_beside(raw: Demonstrations) -> tuple[str, ...]:
    """What a visitor wrote beside what the file derives, as the command line takes it."""
    return formula_texts([one for one in derived_of(raw) if one not in raw.derived])


def put(raw: Demonstrations, derived: Derived) -> None:
    """Let this be derived in place of what is; for callbacks."""
    if derived == raw.derived:
        _written().pop(raw.digest, None)
    else:
        _written()[raw.digest] = derived
    library.annotate(raw, formulas_details(changed(raw)))


def leave(raw: Demonstrations) -> None:
    """Let that be derived which the file derives, in this visit; what is kept stays."""
    _written().pop(raw.digest, None)


def changed(raw: Demonstrations) -> Derived | None:
    """All that is derived; None where a visitor has changed nothing of it."""
    return _written().get(raw.digest)


def restore(raw: Demonstrations, details: Mapping[str, Any]) -> None:
    """Let that be derived which was written in another visit, if something was."""
    derived = derived_in(details, raw)
    if derived is not None:
        _written()[raw.digest] = derived


def without(derived: Derived, place: int) -> Derived:
    """All but one."""
    return (*derived[:place], *derived[place + 1 :])


def placed(derived: Derived, one: DerivedFeature, place: int | None) -> Derived:
    """With one more, or in the place of another."""
    if place is None:
        return (*derived, one)
    return (*derived[:place], one, *derived[place + 1 :])


def deriving(raw: Demonstrations) -> Demonstrations:
    """Demonstrations with the formulas.

    Args:
        raw: As they were read.

    Returns:
        The same object where nothing was changed.
    """
    derived = derived_of(raw)
    return raw if derived == raw.derived else _deriving(raw, derived)


def values_key(raw: Demonstrations) -> tuple[str, ...] | None:
    """What tells the values that are derived from others, whatever formulas are called.

    None where what is derived was not changed.
    """
    derived = derived_of(raw)
    if derived == raw.derived:
        return None
    return tuple(
        one.definition.text if isinstance(one.definition, Formula) else repr(one.definition.terms)
        for one in derived
    )


@cached()
def _deriving(raw: Demonstrations, derived: Derived) -> Demonstrations:
    return raw.deriving(derived)
