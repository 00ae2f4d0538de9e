"""The rules that a page works on: those in force, or others that were chosen there."""

from __future__ import annotations

from sarl_core.errors import InputError
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.state import edits, in_force, rule_base
from sarl_dashboard.state.mined import rules_at
from sarl_dashboard.state.rule_files import (
    CHOSEN,
    COMPACT_ENDINGS,
    EDITED,
    IN_FORCE,
    IN_LIBRARY,
    NO_RULES,
    OWN_FILE,
    PAPERS,
    UNEDITED,
    compact_rules,
)

BETWEEN = "|"
"""Between the names of rule sets that an address compares."""


def comparison_address(*names: str) -> dict[str, str]:
    """What an address of the page Compare says to compare some rule sets."""
    return {"sets": BETWEEN.join(names)}


def rules_for(choice: str) -> RuleSet | None:
    """The rule set that was chosen, None for none.

    Raises:
        InputError: If it cannot be had.
    """
    if choice == NO_RULES:
        return None
    if choice == IN_FORCE:
        return in_force.rules()
    if choice in (IN_LIBRARY, UNEDITED, OWN_FILE):
        return rule_base.base().rule_set
    if rule_base.is_in_library(choice):
        return rule_base.library_rules(choice)
    if choice in COMPACT_ENDINGS:
        return compact_rules(choice)
    if choice == EDITED:
        return edited_rules()
    if choice != CHOSEN and choice not in PAPERS:
        raise InputError(f"there are no rules called {choice!r}; choose others")
    return rules_at(PAPERS.get(choice))


def rules_called(choice: str) -> str:
    """What chosen rules are called beside others: of kept ones, and of a file, their name."""
    return rule_base.base().name if choice in (IN_LIBRARY, OWN_FILE) else choice


def edited_rules() -> RuleSet:
    """The chosen rules with the edits of this visit, also where these are set aside.

    Raises:
        InputError: If there are none.
    """
    of = rule_base.base()
    if not edits.history(of).edits:
        raise InputError("there are no edits of the rules in force; make some on the Edit page")
    return edits.edited(of)
