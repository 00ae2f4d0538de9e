"""The rules and the logs of the page Audit: the choices, and what they say of each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import streamlit as st
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.auditing.audit import Audit, audit
from sarl_core.auditing.comparison import LogComparison
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import ColumnRole, read_demonstrations
from sarl_core.errors import InputError, SarlError
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.cache import cached
from sarl_dashboard.components.column_form import ColumnForm
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import rule_set_choice
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.rule_choice import rules_for
from sarl_dashboard.text import escaped, in_full, refuse


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
        rule_set: As it was chosen; an audit orders it as the log is.
    """

    first: Audit
    comparison: LogComparison | None
    name: str
    rule_set: RuleSet


def chosen_rules() -> ChosenRules:
    """The widgets for the rules; where there are none, the page says so and stops."""
    choice = rule_set_choice("audited", width=320)
    try:
        rule_set = rules_for(choice)
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
        on_change=_forget,
        args=("log",),
        help=with_words(
            "What somebody did, step by step, in any format that demonstrations are read in. "
            "Features, actions and labels are matched by their names."
        ),
    )
    second = right.file_uploader(
        "Another log, as after a change (optional)",
        key="other_log",
        on_change=_forget,
        args=("other_log",),
        help=with_words("To compare with"),
    )
    if first is None:
        st.info(
            "Upload a log to hold these rules against it.",
            icon=":material/upload_file:",
        )
        st.stop()
    log = _Log("log", first)
    held = _answer(rules, log, log.stated)
    other = None
    if second is not None:
        after = _Log("other_log", second)
        # What was said of the columns of one log is true of another with the same columns.
        said = log.stated if after.columns == log.columns else ()
        other = _answer(rules, after, after.stated or said)
    if held is None or (second is not None and other is None):
        st.stop()
    comparison = None if other is None else LogComparison(held, other)
    return Logs(held, comparison, first.name, rules.rule_set)


_Roles = tuple[tuple[str, ColumnRole], ...]


@dataclass(frozen=True, eq=False)
class _Log:
    """A log that was uploaded, and what was said of its columns.

    Attributes:
        key: Of its uploader.
        file: The upload.
    """

    key: str
    file: UploadedFile

    @property
    def form(self) -> ColumnForm:
        return ColumnForm.of_files(f"{self.key}_map", [self.file])

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.form.previews)

    @property
    def stated(self) -> _Roles:
        """What was said of its columns, () where nothing was."""
        roles: _Roles = st.session_state.get(f"_{self.key}_roles", ())
        return roles

    def read(self) -> None:
        """Take the columns as they stand in the form; for a callback."""
        state = st.session_state
        try:
            state[f"_{self.key}_roles"] = tuple(self.form.roles().items())
            state[f"_{self.key}_problem"] = None
        except InputError as error:
            state[f"_{self.key}_problem"] = str(error)
        state[f"_{self.key}_mapped"] = True


def _forget(key: str) -> None:
    """Say nothing of the columns of a new log yet; for a callback."""
    for part in ("roles", "problem", "mapped", "seen"):
        st.session_state.pop(f"_{key}_{part}", None)


def _answer(rules: ChosenRules, log: _Log, roles: _Roles) -> Audit | None:
    """What the rules say of a log, None where it cannot be used; the page then says why."""
    held, state, form = None, st.session_state, log.form
    problem: str | None = state.get(f"_{log.key}_problem")
    if problem is None:
        try:
            held = _audited(rules, log.file, roles)
        except SarlError as error:
            problem = str(error)
    if not state.get(f"_{log.key}_seen"):  # closed by the visitor, it stays closed
        state[f"_{log.key}_seen"] = True
        state[f"{form.key}_columns"] = False
        if problem is not None:
            form.open_for(problem)
    in_form = form.is_open and bool(state.get(f"_{log.key}_mapped"))
    say = None if problem is None else partial(refuse, problem)
    if say is not None and not in_form:
        say()
    label = f"Map the columns of {escaped(log.file.name)} myself"
    form.draw(log.read, say if in_form else None, label)
    return held


def _audited(rules: ChosenRules, file: UploadedFile, roles: _Roles) -> Audit:
    demonstrations = chosen_demonstrations()
    mined_from_them = (
        demonstrations is not None and demonstrations.digest == rules.rule_set.source.digest
    )
    try:
        return _held(
            rules.rule_set,
            file.getvalue(),
            file.name,
            roles,
            demonstrations if mined_from_them else None,
        )
    except InputError as error:
        name = "" if file.name in str(error) else f"{file.name}: "
        raise InputError(f"{name}{error}") from error


@cached(show_spinner="Holding the rules against the log …")
def _held(
    rule_set: RuleSet,
    content: bytes,
    name: str,
    roles: _Roles,
    demonstrations: Demonstrations | None,
) -> Audit:
    # States that are none are said, and nothing is held against them.
    log = read_demonstrations(content, name, columns=dict(roles) or None, missing="drop")
    return audit(rule_set, log, demonstrations=demonstrations)
