"""Edits of a rule set by a person: each a small value, kept in a history, undone and redone.

An edit names a rule and changes no rule set. What is in force follows from the set that was mined
and the edits on top of it, so that the thresholds may move below them: pinned and manual rules
stay, and an edit of a rule that is no longer there waits until it comes back. One that regrows a
part of a tree changes what is mined, at all thresholds (`regrowing.regrown_trees`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, replace

from sarl_core.errors import InputError, quoted
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Rule

# A node's number has sixteen digits at most; what is longer was not written here.
_REGROW = re.compile(
    r"([0-9]{1,6})\.([0-9]{1,16}):([0-9]{1,6}):(-?[0-9]+(?:\.[0-9]+)?(?:e[+-]?[0-9]{1,3})?)",
    re.ASCII,
)


@dataclass(frozen=True)
class Switch:
    """Switch a rule on or off.

    Attributes:
        rule_id: The rule.
        on: Whether a shield uses it.
    """

    rule_id: str
    on: bool


@dataclass(frozen=True)
class Pin:
    """Give a mined rule a place before those that were only mined.

    Attributes:
        rule: As it is; it stays in force where the thresholds no longer give it.
    """

    rule: Rule

    @property
    def rule_id(self) -> str:
        """The rule."""
        return self.rule.id


@dataclass(frozen=True)
class Unpin:
    """Take a mined rule's place from it.

    Attributes:
        rule_id: The rule.
    """

    rule_id: str


@dataclass(frozen=True)
class Move:
    """Let a placed rule change places with the one before or after it.

    Attributes:
        rule_id: The rule.
        up: Whether it comes earlier.
    """

    rule_id: str
    up: bool


@dataclass(frozen=True)
class Add:
    """Add a rule by hand, behind the other placed ones.

    Attributes:
        rule: Its origin is "manual".
    """

    rule: Rule

    @property
    def rule_id(self) -> str:
        """The rule."""
        return self.rule.id


@dataclass(frozen=True)
class Change:
    """Put another rule in the place of one added by hand.

    Attributes:
        rule: The new one, with the old one's id.
    """

    rule: Rule

    @property
    def rule_id(self) -> str:
        """The rule."""
        return self.rule.id


@dataclass(frozen=True)
class Remove:
    """Remove a rule that was added by hand.

    Attributes:
        rule_id: The rule.
    """

    rule_id: str


@dataclass(frozen=True)
class Regrow:
    """Let a node of a tree ask another query, and grow the part below it anew.

    Attributes:
        dimension: Action dimension of the tree.
        node: Number of the node, as rules are called by it.
        feature: Index of the feature that it is to ask about.
        threshold: A state goes left where the feature is at most this.
    """

    dimension: int
    node: int
    feature: int
    threshold: float

    @property
    def rule_id(self) -> str:
        """Of the rule that a cut at the node gives."""
        return f"{self.dimension}.{self.node}"

    @property
    def text(self) -> str:
        """For a link, as "0.12:3:0.0254"; `of` reads it."""
        return f"{self.rule_id}:{self.feature}:{self.threshold!r}"

    @classmethod
    def of(cls, text: str) -> Regrow:
        """Read what `text` wrote.

        Args:
            text: From anywhere.

        Returns:
            Four numbers; whether there are such a node and feature is seen where it is done.

        Raises:
            InputError: If it is no such text.
        """
        parts = _REGROW.fullmatch(text)
        if parts is None or not math.isfinite(float(parts[4])):
            raise InputError(
                f"{quoted(text)} says no part to regrow; give dimension.node:feature:threshold, as "
                "0.12:3:0.0254"
            )
        return cls(int(parts[1]), int(parts[2]), int(parts[3]), float(parts[4]))


_OfRule = Switch | Pin | Unpin | Move | Add | Change | Remove
Edit = _OfRule | Regrow


@dataclass(frozen=True)
class History:
    """Edits in their order, and those that were undone.

    Attributes:
        edits: In force, the oldest first.
        undone: What redoing brings back, the next one last.
    """

    edits: tuple[Edit, ...] = ()
    undone: tuple[Edit, ...] = ()

    def done(self, edit: Edit) -> History:
        """With one more edit; what was undone before is forgotten."""
        return History((*self.edits, edit))

    def undo(self) -> History:
        """Without the latest edit; itself where there is none."""
        if not self.edits:
            return self
        return History(self.edits[:-1], (*self.undone, self.edits[-1]))

    def redo(self) -> History:
        """With the edit that was undone last; itself where there is none."""
        if not self.undone:
            return self
        return History((*self.edits, self.undone[-1]), self.undone[:-1])


def apply(rule_set: RuleSet, edits: Iterable[Edit]) -> RuleSet:
    """The rule set that edits make of another.

    Args:
        rule_set: What was mined, or read from a file; where a part of its trees is to be regrown,
            what was mined from those (`regrowing.regrown_trees`).
        edits: The oldest first. One whose rule is not there changes nothing.

    Returns:
        The placed rules (pinned or manual) in their order, then the others in theirs; the set
        itself without edits.
    """
    edits = tuple(edits)
    if not edits:
        return rule_set
    desk = _Desk(rule_set)
    for edit in edits:
        if not isinstance(edit, Regrow):  # the rules are those of the trees with it
            desk.take(edit)
    return desk.result()


class _Desk:
    """The rules while they are edited."""

    def __init__(self, rule_set: RuleSet) -> None:
        self._rule_set = rule_set
        self._given = {rule.id: rule for rule in rule_set.rules}
        self._rules = dict(self._given)
        self._placed = [rule.id for rule in rule_set.rules if rule.placed]
        self._on: dict[str, bool] = {}

    def take(self, edit: _OfRule) -> None:
        rule_id = edit.rule_id
        if isinstance(edit, Switch):
            self._on[rule_id] = edit.on
        elif isinstance(edit, Pin):
            self._rules[rule_id] = replace(self._rules.get(rule_id, edit.rule), pinned=True)
            if rule_id not in self._placed:
                self._placed.append(rule_id)
        elif isinstance(edit, Unpin):
            if rule_id in self._placed and self._rules[rule_id].origin == "mined":
                self._leave(rule_id)
        elif isinstance(edit, Move):
            self._move(rule_id, -1 if edit.up else 1)
        elif isinstance(edit, Add):
            self._rules[rule_id] = edit.rule
            self._placed.append(rule_id)
        elif isinstance(edit, Change):
            if rule_id in self._rules:
                self._rules[rule_id] = edit.rule
        elif rule_id in self._rules:
            self._placed.remove(rule_id)
            del self._rules[rule_id]

    def _leave(self, rule_id: str) -> None:
        self._placed.remove(rule_id)
        if rule_id in self._given:
            self._rules[rule_id] = replace(self._given[rule_id], pinned=False)
        else:  # only its pin kept it
            del self._rules[rule_id]

    def _move(self, rule_id: str, by: int) -> None:
        if rule_id not in self._placed:
            return
        peers = peers_of(self._rules[rule_id], [self._rules[one] for one in self._placed])
        other = peers.index(rule_id) + by
        if 0 <= other < len(peers):
            here, there = self._placed.index(rule_id), self._placed.index(peers[other])
            self._placed[here], self._placed[there] = self._placed[there], self._placed[here]

    def result(self) -> RuleSet:
        placed = set(self._placed)
        order = [*self._placed, *(one for one in self._rules if one not in placed)]
        return replace(self._rule_set, rules=tuple(map(self._switched, order)))

    def _switched(self, rule_id: str) -> Rule:
        rule = self._rules[rule_id]
        on = self._on.get(rule_id, rule.enabled)
        return rule if on == rule.enabled else replace(rule, enabled=on)


def peers_of(rule: Rule, rules: Iterable[Rule]) -> list[str]:
    """The placed rules among which a rule has its place.

    Args:
        rule: A placed one.
        rules: In their order.

    Returns:
        Ids of the placed rules of its action dimension, itself among them.
    """
    return [one.id for one in rules if one.placed and one.dimension == rule.dimension]


def check_edit(rule_set: RuleSet, edit: Edit) -> None:
    """Refuse an edit that cannot be made.

    Args:
        rule_set: In force, with all edits so far.
        edit: The next one. Whether a part can be regrown is seen where that is done.

    Raises:
        InputError: If its rule is not there, or nothing can be done to it in this way.
    """
    if isinstance(edit, Regrow):
        return
    rule = next((one for one in rule_set.rules if one.id == edit.rule_id), None)
    if isinstance(edit, Add):
        if rule is not None:
            raise InputError(f"{rule_set.name_of(rule)} has that id already; give another")
        return
    if rule is None:  # so it has no name either
        raise InputError("the rule is not in force any more; choose one of the table")
    name = rule_set.name_of(rule)
    if isinstance(edit, Pin) and rule.placed:
        raise InputError(f"{name} has its place already; move it up or down")
    if isinstance(edit, Unpin) and not (rule.pinned and rule.origin == "mined"):
        raise InputError(f"{name} is not pinned; choose one that is")
    if isinstance(edit, (Change, Remove)) and rule.origin != "manual":
        raise InputError(
            f"{name} was mined and stays what it is; switch it off, or add one by hand"
        )
    if isinstance(edit, Move):
        _check_move(rule_set, rule, up=edit.up)


def _check_move(rule_set: RuleSet, rule: Rule, *, up: bool) -> None:
    name = rule_set.name_of(rule)
    if not rule.placed:
        raise InputError(
            f"{name} has no place among the others, as mined rules never overlap; pin it first"
        )
    peers = peers_of(rule, rule_set.rules)
    if peers[0 if up else -1] == rule.id:
        raise InputError(f"{name} is the {'first' if up else 'last'} of the placed rules already")


def next_manual_id(rule_set: RuleSet, history: History = History()) -> str:
    """A name for a rule added by hand that no other rule has.

    Args:
        rule_set: In force.
        history: Its edits, whose rules keep their names though they may be gone for now.

    Returns:
        As "manual.1".
    """
    used = {rule.id for rule in rule_set.rules}
    used |= {edit.rule_id for edit in (*history.edits, *history.undone)}
    number = 1
    while f"manual.{number}" in used:
        number += 1
    return f"manual.{number}"
