"""Tables, one row a step: what Parquet and CSV have in common."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.fields import TRUTH
from sarl_core.demonstrations.formats.column_values import resolved, settle
from sarl_core.demonstrations.formats.columns import (
    IS_TIME,
    ColumnMap,
    Guess,
    action_names,
    check_map,
    feature_names,
    guess_notes,
    guess_roles,
    listed,
    prefixed,
    require_clear,
    unclear_columns,
)
from sarl_core.demonstrations.formats.mapping.action_roles import (
    stated_actions,
    with_stated_actions,
)
from sarl_core.demonstrations.formats.mapping.joined import joined, one_action_note
from sarl_core.demonstrations.formats.mapping.roles import Roles, names_in
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.observation_blocks import (
    ObservationBlock,
    observation_block,
)
from sarl_core.demonstrations.formats.opened_table import Table, TableColumn
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.formats.times import as_clock, of_words, with_seconds
from sarl_core.demonstrations.formats.units import without_units
from sarl_core.demonstrations.requirements import coarse_columns, crowded, flags
from sarl_core.demonstrations.words import numbered_episodes
from sarl_core.environments.description import EnvironmentDescription
from sarl_core.errors import InputError, quoted

_OWN_SINGLES = ("episode", "step", "reward", "terminated", "truncated", "time")


def recording_from_table(
    table: Table,
    columns: ColumnMap | Roles | None,
    description: EnvironmentDescription | None,
    names: Mapping[str, str] | None = None,
) -> Recording:
    """Read the columns of a table that are needed.

    Args:
        table: The opened file.
        columns: Which columns hold what, or what some of them are; None to go by their names.
        description: The environment, if known; it tells a table without names apart.
        names: What is known to be the names of what columns hold, whoever says what they are.

    Returns:
        What the table holds.

    Raises:
        InputError: If roles are unclear, a column is missing, or a value is no number.
    """
    metadata, of_the_file = table.metadata, set(table.names)
    guessed = False
    notes: tuple[str, ...] = ()
    if isinstance(columns, ColumnMap):
        guess = given(columns, "as it was mapped")
        metadata = _without_names(metadata)
    elif columns is not None:
        table = joined(table, columns)
        guess, guessed = guess_roles(table.names, columns), True
        metadata = _without_names(metadata)
        names = {**(names or {}), **names_in(columns)}
    elif metadata.features and metadata.action_names:
        guess = given(_own_columns(table.names, metadata), "the file itself says so")
    elif not table.named:
        guess, notes = _unnamed(table.names, description)
    else:
        guess, guessed = guess_roles(table.names), True
    if guessed:
        if guess.unclear:
            guess = resolved(guess, numbers_of(table, guess.unclear), table.names)
        require_clear(guess, table.names)
    check_map(guess.columns, table.names)
    read, rows, dropped = _without_empty_ends(table.read(guess.columns), guess.columns)
    guess, read, numbered = without_times(guess, read)
    if guessed:
        guess = _without_empty_columns(guess, read)
        words = {name for name, column in read.items() if column.words}
        guess = settle(guess, {name: column.values for name, column in read.items()}, words)
    guess, read = with_seconds(guess, read, table.metadata.column_units, rows, certain=not guessed)
    if guessed:
        notes = guess_notes(guess)
        if not any(name in guess.roles for name in guess.columns.actions):
            acted = guess.columns.actions
            notes += one_action_note(acted, [read[name] for name in acted])
    chosen = guess.columns
    read = {name: read[name] for name in chosen.used}
    require_filled({name: read[name] for name in chosen.singles.values()}, rows, chosen.reward)
    require_numbers(read, chosen.singles.values(), rows)
    single = {role: read[name].with_gaps for role, name in chosen.singles.items()}
    fields, marked = episode_fields(single, chosen)
    named = columns is not None or table.named
    called = chosen.feature_names or _named(
        chosen.observations, names_of_features(guess, table.named) if named else None, names
    )
    block = observation_block(read, chosen.observations, called)
    coarse = coarse_notes(table, block, rows)
    feature_names, units = (
        block.names,
        units_of(block.columns, guess.roles, table.metadata.column_units),
    )
    if feature_names is not None and not chosen.feature_names:
        feature_names, written = without_units(feature_names)
        units = tuple(known or behind for known, behind in zip(units, written, strict=True))
    vector = is_vector(chosen.actions, of_the_file)
    actions = stated_actions(read, chosen.actions, guess.roles, rows)
    return Recording(
        observations=block.values,
        actions=action_block(actions, chosen.actions, vector),
        observation_columns=tuple(f"column {name!r}" for name in block.columns),
        action_columns=tuple(f"column {name!r}" for name in chosen.actions),
        feature_names=feature_names,
        feature_units=units if any(units) else None,
        indicators=block.indicators,
        action_words=label_words(actions, chosen.actions),
        missing_actions=missing_block(actions, chosen.actions),
        action_names=chosen.action_names
        or _named(
            chosen.actions,
            action_names(chosen.actions)
            if named and of_the_file.issuperset(chosen.actions)
            else None,
            names,
        ),
        **fields,
        rows=rows,
        guess_labels=actions is read and not vector,
        names={role: f"column {name!r}" for role, name in chosen.singles.items()},
        metadata=with_stated_actions(metadata, chosen.actions, guess.roles),
        notes=(*notes, *numbered, *marked, *dropped, *coarse),
        columns=guess.uses(table.names),
    )


def without_times(
    guess: Guess, read: Mapping[str, TableColumn]
) -> tuple[Guess, dict[str, TableColumn], tuple[str, ...]]:
    """A guess without features and steps that are times, and its columns with numbered episodes.

    Args:
        guess: By the columns' names.
        read: The columns that it uses, by name.

    Returns:
        The guess, the columns that are left, and a note where texts became the numbers of episodes.

    Raises:
        InputError: If a column is called a feature and holds times, or no feature is left.
    """
    columns = guess.columns
    timed = [name for name in (*columns.observations, columns.step) if name and read[name].is_time]
    for name in timed:
        if name != columns.step and (guess.prefixed or name in guess.roles):
            codes, words = read[name].values, read[name].words
            row = int(np.argmax(codes >= 0))
            raise InputError(
                f"column {quoted(name)} holds {quoted(words[codes[row]])} in row {row + 1}, which "
                "is a time and no number; write numbers, or leave it out"
            )
    times = dict.fromkeys(timed, IS_TIME)
    guess = guess.without(times)
    if columns.observations and not guess.columns.observations:
        raise InputError(
            f"there is no feature beside {listed(times)}, which hold times; choose columns of "
            "numbers or of words"
        )
    if columns.step in times:
        guess = replace(
            guess,
            columns=replace(guess.columns, step=None),
            unused={**guess.unused, columns.step: times[columns.step]},
        )
    if times and columns.time is None:
        clock = next(iter(times))
        guess = as_clock(guess, clock)
        read = {**read, clock: of_words(read[clock])}
    left = {name: read[name] for name in guess.columns.used}
    episode = columns.episode
    if episode is None or not left[episode].words:
        return guess, left, ()
    codes, words = left[episode].values, left[episode].words
    numbers, note = numbered_episodes(codes, f"column {episode!r}", repr(words[codes[0]]))
    left[episode] = TableColumn(numbers, left[episode].missing)
    return guess, left, (note,)


def episode_fields(
    single: Mapping[str, NDArray[Any]], columns: ColumnMap
) -> tuple[dict[str, NDArray[Any]], tuple[str, ...]]:
    """What columns say of episodes and rewards, marks of first and last steps among them.

    Args:
        single: Values by what they are, as "episode" and "last", each of shape (N,).
        columns: The columns that hold them, for messages.

    Returns:
        The fields of a `Recording`, and notes.

    Raises:
        InputError: If a mark is neither true nor false, or marks contradict one another.
    """
    fields = {
        field: single[role]
        for field, role in (
            ("episodes", "episode"),
            ("steps", "step"),
            ("rewards", "reward"),
            ("terminated", "terminated"),
            ("truncated", "truncated"),
            ("times", "time"),
        )
        if role in single
    }
    marks = {
        role: flags(single[role], len(single[role]), f"column {getattr(columns, role)!r}")
        for role in ("first", "last")
        if role in single
    }
    notes: tuple[str, ...] = ()
    if len(marks) == 2:
        differs = np.flatnonzero(marks["first"][1:] != marks["last"][:-1])
        if len(differs):
            raise InputError(
                f"column {columns.first!r} and column {columns.last!r} contradict each other in "
                f"rows {differs[0] + 1} and {differs[0] + 2}: an episode must begin after the last "
                "step of another one; mend those rows"
            )
    if marks and "episodes" not in fields:
        if "first" in marks:
            begins = marks["first"].copy()
            how, name = "begins", columns.first
        else:
            begins = np.append(False, marks["last"][:-1])
            how, name = "ends", columns.last
        begins[:1] = False
        fields["episodes"] = np.cumsum(begins)
        notes = (f"there is no episode column, so an episode {how} where {name!r} says so",)
    if "last" in marks and "truncated" not in fields:
        # Whatever ended without the environment's saying so was cut off.
        terminated = fields.get("terminated", np.zeros(len(marks["last"])))
        fields["truncated"] = marks["last"] & (terminated == 0)
    return fields, notes


def given(columns: ColumnMap, why: str) -> Guess:
    """Columns that nobody had to guess.

    Args:
        columns: Which columns hold what.
        why: It is known.

    Returns:
        The certain guess.
    """
    return Guess(columns, dict.fromkeys(columns.used, why), {}, prefixed=True)


def names_of_features(guess: Guess, named: bool) -> tuple[str, ...] | None:
    """What the features are called; a word that names of features begin with says nothing."""
    columns = guess.columns.observations
    bare = guess.prefixed or not named or (guess.roles and prefixed(columns))
    return feature_names(columns) if bare else columns


def _named(
    columns: Sequence[str], called: tuple[str, ...] | None, names: Mapping[str, str] | None
) -> tuple[str, ...] | None:
    """What columns hold is called, under the names that are known of some of them."""
    if not names or not names.keys() & set(columns):
        return called
    return tuple(
        names.get(column, own) for column, own in zip(columns, called or columns, strict=True)
    )


def units_of(columns: Sequence[str], roles: Roles, units: Mapping[str, str]) -> tuple[str, ...]:
    """The units of features; what says which word a column holds has none.

    Args:
        columns: Of the features.
        roles: What a person said of columns.
        units: What the file says of them.

    Returns:
        One a column, "" where there is none.
    """
    return tuple(
        (roles[name].unit if name in roles else "") or units.get(name, "") for name in columns
    )


def numbers_of(table: Table, names: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """Values of columns that may hold anything."""
    try:
        read = table.read(ColumnMap((), names))
    except InputError:
        raise unclear_columns(names, table.names) from None
    if any(column.words for column in read.values()):
        raise unclear_columns(names, table.names)
    return {name: column.values for name, column in read.items()}


def require_filled(
    read: Mapping[str, TableColumn],
    rows: NDArray[np.int64] | None = None,
    reward: str | None = None,
) -> None:
    """Refuse an empty field where no step can be without one.

    Args:
        read: The columns by name.
        rows: The rows they had in the file, from 0; None if they are those.
        reward: The column of rewards, which may be empty.

    Raises:
        InputError: With the column and its first empty row.
    """
    for name, column in read.items():
        if name != reward and column.missing is not None and column.missing.any():
            row = int(np.argmax(column.missing))
            number = row if rows is None else int(rows[row])
            raise InputError(
                f"column {name!r} is empty in row {number + 1}; mend or remove that row"
            )


def require_numbers(
    read: Mapping[str, TableColumn],
    names: Iterable[str],
    rows: NDArray[np.int64] | None = None,
) -> None:
    """Refuse words where numbers are needed.

    Args:
        read: The columns by name.
        names: Those that hold numbers.
        rows: The rows they had in the file, from 0; None if they are those.

    Raises:
        InputError: With the column and its first word.
    """
    for name in names:
        column = read[name]
        if column.words:
            row = int(np.argmax(column.values >= 0))
            number = row if rows is None else int(rows[row])
            raise InputError(
                f"column {quoted(name)} holds {quoted(column.words[column.values[row]])} in row "
                f"{number + 1}, which is no number; mend that row"
            )


def coarse_notes(
    table: Table, block: ObservationBlock, rows: NDArray[np.int64] | None = None
) -> tuple[str, ...]:
    """Sentences on features whose values are too close to one another for float32.

    Args:
        table: The opened file; a few of its columns are read again, with all their digits.
        block: What was read of them.
        rows: Shape (N,), their rows in the file, from 0; None if they are all.

    Returns:
        One sentence for each of them.
    """
    observations, names = block.values, block.columns
    suspects = [
        index
        for index in np.flatnonzero(crowded(observations)).tolist()
        if block.indicators[index] is None
    ]
    if not suspects:
        return ()
    again = table.read(ColumnMap((), tuple(names[index] for index in suspects)))
    places = slice(None) if rows is None else rows
    notes: list[str] = []
    for index in suspects:
        exact = again[names[index]].values[places, None]
        notes += coarse_columns(
            exact, observations[:, index : index + 1], (f"column {names[index]!r}",)
        )
    return tuple(notes)


def action_block(
    read: Mapping[str, TableColumn], names: Sequence[str], vector: bool
) -> NDArray[Any]:
    """Actions of shape (N,), or (N, m) where they are vectors."""
    columns = [read[name].values for name in names]
    columns = [one.astype(np.int64) if one.dtype.kind == "b" else one for one in columns]
    return np.stack(columns, axis=1) if vector else columns[0]


def missing_block(
    read: Mapping[str, TableColumn], names: Sequence[str]
) -> NDArray[np.bool_] | None:
    """Where actions are missing, (N, m); None if they are nowhere."""
    if all(read[name].missing is None for name in names):
        return None
    n = len(read[names[0]].values)
    nowhere = np.zeros(n, dtype=np.bool_)
    missing = [read[name].missing for name in names]
    return np.stack([nowhere if one is None else one for one in missing], axis=1)


def label_words(
    read: Mapping[str, TableColumn], names: Sequence[str]
) -> tuple[tuple[str, ...], ...]:
    """The words that the numbers of an action block stand for, () where they are numbers."""
    return tuple(
        TRUTH if read[name].values.dtype.kind == "b" else read[name].words for name in names
    )


def _without_names(metadata: Metadata) -> Metadata:
    """Metadata of a file whose columns a person has mapped: what is left are the spaces."""
    return Metadata(
        env_id=metadata.env_id,
        agent=metadata.agent,
        seed=metadata.seed,
        label_names=metadata.label_names,
        label_first=metadata.label_first,
        action_low=metadata.action_low,
        action_high=metadata.action_high,
        bounds_from=metadata.bounds_from,
        notes=metadata.notes,
    )


def _own_columns(names: tuple[str, ...], metadata: Metadata) -> ColumnMap:
    """The columns of a file with its own metadata, which names them all."""
    observations = tuple(f"obs_{feature.name}" for feature in metadata.features)
    actions = tuple(f"action_{name}" for name in metadata.action_names)
    if len(actions) == 1 and "action" in names:
        actions = ("action",)
    for column in (*observations, *actions):
        if column not in names:
            raise InputError(
                f"the column {column!r} that its metadata names is missing among "
                f"{listed(names)}; save the file again"
            )
    stray = next(
        (name for name in names if name.startswith("obs_") and name not in observations), None
    )
    if stray is not None:
        raise InputError(
            f"its metadata does not know the column {stray!r}; save the file again, "
            "or without metadata"
        )
    return ColumnMap.of_roles(
        observations, actions, {role: role for role in _OWN_SINGLES if role in names}
    )


def _unnamed(
    names: tuple[str, ...], description: EnvironmentDescription | None
) -> tuple[Guess, tuple[str, ...]]:
    """A table without a header: clear only if it is as wide as the environment's spaces."""
    if description is not None:
        d, m = len(description.feature_names), len(description.action_names)
        if len(names) == d + m:
            columns = ColumnMap(names[:d], names[d:])
            return given(columns, f"{description.env_id} has it in this place"), (
                f"there is no header, so the first {d} columns were taken as observations",
            )
    raise InputError(
        f"there is no header that says what its {len(names)} columns are; add one (obs_0, ..., "
        "action), or map the columns"
    )


def is_vector(actions: Sequence[str], table: Container[str]) -> bool:
    """Whether the names say that an action is a vector, if only of one number.

    Args:
        actions: The action's columns, or what several of them are together.
        table: The columns that there are.
    """
    return len(actions) > 1 or (actions[0].startswith("action_") and actions[0] in table)


def _without_empty_ends(
    read: dict[str, TableColumn], chosen: ColumnMap
) -> tuple[dict[str, TableColumn], NDArray[np.int64] | None, tuple[str, ...]]:
    """Drop rows without an action at the end of each episode: an observation nobody acted on.

    Returns:
        The columns, the rows that are left if any was dropped, and a note if so.
    """
    empty = [_empty(read[name]) for name in chosen.actions]
    if any(mask is None for mask in empty):
        return read, None, ()
    without = np.logical_and.reduce([mask for mask in empty if mask is not None])
    ends = np.zeros(len(without), dtype=np.bool_)
    ends[-1:] = True
    if chosen.episode is not None:
        episodes = read[chosen.episode].values
        ends[:-1] = episodes[1:] != episodes[:-1]
    if not np.array_equal(without, ends):
        return read, None, ()
    rows = np.flatnonzero(~ends)
    shorter = {name: column.at(rows) for name, column in read.items()}
    return shorter, rows, ("the last row of each episode has no action and was dropped",)


def _without_empty_columns(guess: Guess, read: Mapping[str, TableColumn]) -> Guess:
    """A guess without features that hold nothing, if it is by no name that says they are some."""
    holes = {name: _empty(read[name]) for name in guess.columns.observations}
    empty = {name: "it is empty" for name, hole in holes.items() if hole is not None and hole.all()}
    return guess if guess.prefixed or len(empty) == len(holes) else guess.without(empty)


def _empty(column: TableColumn) -> NDArray[np.bool_] | None:
    """Where a column has no value, None if it has one everywhere."""
    empty = column.missing
    if column.values.dtype.kind == "f":
        nan = np.isnan(column.values)
        empty = nan if empty is None else empty | nan
    return empty if empty is not None and empty.any() else None
