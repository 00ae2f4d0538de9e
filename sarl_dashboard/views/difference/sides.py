"""The two rule sets of the page Compare: the choices, and what was chosen."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.components.settings import offered_rule_sets, rule_sets_help
from sarl_dashboard.state import edits
from sarl_dashboard.state.rule_choice import EDITED, rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT_ENDINGS, OWN_FILE, PAPERS, UNEDITED
from sarl_dashboard.text import in_full

SIDES = (("first", "First set", CHOSEN), ("second", "Second set", "unfiltered"))


@dataclass(frozen=True, eq=False)
class Side:
    """One of the two.

    Attributes:
        rule_set: Its rules.
        name: On screen.
    """

    rule_set: RuleSet
    name: str


def chosen_sides() -> list[Side]:
    """The widgets for both, beside each other.

    Returns:
        Both sets; fewer where one cannot be had, which is said on the page.
    """
    sides, problems = [], []
    for column, (key, label, default) in zip(st.columns(2), SIDES, strict=True):
        with column:
            try:
                sides.append(_side(key, label, default))
            except SarlError as error:
                problems.append(in_full(str(error)))
    for problem in problems:
        st.info(problem, icon=":material/upload_file:")
    return sides


def _offered() -> list[str]:
    """The rule sets that can be had."""
    offered = offered_rule_sets([CHOSEN, *PAPERS, *COMPACT_ENDINGS, EDITED, OWN_FILE])
    if EDITED in offered:
        offered.insert(offered.index(EDITED), UNEDITED)
    return offered


def _side(key: str, label: str, default: str) -> Side:
    offered = _offered()
    choice = st.selectbox(
        label,
        offered,
        offered.index(default),
        key=key,
        bind="query-params",
        help=rule_sets_help(offered),
    )
    file = None
    if choice == OWN_FILE:
        file = st.file_uploader("Rule file (.json)", key=f"{key}_file")
    if choice == UNEDITED:
        return Side(edits.base().rule_set, choice)
    rule_set = rules_for(choice, file)
    assert rule_set is not None
    return Side(rule_set, file.name if file is not None else choice)
