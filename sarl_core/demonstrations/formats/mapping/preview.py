"""A table as a person looks at it to say which column is what: first values, kinds and a guess."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.fields import TRUTH
from sarl_core.demonstrations.formats.column_values import counters, numbers_episodes, settle
from sarl_core.demonstrations.formats.columns import (
    NO_OBSERVATION,
    ColumnMap,
    Guess,
    UnclearColumnsError,
    guess_roles,
)
from sarl_core.demonstrations.formats.mapping.joined import joined, ones_of
from sarl_core.demonstrations.formats.mapping.roles import ActionKind, ColumnRole, RoleName, Roles
from sarl_core.demonstrations.formats.opened_table import Table, TableColumn
from sarl_core.demonstrations.formats.tables import without_times
from sarl_core.demonstrations.formats.vocabulary import likely_actions
from sarl_core.demonstrations.requirements import FEW_VALUES, is_whole, without_fraction
from sarl_core.errors import InputError

_FIRST = 4  # values that are shown of a column
_NOTHING, _TRUTHS = "nothing", "true or false"
_LONGEST_WHOLE = 1e15  # a greater number is not written digit by digit


@dataclass(frozen=True)
class ColumnPreview:
    """One column of a table.

    Attributes:
        name: As the table calls it.
        holds: What kind of values, in words.
        first: The first few of them.
        role: What it seems to be; None where two readings are possible.
        why: In words.
        kind_as_action: Whether it would be read as labels or as an amount if it were an action;
            None where it cannot be an amount.
        ones: Where it is 1, shape (N,); None if it holds anything but 1 and 0.
    """

    name: str
    holds: str
    first: tuple[str, ...]
    role: ColumnRole | None
    why: str
    kind_as_action: ActionKind | None = None
    ones: NDArray[np.bool_] | None = field(default=None, repr=False, compare=False)

    @property
    def document(self) -> dict[str, Any]:
        """The same for JSON."""
        return {
            "name": self.name,
            "holds": self.holds,
            "first": list(self.first),
            "role": None if self.role is None else str(self.role),
            "why": self.why,
        }


def previewed(table: Table, roles: Roles) -> tuple[ColumnPreview, ...]:
    """Look at every column of a table.

    Args:
        table: The opened file.
        roles: What a person said of some columns.

    Returns:
        One entry a column.

    Raises:
        InputError: If what was said does not fit the table.
    """
    table = joined(table, roles)
    guess = guess_roles(table.names, roles)
    read = _readable(table)
    guess, unclear = _settled(guess, read)
    previews = []
    for name in table.names:
        role = None if name in unclear else _role(guess, name, table)
        kind = _action_kind(guess, read[name]) if name in read else None
        if role == ColumnRole("action"):
            role = ColumnRole("action", kind=kind)
        why = unclear.get(name) or guess.reasons.get(name) or guess.unused.get(name, "")
        holds = _kind(read[name]) if name in read else "neither numbers nor words"
        first = _first(read[name]) if name in read else ()
        ones = ones_of(read[name]) if name in read else None
        previews.append(ColumnPreview(name, holds, first, role, why, kind, ones))
    return tuple(previews)


def _readable(table: Table) -> dict[str, TableColumn]:
    """The columns that can be read at all."""
    try:
        return table.read(ColumnMap((), table.names))
    except InputError as error:
        read: dict[str, TableColumn] = {}
        for name in table.names:
            try:
                read |= table.read(ColumnMap((), (name,)))
            except InputError:
                continue
        if not read:
            raise error
        return read


def _settled(guess: Guess, read: Mapping[str, TableColumn]) -> tuple[Guess, dict[str, str]]:
    """What the values make of a guess, and why some columns are left open."""
    numbers = {name: one.values for name, one in read.items() if not one.words}
    counted = counters({name: numbers[name] for name in guess.unclear if name in numbers})
    unclear = {name: "it may be a feature or not" for name in guess.unclear if name not in counted}
    unread = {name: "it cannot be read" for name in guess.columns.used if name not in read}
    guess = replace(guess, unclear=(), unused={**guess.unused, **counted, **unread})
    guess = _without(guess, unread)
    guess = _with_actions(_with_episodes(guess, read), read)
    guess, held, _ = without_times(guess, read)
    words = {name for name, column in held.items() if column.words}
    while True:
        try:
            values = {name: held[name].values for name in guess.columns.used}
            return settle(guess, values, words), unclear
        except UnclearColumnsError as error:
            unclear |= dict.fromkeys(error.columns, str(error).partition(";")[0])
            guess = _without(guess, error.columns)
        except InputError:
            return guess, unclear


def _with_episodes(guess: Guess, read: Mapping[str, TableColumn]) -> Guess:
    """The same with the column that numbers the episodes where none is called so."""
    columns = guess.columns
    if {"episode", "first", "last", "terminated", "truncated"} & columns.singles.keys():
        return guess
    free = [name for name in columns.observations if name in read and name not in guess.roles]
    counts = [name for name in free if not read[name].words and numbers_episodes(read[name].values)]
    if len(counts) != 1:
        return guess
    left = _without(guess, counts)
    why = "no column is called the episode, and this one stays and goes on by one"
    return replace(
        left,
        columns=replace(left.columns, episode=counts[0]),
        reasons={**left.reasons, counts[0]: why},
    )


def _with_actions(guess: Guess, read: Mapping[str, TableColumn]) -> Guess:
    """The same with the columns that are likely the actions where none is called so.

    Whoever looks at the guess confirms it; nothing is read by it in silence.
    """
    columns = guess.columns
    if columns.actions:
        return guess
    free = [
        name
        for name in read
        if name not in guess.roles
        and (name in columns.observations or guess.unused.get(name) == NO_OBSERVATION)
    ]
    words = [name for name in free if read[name].words and not read[name].is_time]
    few = [name for name in free if not read[name].words and _is_few(read[name].values)]
    if actions := likely_actions(free):
        why = "no column is called an action, and this name may be that of one"
    elif len(words) == 1:
        actions, why = words, "no column is called an action, and this one alone holds words"
    elif not words and len(few) == 1:
        actions, why = few, "no column is called an action, and this one alone holds few numbers"
    else:
        return guess
    left = _without(guess, actions)
    return replace(
        left,
        columns=replace(left.columns, actions=tuple(actions)),
        reasons={**left.reasons, **dict.fromkeys(actions, why)},
        unused={name: why for name, why in left.unused.items() if name not in actions},
    )


def _is_few(values: NDArray[Any]) -> bool:
    """Whether a column may hold labels: some whole numbers, which do not number the episodes."""
    different = len(np.unique(values))
    return is_whole(values) and 2 <= different <= FEW_VALUES and not numbers_episodes(values)


def _without(guess: Guess, names: Collection[str]) -> Guess:
    columns = guess.columns
    return replace(
        guess,
        columns=columns.only([name for name in columns.used if name not in names]),
        reasons={name: why for name, why in guess.reasons.items() if name not in names},
    )


def _role(guess: Guess, name: str, table: Table) -> ColumnRole | None:
    """What a column seems to be, with its unit."""
    if name in guess.roles:
        return guess.roles[name]
    columns = guess.columns
    if name in columns.observations:
        return ColumnRole("feature", unit=table.metadata.column_units.get(name, ""))
    if name in columns.actions:
        return ColumnRole("action")
    single: dict[str, RoleName] = {
        "episode": "episode",
        "step": "step",
        "reward": "reward",
        "terminated": "terminated",
        "truncated": "truncated",
        "first": "first",
        "last": "last",
        "time": "time",
    }
    for role, column in columns.singles.items():
        if column == name:
            return ColumnRole(single[role])
    return ColumnRole("ignore")


def _action_kind(guess: Guess, column: TableColumn) -> ActionKind | None:
    """How the actions would be read."""
    values = _present(column)
    if column.words or values.dtype.kind == "b":
        return None
    several = len(guess.columns.actions) > 1
    few = not several and is_whole(values) and len(np.unique(values)) <= FEW_VALUES
    return "labels" if values.dtype.kind in "iu" or few else "continuous"


def _kind(column: TableColumn) -> str:
    values = _present(column)
    if not len(values):
        return _NOTHING
    if column.words:
        if {*map(str.lower, column.words)} <= {*TRUTH}:
            return _TRUTHS
        return "times" if column.is_time else "words"
    if values.dtype.kind == "b":
        return _TRUTHS
    return "whole numbers" if without_fraction(values).all() else "numbers"


def _present(column: TableColumn) -> NDArray[Any]:
    return column.values if column.missing is None else column.values[~column.missing]


def _first(column: TableColumn) -> tuple[str, ...]:
    values = column.values[:_FIRST]
    missing = np.zeros(len(values), bool) if column.missing is None else column.missing[:_FIRST]
    return tuple(
        "" if none else _text(value, column.words)
        for value, none in zip(values.tolist(), missing.tolist(), strict=True)
    )


def _text(value: bool | float, words: tuple[str, ...]) -> str:
    if words:
        return words[int(value)]
    if isinstance(value, bool):
        return str(value).lower()
    whole = float(value).is_integer() and abs(value) < _LONGEST_WHOLE
    return f"{value:.0f}" if whole else f"{value:.6g}"
