"""Edits as JSON, to be kept: what was done to some rules, the oldest first."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from sarl_core.documents import MisfitError, conformed, parse_json
from sarl_core.errors import InputError
from sarl_core.mining.editing.edits import (
    Add,
    Change,
    Edit,
    Move,
    Pin,
    Regrow,
    Remove,
    Switch,
    Unpin,
)
from sarl_core.mining.rule_files.reading import DocumentPart, RuleDocument, each
from sarl_core.mining.rule_files.writing import rule_document
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule

FORMAT, VERSION = "sarl-edits", 1


class _EditEntry(DocumentPart, tag_field="do"):
    """One edit."""


class _SwitchEntry(_EditEntry, tag="switch"):
    rule_id: str
    on: bool

    def read(self, _: RuleSet) -> Edit:
        return Switch(self.rule_id, on=self.on)


class _UnpinEntry(_EditEntry, tag="unpin"):
    rule_id: str

    def read(self, _: RuleSet) -> Edit:
        return Unpin(self.rule_id)


class _MoveEntry(_EditEntry, tag="move"):
    rule_id: str
    up: bool

    def read(self, _: RuleSet) -> Edit:
        return Move(self.rule_id, up=self.up)


class _RemoveEntry(_EditEntry, tag="remove"):
    rule_id: str

    def read(self, _: RuleSet) -> Edit:
        return Remove(self.rule_id)


class _WithRule(_EditEntry):
    """An edit that holds a rule."""

    rule: RuleDocument

    def rule_of(self, rule_set: RuleSet) -> Rule:
        source = rule_set.source
        return self.rule.read(rule_set.actions, len(source.features), source.steps)


class _PinEntry(_WithRule, tag="pin"):
    def read(self, rule_set: RuleSet) -> Edit:
        return Pin(self.rule_of(rule_set))


class _AddEntry(_WithRule, tag="add"):
    def read(self, rule_set: RuleSet) -> Edit:
        return Add(self.rule_of(rule_set))


class _ChangeEntry(_WithRule, tag="change"):
    def read(self, rule_set: RuleSet) -> Edit:
        return Change(self.rule_of(rule_set))


class _RegrowEntry(_EditEntry, tag="regrow"):
    part: str

    def read(self, _: RuleSet) -> Edit:
        try:
            return Regrow.of(self.part)
        except InputError as error:
            raise MisfitError(str(error)) from error


_AnyEntry = (
    _SwitchEntry
    | _UnpinEntry
    | _MoveEntry
    | _RemoveEntry
    | _PinEntry
    | _AddEntry
    | _ChangeEntry
    | _RegrowEntry
)


class _EditsDocument(DocumentPart):
    format: str
    version: int
    edits: list[_AnyEntry]


def edits_to_json(edits: Iterable[Edit]) -> str:
    """Edits as text; `edits_from_json` reads it.

    Args:
        edits: The oldest first.
    """
    document = {"format": FORMAT, "version": VERSION, "edits": list(map(_written, edits))}
    return json.dumps(document, allow_nan=False, ensure_ascii=False, sort_keys=True)


def _written(edit: Edit) -> dict[str, Any]:
    if isinstance(edit, Regrow):
        return {"do": "regrow", "part": edit.text}
    what = {"do": type(edit).__name__.lower()}
    if isinstance(edit, Pin | Add | Change):
        return {**what, "rule": rule_document(edit.rule)}
    return {**what, **vars(edit)}


def edits_from_json(text: str | bytes, rule_set: RuleSet, *, name: str) -> tuple[Edit, ...]:
    """Edits that were written.

    Args:
        text: JSON.
        rule_set: That they are made on, whose features and actions their rules speak of.
        name: What to call it in an error.

    Returns:
        The oldest first. Whether they can be made is seen where that is done.

    Raises:
        InputError: If it holds anything else.
    """
    try:
        document = parse_json(text)
    except (InputError, ValueError) as error:
        raise InputError(f"{name} cannot be read ({error}); make the edits again") from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f"{name} holds no edits; choose another")
    if document.get("version") != VERSION:
        raise InputError(f"{name} was written by a newer version of this program; use that one")
    try:
        entries = conformed(document, _EditsDocument).edits
        return each(entries, "edits", lambda entry: entry.read(rule_set))
    except MisfitError as error:
        raise InputError(f"{name}: {error}; make the edits again") from error
