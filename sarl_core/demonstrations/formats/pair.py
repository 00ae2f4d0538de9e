"""The paper's own pair of files: `obs.csv` and `actions.csv`, row for row, without a header."""

from __future__ import annotations

import re
from pathlib import Path

from sarl_core.demonstrations.formats.columns import (
    ColumnMap,
    action_names,
    feature_names,
)
from sarl_core.demonstrations.formats.csv_file import open_csv
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.formats.tables import (
    action_block,
    observation_block,
    require_filled,
)
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


def pair_in_folder(folder: Path) -> tuple[Path, Path]:
    """The pair of files in a folder.

    Args:
        folder: To look into.

    Returns:
        Paths of the observations and of the actions.

    Raises:
        InputError: If there is no pair, or more than one.
    """
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    pairs = [
        (folder / name, folder / other)
        for name in names
        if not holds_actions(name)
        for other in partner_names(name)
        if other in names
    ]
    if not pairs:
        raise InputError(
            "it is a folder without obs.csv and actions.csv; give a file, or a folder with those"
        )
    if len(pairs) > 1:
        raise InputError(
            f"it is a folder with {len(pairs)} pairs of observations and actions; "
            "give one of the files"
        )
    return pairs[0]


def read_pair(observations: memoryview, actions: memoryview, names: tuple[str, str]) -> Recording:
    """Read a pair of files.

    Args:
        observations: The whole file of the observations.
        actions: The whole file of the actions.
        names: What the two are called in messages.

    Returns:
        What they hold.

    Raises:
        InputError: If one of them cannot be read; the message begins with its name.
    """
    with naming(names[0]):
        table = open_csv(observations)
        read = table.read(ColumnMap(table.names, ()))
        require_filled(read)
        seen = observation_block(read, table.names)
    with naming(names[1]):
        others = open_csv(actions, like=table)
        read = others.read(ColumnMap((), others.names))
        require_filled(read)
        done = action_block(read, others.names)
    return Recording(
        observations=seen,
        actions=done,
        observation_columns=tuple(f"{column!r} of {names[0]}" for column in table.names),
        action_columns=tuple(f"{column!r} of {names[1]}" for column in others.names),
        feature_names=feature_names(table.names) if table.named else None,
        action_names=action_names(others.names) if others.named else None,
    )


def _word(name: str, words: tuple[str, ...]) -> re.Match[str] | None:
    """Where one of the words stands at an end of a CSV file's name, or between separators."""
    return re.search(rf"(?:^|[_\-. ])({'|'.join(words)})(?=[_\-. ])(?=.*\.csv$)", name, re.I)
