"""Names and formulas that people give to demonstrations that are kept, which stay as they are.

They stand among the details of the item; whoever works on the demonstrations has them with these.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sarl_core.demonstrations.dataset import Demonstrations, formula_feature
from sarl_core.demonstrations.derived import DerivedFeature, formula_texts
from sarl_core.demonstrations.names import Names, renamed
from sarl_core.environments.formulas import Formula

NAMES, FORMULAS = "names", "formulas"
"""Where they stand among the details."""


def is_annotated(details: Mapping[str, Any]) -> bool:
    """Whether names or formulas were given, or all formulas taken away."""
    return details.get(NAMES) is not None or details.get(FORMULAS) is not None


def names_details(names: Names | None) -> dict[str, Any]:
    """Names as details say them; None takes them back."""
    return {NAMES: None if names is None else names._asdict()}


def formulas_details(derived: Sequence[DerivedFeature] | None) -> dict[str, Any]:
    """Formulas as details say them; None takes them back."""
    return {FORMULAS: None if derived is None else list(formula_texts(derived))}


def names_in(details: Mapping[str, Any]) -> Names | None:
    """The names that details say; None where they say none.

    Raises:
        KeyError, TypeError: If they were written by another version.
    """
    said = details.get(NAMES)
    if said is None:
        return None
    return Names(
        features=tuple(said["features"]),
        units=tuple(said["units"]),
        actions=tuple(said["actions"]),
        labels=tuple(tuple(one) for one in said["labels"]),
    )


def derived_in(
    details: Mapping[str, Any], demonstrations: Demonstrations
) -> tuple[DerivedFeature, ...] | None:
    """What is derived, by the formulas that details say; None where they say none.

    Args:
        details: Of the item.
        demonstrations: As they are kept; combinations that they derive stay.

    Raises:
        InputError: If one is no formula over these demonstrations.
        TypeError: If they were written by another version.
    """
    texts = details.get(FORMULAS)
    if texts is None:
        return None
    combined = [one for one in demonstrations.derived if not isinstance(one.definition, Formula)]
    return (*combined, *(formula_feature(text, demonstrations.observed) for text in texts))


def annotated(demonstrations: Demonstrations, details: Mapping[str, Any]) -> Demonstrations:
    """Demonstrations with the formulas and under the names that were given to them.

    Args:
        demonstrations: As they are kept.
        details: Of their item.

    Returns:
        The same object where nothing was given.

    Raises:
        InputError: If it does not fit them.
        KeyError, TypeError: If it was written by another version.
    """
    derived, names = derived_in(details, demonstrations), names_in(details)
    if derived is not None:
        demonstrations = demonstrations.deriving(derived)
    return demonstrations if names is None else renamed(demonstrations, names)
