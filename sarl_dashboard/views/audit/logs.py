"""The rules and the logs of the page Audit: the choices, and what they say of each other."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.auditing.audit import Audit, audit
from sarl_core.auditing.comparison import LogComparison
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.errors import InputError, SarlError
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.cache import cached
from sarl_dashboard.components.settings import offered_rule_sets
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.rule_choice import EDITED, rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, OWN_FILE, PAPERS
from sarl_dashboard.text import in_full, refuse


@dataclass(frozen=True, eq=False)
class ChosenRules:
    """Rules, and where they were chosen from.

    Attributes:
        choice: As it stands on screen.
        rule_set: The rules.
    """

    choice: str
    rule_set: RuleSet


@dataclass(frozen=True, eq=False)
class Logs:
    """What the rules say of a log, or of two.

    Attributes:
        first: Of the log.
        comparison: With another one, or None.
        name: Of the first file.
    """

    first: Audit
    comparison: LogComparison | None
    name: str


def chosen_rules() -> ChosenRules:
    """The widgets for the rules; where there are none, the page says so and stops."""
    offered = offered_rule_sets([CHOSEN, *PAPERS, COMPACT, EDITED, OWN_FILE])
    choice = st.selectbox("Rules", offered, key="audited", bind="query-params", width=320)
    file = None
    if choice == OWN_FILE:
        file = st.file_uploader("Rule file (.json)", key="audited_file")
    try:
        rule_set = rules_for(choice, file)
    except SarlError as error:
        st.info(in_full(str(error)), icon=":material/upload_file:")
        st.stop()
    assert rule_set is not None
    if not rule_set.rules:
        st.info(
            "No rule is in force, so nothing can be broken. Lower a threshold on the Thresholds "
            "page, or choose other rules.",
            icon=":material/filter_alt_off:",
        )
        st.stop()
    return ChosenRules(choice, rule_set)


def chosen_logs(rules: ChosenRules) -> Logs:
    """The uploaders, and what came of the logs; stops the page while there is none.

    Args:
        rules: That are held against them.
    """
    left, right = st.columns(2)
    first = left.file_uploader(
        "Log",
        key="log",
        help="What somebody did, step by step, in any format that demonstrations are read in. "
        "Features, actions and labels are matched by their names.",
    )
    second = right.file_uploader(
        "Another log, as after a change (optional)", key="other_log", help="To compare with"
    )
    if first is None:
        st.info(
            "Upload a log to hold these rules against it.",
            icon=":material/upload_file:",
        )
        st.stop()
    try:
        held = _audited(rules, first)
        other = None if second is None else _audited(rules, second)
    except SarlError as error:
        refuse(error)
        st.stop()
    return Logs(held, None if other is None else LogComparison(held, other), first.name)


def _audited(rules: ChosenRules, file: UploadedFile) -> Audit:
    demonstrations = chosen_demonstrations()
    mined_from_them = (
        demonstrations is not None and demonstrations.digest == rules.rule_set.source.digest
    )
    try:
        return _held(
            rules.rule_set,
            file.getvalue(),
            file.name,
            demonstrations if mined_from_them else None,
        )
    except InputError as error:
        name = "" if file.name in str(error) else f"{file.name}: "
        raise InputError(f"{name}{error}") from error


@cached(show_spinner="Holding the rules against the log …")
def _held(
    rule_set: RuleSet, content: bytes, name: str, demonstrations: Demonstrations | None
) -> Audit:
    # States that are none are said, and nothing is held against them.
    log = read_demonstrations(content, name, missing="drop")
    return audit(rule_set, log, demonstrations=demonstrations)
