"""The paper's own pair of files: `obs.csv` and `actions.csv`, row for row, without a header."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import PurePath, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats.column_values import (
    counters,
    numbers_episodes,
    resolved,
    same_column,
    settle,
)
from sarl_core.demonstrations.formats.columns import (
    ColumnMap,
    Guess,
    action_names,
    guess_notes,
    guess_roles,
    listed,
    require_clear,
)
from sarl_core.demonstrations.formats.mapping.roles import settled_by
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.observation_blocks import observation_block
from sarl_core.demonstrations.formats.opened_table import Table, TableColumn
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.formats.tables import (
    action_block,
    coarse_notes,
    episode_fields,
    given,
    is_vector,
    label_words,
    missing_block,
    names_of_features,
    numbers_of,
    require_filled,
    require_numbers,
    units_of,
    without_times,
)
from sarl_core.demonstrations.formats.texts.csv_file import CsvTable, open_csv
from sarl_core.demonstrations.formats.times import with_seconds
from sarl_core.demonstrations.formats.vocabulary import is_perhaps_action, plain
from sarl_core.environments.description import EnvironmentDescription
from sarl_core.errors import InputError

_OBSERVATIONS = ("obs", "observations", "observation", "states")
_ACTIONS = ("actions", "acts", "action")


def partner_names(name: str) -> tuple[str, ...]:
    """What the other file of a pair may be called.

    Args:
        name: As "obs.csv", "obs_train.csv", "cartpole-actions.csv".

    Returns:
        The names to look for, () if the name does not belong to a pair.
    """
    for words, others in ((_OBSERVATIONS, _ACTIONS), (_ACTIONS, _OBSERVATIONS)):
        match = _word(name, words)
        if match is not None:
            return tuple(
                f"{name[: match.start(1)]}{other}{name[match.end(1) :]}" for other in others
            )
    return ()


def holds_actions(name: str) -> bool:
    """Whether a file's name says that it is the half of a pair with the actions."""
    return _word(name, _OBSERVATIONS) is None and _word(name, _ACTIONS) is not None


def pair_among(paths: Iterable[str]) -> tuple[str, str] | None:
    """The pair of files among several.

    Args:
        paths: Of all of them, with `/` between folders.

    Returns:
        The observations and the actions; None if there is no pair.

    Raises:
        InputError: If there is more than one.
    """
    names = set(paths)
    pairs = [
        (path, other)
        for path in sorted(names)
        if not holds_actions(PurePath(path).name)
        for partner in partner_names(PurePath(path).name)
        if (other := PurePosixPath(path).with_name(partner).as_posix()) in names
    ]
    if len(pairs) > 1:
        raise InputError(
            f"it is a folder with {len(pairs)} pairs of observations and actions; "
            "give one of the files"
        )
    return pairs[0] if pairs else None


def is_complete(
    content: memoryview, name: str, partner: str, description: EnvironmentDescription | None
) -> bool:
    """Whether a file that is called like half of a pair holds observations and actions itself.

    Args:
        content: The whole file.
        name: What it is called; tells which half it would be.
        partner: What the other half would be called, for messages.
        description: The environment, if known; it tells a table without names apart.

    Returns:
        True if the names of its columns say so, or their number.

    Raises:
        InputError: If it cannot be opened, or its columns' names leave it in doubt.
    """
    table = open_csv(content)
    if not table.named:
        return fits(table, description)
    return bool(_own_observations(table) if holds_actions(name) else _own_actions(table, partner))


def fits(table: Table, description: EnvironmentDescription | None) -> bool:
    """Whether a table without a header can be told apart by the environment's spaces."""
    return description is not None and len(table.names) == len(description.feature_names) + len(
        description.action_names
    )


def read_pair(observations: memoryview, actions: memoryview, names: tuple[str, str]) -> Recording:
    """Read a pair of files.

    Args:
        observations: The whole file of the observations.
        actions: The whole file of the actions.
        names: What the two are called in messages.

    Returns:
        What they hold.

    Raises:
        InputError: If one of them cannot be read, the message begins with its name; if one holds
            what the other is for; or if both say something else of the episodes.
    """
    short = PurePath(names[0]).name, PurePath(names[1]).name
    with naming(names[0]):
        table = open_csv(observations)
        own = _own_actions(table, short[1])
        if own:
            raise InputError(
                f"it has actions of its own ({listed(own)}), so those of {short[1]!r} are not "
                "joined to it; give it alone, or take its actions out"
            )
    with naming(names[1]):
        others = open_csv(actions)
        own = _own_observations(others)
        if own:
            raise InputError(
                f"it has observations of its own ({listed(own)}), so it is not joined to "
                f"{short[0]!r}; give it alone, or take its observations out"
            )
        if not others.named or len(others.names) == 1:  # it may have no delimiter to go by
            others = open_csv(actions, like=table)
    with naming(names[0]):
        seen = _observations_of(table)
        features = seen.guess.columns.observations
        called = names_of_features(seen.guess, table.named) if table.named else None
        block = observation_block(seen.read, features, called)
        coarse = coarse_notes(table, block)
    with naming(names[1]):
        taken = _actions_of(others)
        chosen = taken.guess.columns.actions
        done = action_block(taken.read, chosen, is_vector(chosen, taken.read))
    with naming(names[0]):
        _require_half(table, seen, taken, short[1], "observations")
    with naming(names[1]):
        _require_half(others, taken, seen, short[0], "actions")
    observed, fields, notes = _together(block.values, done, (seen, taken), names)
    dimensions = taken.guess.columns.actions
    return Recording(
        observations=observed,
        actions=done,
        observation_columns=tuple(f"{column!r} of {names[0]}" for column in block.columns),
        action_columns=tuple(f"{column!r} of {names[1]}" for column in dimensions),
        feature_names=block.names,
        indicators=block.indicators,
        action_words=label_words(taken.read, dimensions),
        feature_units=units_of(block.columns, {}, table.metadata.column_units),
        missing_actions=missing_block(taken.read, dimensions),
        action_names=action_names(dimensions) if others.named else None,
        **fields,
        guess_labels=done.ndim == 1,
        metadata=Metadata(),
        names={
            role: f"column {name!r} of {file}"
            for half, file in zip((seen, taken), names, strict=True)
            for role, name in half.guess.columns.singles.items()
        },
        notes=(*notes, *coarse),
        columns=tuple(
            replace(use, column=f"{use.column} ({file})")
            for half, one, file in ((seen, table, short[0]), (taken, others, short[1]))
            for use in half.guess.uses(one.names)
        ),
    )


def pair_note(names: tuple[str, str]) -> str:
    """The note on a pair that was joined.

    Args:
        names: Of the observations and of the actions.

    Returns:
        A sentence with both names.
    """
    seen, done = (PurePath(name).name for name in names)
    return f"the observations are those of {seen!r}, and the actions those of {done!r}"


def alone_note(name: str, partner: str) -> str:
    """The note on a file that was read without the one beside it.

    Args:
        name: Of the file.
        partner: Of the one that its name would go with.

    Returns:
        A sentence with both names.
    """
    return f"{partner!r} was not read, as {name!r} has observations and actions itself"


@dataclass(frozen=True)
class _Half:
    """What one file of a pair holds."""

    guess: Guess
    read: dict[str, TableColumn]
    notes: tuple[str, ...]


def _observations_of(table: CsvTable) -> _Half:
    """Read the file of the observations."""
    if not table.named:
        return _whole(table, ColumnMap(table.names, ()))
    guess = guess_roles(table.names)
    if guess.unclear:
        guess = resolved(guess, numbers_of(table, guess.unclear), table.names)
    require_clear(guess, table.names, actions=False)
    guess, read, numbered = without_times(guess, table.read(guess.columns))
    words = {name for name, column in read.items() if column.words}
    guess = settle(guess, {name: column.values for name, column in read.items()}, words)
    guess, read = with_seconds(guess, read, table.metadata.column_units)
    read = {name: read[name] for name in guess.columns.used}
    _require_marks(read, guess.columns)
    return _Half(guess, read, (*guess_notes(guess), *numbered))


def _actions_of(table: CsvTable) -> _Half:
    """Read the file of the actions: every column that is nothing else is one."""
    if not table.named:
        return _whole(table, ColumnMap((), table.names))
    guess = guess_roles(table.names)
    others = (*guess.columns.observations, *guess.unclear)
    held = {
        name: column.values
        for name, column in table.read(ColumnMap((), others)).items()
        if not column.words
    }
    guess = guess.as_actions(counters(held))
    if not guess.columns.actions:
        require_clear(guess, table.names)
    guess, read, numbered = without_times(guess, table.read(guess.columns))
    guess, read = with_seconds(guess, read, table.metadata.column_units)
    _require_marks(read, guess.columns)
    return _Half(guess, read, numbered)


def _require_marks(read: dict[str, TableColumn], columns: ColumnMap) -> None:
    """Refuse what numbers or ends episodes and is empty or no number."""
    singles = columns.singles.values()
    require_filled({name: read[name] for name in singles}, reward=columns.reward)
    require_numbers(read, singles)


def _whole(table: CsvTable, columns: ColumnMap) -> _Half:
    """Read a file without names."""
    read = table.read(columns)
    return _Half(given(columns, "there is no header, and this is what the file is for"), read, ())


def _together(
    observed: NDArray[np.float32],
    done: NDArray[Any],
    halves: tuple[_Half, _Half],
    names: tuple[str, str],
) -> tuple[NDArray[np.float32], dict[str, NDArray[Any]], tuple[str, ...]]:
    """Observations for the actions, and what both files say of the episodes."""
    columns = [half.guess.columns for half in halves]
    single = [
        {role: half.read[name].with_gaps for role, name in half.guess.columns.singles.items()}
        for half in halves
    ]
    notes = (*halves[0].notes, *halves[1].notes)
    if len(observed) != len(done) and "episode" in single[0]:
        episodes = single[0]["episode"]
        followed = np.append(episodes[1:] == episodes[:-1], False)
        if np.count_nonzero(followed) == len(done):
            observed = observed[followed]
            single[0] = {role: values[followed] for role, values in single[0].items()}
            notes = (*notes, "the last observation of each episode has no action and was dropped")
    if "time" in single[0]:  # the time of an action may be a little later
        single[1].pop("time", None)
    for role in single[0].keys() & single[1].keys():
        first, second = single[0][role], single[1][role]
        if len(first) == len(second) and not np.array_equal(first, second):
            row = int(np.argmax(first != second)) + 1
            raise InputError(
                f"{names[0]} with {names[1]}: the column {getattr(columns[0], role)!r} of the one "
                f"and {getattr(columns[1], role)!r} of the other differ in row {row}; give files "
                "of the same steps"
            )
    merged = single[1] | {
        role: values for role, values in single[0].items() if len(values) == len(done)
    }
    roles = {role: getattr(columns[0], role) or getattr(columns[1], role) for role in merged}
    fields, marked = episode_fields(merged, ColumnMap.of_roles((), (), roles))
    return observed, fields, (*notes, *marked)


def _own_actions(table: CsvTable, partner: str) -> tuple[str, ...]:
    """Columns of a file of observations that hold actions."""
    if not table.named:
        return ()
    columns = guess_roles(table.names).columns
    actions = columns.actions
    doubtful = [name for name in table.names if is_perhaps_action(name)]
    # Numbers of episodes, or rewards, make it complete with an action.
    complete = bool(columns.singles) and [plain(name) for name in actions] != ["a"]
    if doubtful and (not actions or (set(actions) <= set(doubtful) and not complete)):
        raise InputError(
            f"it is unclear whether {listed(doubtful)} is its action or {partner!r} beside it "
            f"holds the actions; {settled_by(doubtful[0], 'action', 'feature')}"
        )
    return actions


def _own_observations(table: CsvTable) -> tuple[str, ...]:
    """Columns of a file of actions that hold observations."""
    guess = guess_roles(table.names)
    if not table.named or not guess.columns.actions or not guess.columns.observations:
        return ()
    read = table.read(ColumnMap((), guess.columns.observations))
    numbers = {name: column.values for name, column in read.items() if not column.words}
    counted = counters(numbers)
    return tuple(name for name in guess.columns.observations if name not in counted)


def _require_half(table: CsvTable, half: _Half, other: _Half, partner: str, what: str) -> None:
    """Refuse a file without names that holds more than its half of a pair, where that shows."""
    if table.named or len(table.names) == 1:
        return
    copies = [
        next((name for name, held in half.read.items() if same_column(held.values, column)), None)
        for column in (column.values for column in other.read.values())
    ]
    held = [name for name in copies if name is not None]
    surplus = f"{listed(held)} {'holds' if len(held) == 1 else 'hold'} what {partner!r} holds"
    if len(held) < len(copies):
        held = [name for name, column in half.read.items() if numbers_episodes(column.values)]
        surplus = f"{listed(held)} {'numbers' if len(held) == 1 else 'number'} the episodes"
    if held:
        raise InputError(
            f"it has no header, and its {surplus}, so it holds more than {what}; write a header "
            "that says what its columns are (as obs_0, ..., action, episode), or keep the "
            f"{what} alone"
        )


def _word(name: str, words: tuple[str, ...]) -> re.Match[str] | None:
    """Where one of the words stands at an end of a CSV file's name, or between separators."""
    return re.search(rf"(?:^|[_\-. ])({'|'.join(words)})(?=[_\-. ])(?=.*\.csv$)", name, re.I)
