"""Tables, one row a step: what Parquet and CSV have in common."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.column_values import resolved, settle
from sarl_core.demonstrations.formats.columns import (
    ColumnMap,
    Guess,
    action_names,
    check_map,
    feature_names,
    guess_notes,
    guess_roles,
    listed,
    refuse_doubled,
    require_clear,
    unclear_columns,
)
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.requirements import coarse_columns, crowded, flags
from sarl_core.environments.description import EnvironmentDescription
from sarl_core.errors import InputError, quoted

MAX_COLUMNS = 4096
MAX_NAME = 300  # characters of a column's name; a person has to read it in every rule
_OWN_SINGLES = ("episode", "step", "reward", "terminated", "truncated")


class Table(Protocol):
    """A file with named columns, opened and not yet read."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns."""

    @property
    def named(self) -> bool:
        """Whether those names stand in the file."""

    @property
    def metadata(self) -> Metadata:
        """What the file says besides."""

    def read(self, columns: ColumnMap) -> dict[str, TableColumn]:
        """Numbers of the columns that a map uses."""


@dataclass(frozen=True)
class TableColumn:
    """Numbers of one column.

    Attributes:
        values: Shape (N,), bool, integers or floats; NaN or 0 where missing.
        missing: Shape (N,), where the column is empty, or None if it is nowhere.
    """

    values: NDArray[Any]
    missing: NDArray[np.bool_] | None = None


def as_float32(column: TableColumn) -> TableColumn:
    """A column in the numbers that rules compare."""
    with np.errstate(over="ignore", invalid="ignore"):  # found as infinite
        return TableColumn(column.values.astype(np.float32, copy=False), column.missing)


def check_names(names: Sequence[str]) -> None:
    """Refuse a table with too many columns, a name nobody can read, or two of one name."""
    if len(names) > MAX_COLUMNS:
        raise InputError(
            f"there are {len(names):,} columns, more than the {MAX_COLUMNS:,} that rules a person "
            "reads could use; keep fewer"
        )
    long = next((name for name in names if len(name) > MAX_NAME), None)
    if long is not None:
        raise InputError(
            f"the column {quoted(long)} has a name of {len(long):,} characters; give it one of "
            f"{MAX_NAME} at most"
        )
    refuse_doubled(names)


def recording_from_table(
    table: Table, columns: ColumnMap | None, description: EnvironmentDescription | None
) -> Recording:
    """Read the columns of a table that are needed.

    Args:
        table: The opened file.
        columns: Which columns hold what; None to go by their names.
        description: The environment, if known; it tells a table without names apart.

    Returns:
        What the table holds.

    Raises:
        InputError: If roles are unclear, a column is missing, or a value is no number.
    """
    metadata = table.metadata
    guessed = False
    notes: tuple[str, ...] = ()
    if columns is not None:
        guess = given(columns, "as it was mapped")
        metadata = _without_names(metadata)
    elif metadata.features and metadata.action_names:
        guess = given(_own_columns(table.names, metadata), "the file itself says so")
    elif not table.named:
        guess, notes = _unnamed(table.names, description)
    else:
        guess, guessed = guess_roles(table.names), True
        if guess.unclear:
            guess = resolved(guess, numbers_of(table, guess.unclear), table.names)
        require_clear(guess, table.names)
    check_map(guess.columns, table.names)
    read, rows, dropped = _without_empty_ends(table.read(guess.columns), guess.columns)
    if guessed:
        guess = settle(guess, {name: column.values for name, column in read.items()})
        notes = guess_notes(guess)
    chosen = guess.columns
    read = {name: read[name] for name in chosen.used}
    require_filled(read, rows)
    single = {role: read[name].values for role, name in chosen.singles.items()}
    fields, marked = episode_fields(single, chosen)
    named = columns is not None or table.named
    observations = observation_block(read, chosen.observations)
    coarse = coarse_notes(table, chosen.observations, observations, rows)
    return Recording(
        observations=observations,
        actions=action_block(read, chosen.actions),
        observation_columns=tuple(f"column {name!r}" for name in chosen.observations),
        action_columns=tuple(f"column {name!r}" for name in chosen.actions),
        feature_names=chosen.feature_names
        or (names_of_features(guess, table.named) if named else None),
        action_names=chosen.action_names or (action_names(chosen.actions) if named else None),
        **fields,
        rows=rows,
        guess_labels=not _is_vector(chosen.actions),
        names={role: f"column {name!r}" for role, name in chosen.singles.items()},
        metadata=metadata,
        notes=(*notes, *marked, *dropped, *coarse),
        columns=guess.uses(table.names),
    )


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
    """What the features are called; a word that all names begin with says nothing."""
    columns = guess.columns.observations
    return feature_names(columns) if guess.prefixed or not named else columns


def numbers_of(table: Table, names: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """Values of columns that may hold anything."""
    try:
        read = table.read(ColumnMap((), names))
    except InputError:
        raise unclear_columns(names, table.names) from None
    return {name: column.values for name, column in read.items()}


def require_filled(read: Mapping[str, TableColumn], rows: NDArray[np.int64] | None = None) -> None:
    """Refuse an empty field.

    Args:
        read: The columns by name.
        rows: The rows they had in the file, from 0; None if they are those.

    Raises:
        InputError: With the column and its first empty row.
    """
    for name, column in read.items():
        if column.missing is not None and column.missing.any():
            row = int(np.argmax(column.missing))
            number = row if rows is None else int(rows[row])
            raise InputError(
                f"column {name!r} is empty in row {number + 1}; mend or remove that row"
            )


def observation_block(read: Mapping[str, TableColumn], names: Sequence[str]) -> NDArray[np.float32]:
    """Columns side by side, shape (N, d)."""
    observations = np.empty((len(read[names[0]].values), len(names)), dtype=np.float32)
    with np.errstate(over="ignore", invalid="ignore"):  # found as infinite
        for index, name in enumerate(names):
            observations[:, index] = read[name].values
    return observations


def coarse_notes(
    table: Table,
    names: Sequence[str],
    observations: NDArray[np.float32],
    rows: NDArray[np.int64] | None = None,
) -> tuple[str, ...]:
    """Sentences on features whose values are too close to one another for float32.

    Args:
        table: The opened file; a few of its columns are read again, with all their digits.
        names: Columns of the d features.
        observations: What was read of them, (N, d).
        rows: Shape (N,), their rows in the file, from 0; None if they are all.

    Returns:
        One sentence for each of them.
    """
    suspects = np.flatnonzero(crowded(observations)).tolist()
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


def action_block(read: Mapping[str, TableColumn], names: Sequence[str]) -> NDArray[Any]:
    """Actions of shape (N,), or (N, m) where the columns' names say that they are vectors."""
    columns = [read[name].values for name in names]
    for name, values in zip(names, columns, strict=True):
        if values.dtype.kind == "b":
            raise InputError(
                f"column {name!r} holds true and false, which are no actions; write "
                "them as whole numbers 1 and 0"
            )
    return np.stack(columns, axis=1) if _is_vector(names) else columns[0]


def columns_of(demonstrations: Demonstrations) -> dict[str, NDArray[Any]]:
    """The columns in which demonstrations are saved, in order."""
    assert demonstrations.steps is not None
    columns: dict[str, NDArray[Any]] = {
        "episode": demonstrations.episodes,
        "step": demonstrations.steps,
    }
    for feature, values in zip(demonstrations.features, demonstrations.observations.T, strict=True):
        columns[f"obs_{feature.name}"] = np.ascontiguousarray(values)
    if demonstrations.actions.ndim == 1:
        columns["action"] = demonstrations.actions
    else:
        for dimension, values in zip(
            demonstrations.action_dimensions, demonstrations.action_columns.T, strict=True
        ):
            columns[f"action_{dimension.name}"] = np.ascontiguousarray(values)
    singles = {
        "reward": demonstrations.rewards,
        "terminated": demonstrations.terminated,
        "truncated": demonstrations.truncated,
    }
    return columns | {name: values for name, values in singles.items() if values is not None}


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


def _is_vector(actions: Sequence[str]) -> bool:
    """Whether the names say that an action is a vector, if only of one number."""
    return len(actions) > 1 or bool(actions[0].startswith("action_"))


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
    shorter = {
        name: TableColumn(
            column.values[rows], None if column.missing is None else column.missing[rows]
        )
        for name, column in read.items()
    }
    return shorter, rows, ("the last row of each episode has no action and was dropped",)


def _empty(column: TableColumn) -> NDArray[np.bool_] | None:
    """Where a column has no value, None if it has one everywhere."""
    empty = column.missing
    if column.values.dtype.kind == "f":
        nan = np.isnan(column.values)
        empty = nan if empty is None else empty | nan
    return empty if empty is not None and empty.any() else None
