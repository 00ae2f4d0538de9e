"""The rules and the logs of the page Audit: the choices, and what they say of each other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import streamlit as st
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.auditing.audit import Audit, audit
from sarl_core.auditing.comparison import LogComparison
from sarl_core.auditing.matching import UnmatchedNames, unmatched_names
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import ColumnRole
from sarl_core.errors import InputError, SarlError
from sarl_core.library.logs import log_content, log_file_name, log_roles, read_log
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.cache import cached
from sarl_dashboard.components.column_form import ColumnForm
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.settings import rule_set_choice
from sarl_dashboard.session import end_page
from sarl_dashboard.state import library
from sarl_dashboard.state.data import chosen_demonstrations
from sarl_dashboard.state.rule_choice import rules_for
from sarl_dashboard.state.url import set_url_choice, url_name
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
        identifiers: Of the logs, as far as they are kept.
    """

    first: Audit
    comparison: LogComparison | None
    name: str
    rule_set: RuleSet
    identifiers: tuple[str, ...] = ()


def chosen_rules() -> ChosenRules:
    """The widgets for the rules; where there are none, the page says so and stops."""
    choice = rule_set_choice("audited", width=320)
    try:
        rule_set = rules_for(choice)
    except SarlError as error:
        st.info(in_full(str(error)), icon=":material/upload_file:")
        end_page()
    assert rule_set is not None
    if not rule_set.rules:
        st.info(
            "No rule is in force, so nothing can be broken. Lower a threshold on the Thresholds "
            "page, or choose other rules.",
            icon=":material/filter_alt_off:",
        )
        end_page()
    return ChosenRules(choice, rule_set)


def chosen_logs(rules: ChosenRules) -> Logs:
    """The uploaders, and what came of the logs; stops the page while there is none.

    What is uploaded is kept at once, and the address names it (URL: log, other_log).

    Args:
        rules: That are held against them.
    """
    left, right = st.columns(2)
    with left:
        log = _chosen(
            "log",
            "Log",
            "What somebody did, step by step, in any format that demonstrations are read in. "
            "Features, actions and labels are matched by their names.",
        )
    with right:
        after = _chosen("other_log", "Another log, as after a change (optional)", "To compare with")
    for problem, key in ((log, "log"), (after, "other_log")):
        if isinstance(problem, str):
            refuse(problem)
            st.button(
                "Go on without it",
                key=f"go_on_without_{key}",
                icon=":material/arrow_forward:",
                on_click=_leave,
                args=(key,),
            )
    if isinstance(log, str) or isinstance(after, str):
        end_page()
    if log is None:
        st.info(
            "Upload a log to hold these rules against it.",
            icon=":material/upload_file:",
        )
        end_page()
    held = _answer(rules, log, log.roles)
    other = None
    if after is not None:
        # What was said of the columns of one log is true of another with the same columns.
        if not after.roles and after.columns == log.columns:
            after = after.with_roles(log.roles)
        other = _answer(rules, after, after.roles)
    if held is None or (after is not None and other is None):
        end_page()
    comparison = None if other is None else LogComparison(held, other)
    identifiers = tuple(
        one.identifier for one in (log, after) if one is not None and one.identifier
    )
    return Logs(held, comparison, log.file.name, rules.rule_set, identifiers)


_Roles = tuple[tuple[str, ColumnRole], ...]


class _LibraryFile(NamedTuple):
    """The file of a log that is kept, as an upload has it."""

    file_id: str
    name: str
    content: bytes

    def getvalue(self) -> bytes:
        return self.content


@dataclass(frozen=True, eq=False)
class _Log:
    """A log, and what was said of its columns.

    Attributes:
        key: Of its uploader.
        file: What was uploaded, or is kept.
        roles: What was said of its columns, () where nothing was.
        identifier: Under which it is kept; "" where it is not.
    """

    key: str
    file: UploadedFile | _LibraryFile
    roles: _Roles
    identifier: str

    @property
    def form(self) -> ColumnForm:
        return ColumnForm.of_files(f"{self.key}_map", [self.file], dict(self.roles))

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.form.previews)

    def with_roles(self, roles: _Roles) -> _Log:
        """The same with what was said of another one's columns; kept so, if it was not yet.

        Args:
            roles: What was said.
        """
        if not roles or self.identifier:
            return replace(self, roles=roles)
        state = st.session_state
        state[f"_{self.key}_roles"] = roles
        _keep(self.key, self.file, roles)
        return replace(self, roles=roles, identifier=state.get(f"_{self.key}_id", ""))

    def read(self) -> None:
        """Take the columns as they stand in the form; for a callback."""
        state = st.session_state
        try:
            roles = tuple(self.form.roles().items())
            state[f"_{self.key}_roles"] = roles
            state[f"_{self.key}_problem"] = None
            _keep(self.key, self.file, roles)
        except InputError as error:
            state[f"_{self.key}_problem"] = str(error)
        state[f"_{self.key}_mapped"] = True


def _chosen(key: str, label: str, hint: str) -> _Log | str | None:
    """The uploader of a log; the log, why what the address names is none, or nothing."""
    named = url_name(key)
    uploaded = st.file_uploader(
        label, key=f"{key}_file", on_change=_take, args=(key,), help=with_words(hint)
    )
    own: str = st.session_state.get(f"_{key}_id", "")
    if uploaded is not None and named == own:
        roles: _Roles = st.session_state.get(f"_{key}_roles", ())
        return _Log(key, uploaded, roles, own)
    if not named:
        return None
    try:
        item = library.stored_log(named)
        opened = library.library()
        file = _LibraryFile(item.id, log_file_name(item), log_content(opened, item))
        roles = tuple(log_roles(item).items())
    except SarlError as error:
        return str(error)
    with st.container(horizontal=True, vertical_alignment="center"):
        st.caption(f"**{escaped(file.name)}**, from the library", width="content")
        st.button("Leave it", key=f"leave_{key}", on_click=_leave, args=(key,), type="tertiary")
    return _Log(key, file, roles, item.id)


def _take(key: str) -> None:
    """Keep a log that was uploaded, so that the address can name it; for a callback."""
    _leave(key)
    file = st.session_state.get(f"{key}_file")
    if file is not None:
        _keep(key, file, ())


def _keep(key: str, file: UploadedFile | _LibraryFile, roles: _Roles) -> None:
    try:
        _read(file.getvalue(), file.name, roles)
    except SarlError:  # the page says why, and asks what its columns are
        return
    try:
        identifier = library.keep_log(file.getvalue(), file.name, dict(roles)).id
    except SarlError as error:
        library.say_once(error)
        return
    st.session_state[f"_{key}_id"] = identifier
    set_url_choice(key, identifier)


def _leave(key: str) -> None:
    """Have no log, and say nothing of the columns of the next one yet; for a callback."""
    for part in ("id", "roles", "problem", "mapped", "seen"):
        st.session_state.pop(f"_{key}_{part}", None)
    set_url_choice(key, "")


def _answer(rules: ChosenRules, log: _Log, roles: _Roles) -> Audit | None:
    """What the rules say of a log, None where it cannot be used; the page then says why."""
    held, state, form = None, st.session_state, log.form
    problem: str | None = state.get(f"_{log.key}_problem")
    if problem is None:
        try:
            held = _audited(rules, log.file, roles)
        except SarlError as error:
            problem = str(error)
    unmatched = None if problem is None else _unmatched(rules, log)
    if state.get(f"_{log.key}_seen") != log.file.file_id:  # closed by the visitor, it stays closed
        state[f"_{log.key}_seen"] = log.file.file_id
        state[f"{form.key}_columns"] = False
        if problem is not None and unmatched is None:
            form.open_for(problem)
    in_form = form.is_open and bool(state.get(f"_{log.key}_mapped"))
    say = None if problem is None else partial(refuse, problem)
    if say is not None and not in_form:
        say()
    label = f"Map the columns of {escaped(log.file.name)} myself"
    form.draw(log.read, say if in_form else None, label, unmatched)
    return held


def _unmatched(rules: ChosenRules, log: _Log) -> UnmatchedNames | None:
    """Names of the rules that a log lacks; None where it lacks none, or cannot be read."""
    try:
        read = _read(log.file.getvalue(), log.file.name, log.roles)
    except SarlError:
        return None
    unmatched = unmatched_names(rules.rule_set, read)
    return unmatched if any(unmatched[:2]) else None


def _audited(rules: ChosenRules, file: UploadedFile | _LibraryFile, roles: _Roles) -> Audit:
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
    return audit(rule_set, _read(content, name, roles), demonstrations=demonstrations)


@cached(show_spinner="Reading the log …")
def _read(content: bytes, name: str, roles: _Roles) -> Demonstrations:
    return read_log(content, name, dict(roles))
