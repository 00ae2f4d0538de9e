"""The form that asks which column of a table is what, for every page that reads a table."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import streamlit as st

from sarl_core.auditing.matching import UnmatchedNames
from sarl_core.demonstrations.formats import ColumnPreview, ColumnRole, preview_columns
from sarl_core.demonstrations.formats.columns import feature_names
from sarl_core.demonstrations.formats.mapping.joined import labels_together, never_together
from sarl_core.demonstrations.formats.mapping.roles import (
    TOGETHER,
    RoleName,
    Roles,
    roles_document,
)
from sarl_core.demonstrations.formats.registry import Content
from sarl_core.environments.feature_order import plain_names
from sarl_core.errors import InputError, quoted
from sarl_core.explaining.html.column_previews import NAMELESS, column_previews_html
from sarl_dashboard.text import escaped, labelled

_SINGLE: dict[RoleName, str] = {
    "episode": "Episode: which run a row is of",
    "step": "Step: which row of the run",
    "reward": "Reward",
    "time": "Time: when a step was",
}
_ENDS: dict[RoleName, str] = {
    "terminated": "Ended by itself (terminated)",
    "truncated": "Ended by a limit (truncated)",
    "first": "Marks the first step of a run",
    "last": "Marks the last step of a run",
}
SINGLE_COLUMNS = {**_SINGLE, **_ENDS}
_KINDS = {"labels": "one of several choices", "continuous": "an amount"}
_PLURAL: dict[RoleName, str] = {"feature": "observations", "action": "actions"}
_MOST_UNITS = 40  # features whose units are asked for one by one
_MOST_KINDS = 12


class TableFile(Protocol):
    """A file that was uploaded, now or in another visit."""

    @property
    def file_id(self) -> str:
        """What tells it from others."""

    @property
    def name(self) -> str:
        """Of the file."""

    def getvalue(self) -> bytes | memoryview:
        """Its content."""


def previews_of(files: Sequence[TableFile], said: Roles | None = None) -> tuple[ColumnPreview, ...]:
    """What the columns of uploaded files hold and seem to be.

    Args:
        files: One or more, or none.
        said: What was said of their columns before.

    Returns:
        () where there is no table, or none that can be opened: whoever reads it says why.
    """
    if not files:
        return ()
    contents: list[tuple[Content, str]] = [
        (memoryview(file.getvalue()), file.name) for file in files
    ]
    try:
        return preview_columns(contents, columns=said)
    except Exception:
        return ()


@dataclass(frozen=True, eq=False)
class ColumnForm:
    """The form of one uploader.

    What is chosen in it stays as long as the same files do: after an error, and while the form is
    closed.

    Attributes:
        key: What the keys of its widgets begin with.
        previews: Of the uploaded table, () where there is none or it cannot be opened.
    """

    key: str
    previews: Sequence[ColumnPreview]

    @classmethod
    def of_files(
        cls,
        key: str,
        files: Sequence[TableFile],
        said: Roles | None = None,
        previews: Sequence[ColumnPreview] | None = None,
    ) -> ColumnForm:
        """The form for files that were uploaded, filled in with what their columns seem to be.

        Args:
            key: What the keys of its widgets begin with.
            files: One or more, or none.
            said: What was said of their columns before.
            previews: Of these columns, where somebody has looked at them already.

        Returns:
            The form.
        """
        uploaded = tuple(file.file_id for file in files)
        opened: tuple[tuple[str, ...], ColumnForm] | None = st.session_state.get(f"_{key}_form")
        if opened is not None and opened[0] == uploaded:
            return opened[1]
        if previews is None:
            with st.spinner("Looking at the columns …"):
                previews = previews_of(files, said)
        form = cls(key, previews)
        st.session_state[f"_{key}_form"] = uploaded, form
        form._fill_in()
        return form

    @property
    def is_open(self) -> bool:
        """Whether the form stands on the page, if there is one."""
        return bool(self.previews and st.session_state.get(f"{self.key}_columns"))

    def open_for(self, error: str | None) -> None:
        """Open it where another map may help, before it is drawn; else close it.

        Args:
            error: What was wrong with the files, None where they were read.
        """
        actions = [one for one in self.previews if one.role and one.role.role == "action"]
        # An error about a row is not mended by another map; one about columns is.
        helps = error is None or re.search(r"\brow \d", error) is None
        st.session_state[f"{self.key}_columns"] = helps and (
            never_together([one.ones for one in actions]) or "column" in (error or "")
        )

    def draw(
        self,
        read: Callable[[], None],
        problem: Callable[[], None] | None,
        label: str = "Map the columns myself",
        unmatched: UnmatchedNames | None = None,
    ) -> None:
        """Offer the form, and draw it where it is open; without it what rules need to know.

        Args:
            read: Reads the files with what is chosen then.
            problem: Says what was wrong with the choice, beside the button; None for nothing.
            label: Of what opens it.
            unmatched: Names of rules for which a column has to be chosen.
        """
        if not self.previews:
            return
        unmatched = unmatched or UnmatchedNames()
        self._want(unmatched)
        opened = st.toggle(label, key=f"{self.key}_columns")
        names = bool(self._get("names")) if opened else any(unmatched[:2])
        self._recall("drawn", self._fields(), drawn=opened)
        self._recall("names_drawn", self._named(), drawn=names)
        if not opened and not names:
            return
        with st.container(border=True):
            if opened:
                self._draw(read, problem, unmatched.matched)
            else:
                self._ask_names(unmatched.matched)
                self._buttons(read)
        self._remember()

    def roles(self) -> dict[str, ColumnRole]:
        """What was chosen.

        Returns:
            The role of each column.

        Raises:
            InputError: If nothing was chosen as a feature, or as an action, or an action has one
                bound.
        """
        features, actions = self._get("observations"), self._get("actions")
        if not features or not actions:
            raise InputError(
                f"there are no {'actions' if features else 'features'} in the form; choose at "
                "least one column"
            )
        called: dict[RoleName, dict[str, str]] = {"feature": {}, "action": {}}
        for field, (role, name) in self._named().items():
            if self._get(field) is not None:
                called[role][self._get(field)] = name
        roles = {
            name: ColumnRole(
                "feature",
                unit=str(self._get(f"unit {name}") or "").strip(),
                name=called["feature"].get(name, ""),
            )
            for name in dict.fromkeys([*features, *called["feature"]])
        }
        if self._together(actions):
            roles[TOGETHER.join(actions)] = ColumnRole("action")
        else:
            named = called["action"]
            roles |= {name: self._action(name, named.get(name, "")) for name in actions}
        for role in SINGLE_COLUMNS:
            column = self._get(role)
            if column is not None:
                roles[column] = ColumnRole(role)
        used = {*actions, *roles}
        return roles | {
            one.name: ColumnRole("ignore") for one in self.previews if one.name not in used
        }

    def _get(self, field: str) -> Any:
        return st.session_state.get(f"{self.key}_{field}")

    def _set(self, field: str, value: object) -> None:
        st.session_state[f"{self.key}_{field}"] = value

    def _fill_in(self) -> None:
        """Choose what the columns seem to be."""
        by_role: dict[str, list[str]] = {}
        for one in self.previews:
            if one.role is not None:
                by_role.setdefault(one.role.role, []).append(one.name)
        self._set("observations", by_role.get("feature", []))
        self._set("actions", by_role.get("action", []))
        for role in SINGLE_COLUMNS:
            self._set(role, next(iter(by_role.get(role, ())), None))
        self._set("together", False)
        for one in self.previews:
            kind = one.role.kind if one.role is not None else None
            self._set(f"kind {one.name}", kind or one.kind_as_action)
            self._set(f"unit {one.name}", one.role.unit if one.role is not None else "")
            self._set(f"low {one.name}", one.role.low if one.role is not None else None)
            self._set(f"high {one.name}", one.role.high if one.role is not None else None)
        names = {
            (one.role.role, one.role.name): one.name
            for one in self.previews
            if one.role is not None and one.role.name
        }
        self._set("names", tuple(names))
        for field, name in self._named().items():
            self._set(field, names[name])
        self._remember()
        self._set("drawn", False)
        self._set("names_drawn", False)

    def _named(self) -> dict[str, tuple[RoleName, str]]:
        """The fields for the columns of names, with what is called so."""
        return {f"{role} called {name}": (role, name) for role, name in self._get("names")}

    def _want(self, unmatched: UnmatchedNames) -> None:
        """Have a field for each name that lacks a column, beside those that were chosen."""
        chosen = st.session_state[f"_{self.key}_chosen"]
        lacking: list[tuple[RoleName, str]] = [("feature", name) for name in unmatched.features]
        lacking += [("action", name) for name in unmatched.actions]
        before = [
            name
            for field, name in self._named().items()
            if chosen.get(field) is not None or name in lacking
        ]
        self._set("names", tuple(dict.fromkeys([*before, *lacking])))

    def _recall(self, part: str, fields: Iterable[str], *, drawn: bool) -> None:
        """Set again what was chosen, which Streamlit forgets of what it does not draw."""
        if not (drawn and self._get(part)):
            for field in fields:
                self._set(field, st.session_state[f"_{self.key}_chosen"].get(field))
        self._set(part, drawn)

    def _fields(self) -> Iterator[str]:
        yield from ("observations", "actions", "together", *SINGLE_COLUMNS)
        for one in self.previews:
            yield from (f"{field} {one.name}" for field in ("kind", "unit", "low", "high"))

    def _remember(self) -> None:
        st.session_state[f"_{self.key}_chosen"] = {
            field: self._get(field) for field in (*self._fields(), *self._named())
        }

    def _action(self, name: str, called: str) -> ColumnRole:
        """The role of one action, with its bounds if it is an amount."""
        kind = self._get(f"kind {name}")
        if kind != "continuous":
            return ColumnRole("action", kind=kind, name=called)
        low, high = self._get(f"low {name}"), self._get(f"high {name}")
        try:
            return ColumnRole("action", kind=kind, low=low, high=high, name=called)
        except InputError as error:
            raise InputError(f"of the column {quoted(name)}: {error}") from error

    def _together(self, actions: Sequence[str]) -> bool:
        """Whether several columns are to be one action."""
        ones = {one.name: one.ones for one in self.previews}
        return bool(self._get("together")) and never_together([ones[name] for name in actions])

    def _claim(self, field: str) -> None:
        """Let what was chosen in one field leave the others: a column is one thing."""
        chosen = self._get(field)
        claimed = set(chosen if isinstance(chosen, list) else [chosen])
        named = self._named()
        kind = _PLURAL[named[field][0]] if field in named else field
        for other, (role, _) in named.items():
            apart = field in named or kind != _PLURAL[role]
            if other != field and apart and self._get(other) in claimed:
                self._set(other, None)
        for other in ("observations", "actions"):
            if other != kind:
                self._set(other, [name for name in self._get(other) if name not in claimed])
        for role in SINGLE_COLUMNS:
            if role != field and self._get(role) in claimed:
                self._set(role, None)

    def _draw(
        self,
        read: Callable[[], None],
        problem: Callable[[], None] | None,
        matched: Sequence[str],
    ) -> None:
        st.markdown("**Which column is what?**")
        st.html(column_previews_html(self.previews))
        self._ask_several("observations", "Features: what was seen, in their order")
        self._ask_several("actions", "Actions: what was done")
        self._ask_kinds()
        self._ask_names(matched)
        with st.grid("auto", min_column_width=190):
            for role in _SINGLE:
                self._ask_single(role)
        ends = any(self._get(role) is not None for role in _ENDS)
        with (
            st.expander("Ends and beginnings of episodes (optional)", expanded=ends),
            st.grid("auto", min_column_width=190),
        ):
            for role in _ENDS:
                self._ask_single(role)
        self._ask_units()
        st.caption("A column that is chosen nowhere is not used.")
        if problem is not None:
            problem()
        self._buttons(read)

    def _buttons(self, read: Callable[[], None]) -> None:
        with st.container(horizontal=True):
            st.button(
                "Read with these columns",
                on_click=read,
                type="primary",
                key=f"{self.key}_read",
            )
            try:
                roles = self.roles()
            except InputError:
                return
            st.download_button(
                "Save as columns.json",
                roles_document(roles, {}),
                "columns.json",
                on_click="ignore",
                key=f"{self.key}_save",
                help="For the command line: `--columns columns.json`.",
            )

    def _ask_several(self, field: str, label: str) -> None:
        st.multiselect(
            label,
            [one.name for one in self.previews],
            key=f"{self.key}_{field}",
            format_func=_name,
            placeholder="Choose columns",
            on_change=self._claim,
            args=(field,),
        )

    def _ask_single(self, role: RoleName) -> None:
        st.selectbox(
            SINGLE_COLUMNS[role],
            [one.name for one in self.previews],
            key=f"{self.key}_{role}",
            format_func=_name,
            placeholder="none",
            index=None,
            on_change=self._claim,
            args=(role,),
        )

    def _ask_kinds(self) -> None:
        """Ask whether numbers are choices or amounts, or columns of 1 and 0 are one action."""
        by_name = {one.name: one for one in self.previews}
        actions = [by_name[name] for name in self._get("actions")]
        if never_together([one.ones for one in actions]):
            st.toggle(
                "These columns are one action: never are two of them 1 in the same row",
                key=f"{self.key}_together",
            )
            if self._get("together"):
                ones = [one.ones for one in actions if one.ones is not None]
                words = labels_together([one.name for one in actions], ones)
                st.caption(f"One action with the choices {escaped(', '.join(words))}.")
                return
        for one in actions[:_MOST_KINDS]:
            if one.kind_as_action is None:
                continue
            with st.container(horizontal=True, vertical_alignment="bottom"):
                question = f"{_name(one.name)} is"
                with labelled(question, width="content") as label_visibility:
                    st.segmented_control(
                        question,
                        list(_KINDS),
                        format_func=_KINDS.__getitem__,
                        key=f"{self.key}_kind {one.name}",
                        required=True,
                        label_visibility=label_visibility,
                    )
                if self._get(f"kind {one.name}") == "continuous":
                    for end, label in (("low", "Least possible"), ("high", "Greatest possible")):
                        name = f"{label} {_name(one.name)}"
                        with labelled(name, width=220) as label_visibility:
                            st.number_input(
                                name,
                                value=None,
                                key=f"{self.key}_{end} {one.name}",
                                placeholder="as demonstrated",
                                format="%g",
                                width=220,
                                label_visibility=label_visibility,
                            )

    def _ask_names(self, matched: Sequence[str]) -> None:
        """Ask which column each name of the rules is of that no column bears."""
        if not self._named():
            return
        st.markdown("**Names in the rules: which column is each?**")
        actions = self._get("actions")
        others = {*actions, *(self._get(role) for role in SINGLE_COLUMNS)}
        free = [
            one.name
            for one in self.previews
            if one.name not in others
            and not {*plain_names(feature_names([one.name]) or ())} & {*plain_names(matched)}
        ]
        with st.grid("auto", min_column_width=190):
            for field, (role, name) in self._named().items():
                with labelled(name) as label_visibility:
                    st.selectbox(
                        name,
                        free if role == "feature" else actions,
                        key=f"{self.key}_{field}",
                        format_func=_name,
                        placeholder="Choose a column",
                        index=None,
                        on_change=self._claim,
                        args=(field,),
                        label_visibility=label_visibility,
                    )

    def _ask_units(self) -> None:
        features = self._get("observations")
        if not 0 < len(features) <= _MOST_UNITS:
            return
        with st.expander("Units (optional)"), st.grid("auto", min_column_width=150):
            for name in features:
                with labelled(_name(name)) as label_visibility:
                    st.text_input(
                        _name(name),
                        key=f"{self.key}_unit {name}",
                        placeholder="as m/s",
                        max_chars=24,
                        label_visibility=label_visibility,
                    )


def _name(column: str) -> str:
    return column or NAMELESS
