"""LeRobot, versions 2 and 3: Parquet files, and what their columns are in `meta/info.json`."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import msgspec

from sarl_core.demonstrations.formats.arrow.parquet_file import ParquetTable
from sarl_core.demonstrations.formats.columns import ColumnMap, listed
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.opened_table import Table, check_names
from sarl_core.demonstrations.formats.sets.file_set import FileSet
from sarl_core.demonstrations.formats.sets.table_set import TableSet, open_tables
from sarl_core.documents import Count, MisfitError, conformed, parse_json
from sarl_core.errors import InputError, quoted
from sarl_core.limits import MAX_FEATURES

INFO = "meta/info.json"
_VERSIONS = ("v2.0", "v2.1", "v3.0")
_PICTURES = ("video", "image")
_ROLES = {
    "episode": "episode_index",
    "step": "frame_index",
    "reward": "next.reward",
    "last": "next.done",
    "time": "timestamp",
}


class _LeRobotField(msgspec.Struct):
    """One entry of `features`."""

    dtype: str
    shape: tuple[Count, ...] = ()
    names: Any = None


class _LeRobotInfo(msgspec.Struct):
    """What stands in `meta/info.json`, which says more."""

    codebase_version: str
    features: dict[str, _LeRobotField]


def open_lerobot(files: FileSet) -> tuple[Table, ColumnMap, tuple[str, ...]]:
    """Open a LeRobot data set.

    Args:
        files: Those of its folder.

    Returns:
        Its steps as one table, what its columns are, and notes.

    Raises:
        InputError: If its version is not known, or it is not as it should be.
    """
    with naming(INFO):
        info = _info(files.content(INFO))
        pictures = [name for name, one in info.features.items() if one.dtype in _PICTURES]
    data = files.below("data/")
    parquet = {path: size for path, size in data.sizes.items() if path.endswith(".parquet")}
    if not parquet:
        raise InputError(
            "there are no Parquet files in its folder 'data'; download the whole data set"
        )
    table, notes = open_tables(replace(data, sizes=parquet))
    numbers = {
        name: one for name, one in info.features.items() if one.dtype not in (*_PICTURES, "string")
    }
    observed = _columns(numbers, "observation", table)
    acted = _columns(numbers, "action", table)
    for what, columns in (("observation", observed), ("action", acted)):
        if not columns:
            raise InputError(
                f"there is no {what!r} of numbers among the features of its {INFO!r}, "
                f"{listed(info.features)}; choose a data set with one"
            )
    roles = {role: name for role, name in _ROLES.items() if name in table.names}
    # Whoever maps columns sees the names, and not the places in vectors.
    named = {
        column: column if column in numbers else f"{word}.{name}"
        for word, columns in (("observation", observed), ("action", acted))
        for column, name in columns.items()
    }
    chosen = replace(
        ColumnMap.of_roles([named[one] for one in observed], [named[one] for one in acted], roles),
        feature_names=tuple(observed.values()),
        action_names=tuple(acted.values()),
    )
    table = _renamed(table, named)
    check_names(table.names)
    if pictures:
        notes += (f"the pictures {listed(pictures)} were not used, as rules cannot read them",)
    return table, chosen, notes


def _renamed(table: Table, names: Mapping[str, str]) -> Table:
    """The same table with other names for some of its columns."""
    if isinstance(table, TableSet):
        return replace(table, tables=tuple(_renamed(one, names) for one in table.tables))
    assert isinstance(table, ParquetTable)
    leaves = {names.get(name, name): leaf for name, leaf in table.leaves.items()}
    return replace(table, leaves=leaves)


def _info(content: memoryview) -> _LeRobotInfo:
    try:
        document = parse_json(bytes(content), finite=False)
        version = document.get("codebase_version") if isinstance(document, dict) else None
        if isinstance(version, str) and version not in _VERSIONS:
            raise InputError(
                f"the data set is of LeRobot's version {quoted(version)}, and this program reads "
                f"{', '.join(_VERSIONS)}; convert it with LeRobot"
            )
        return conformed(document, _LeRobotInfo)
    except InputError:
        raise
    except ValueError as error:
        misfit = f"is not as it should be ({error})"
        what = misfit if isinstance(error, MisfitError) else "is no JSON"
        raise InputError(f"it {what}; save the data set again with LeRobot") from error


def _columns(fields: Mapping[str, _LeRobotField], word: str, table: Table) -> dict[str, str]:
    """What features or actions are called, by the columns that they stand in.

    Args:
        fields: Of numbers.
        word: That the keys of the wanted ones begin with.
        table: In which the columns are.
    """
    named = [
        (name.removeprefix(f"{word}."), column, label)
        for name, field in fields.items()
        if name == word or name.startswith(f"{word}.")
        for column, label in _named(name, field, word, table)
    ]
    counts = Counter(label for _, _, label in named)
    # Two vectors may have the same names in them; the vector's own tells them apart.
    return {
        column: label if counts[label] == 1 else f"{vector} {label}"
        for vector, column, label in named
    }


def _named(name: str, field: _LeRobotField, word: str, table: Table) -> Iterator[tuple[str, str]]:
    """The columns of a vector, and what its numbers are called."""
    size = math.prod(field.shape)
    if size > MAX_FEATURES:
        raise InputError(
            f"its {name!r} has {size:,} numbers, more than rules a person reads could use; choose "
            "a data set with fewer"
        )
    columns = [name]  # a vector of one number is often none
    if name not in table.names:
        columns = [
            "_".join((name, *map(str, place)))
            for place in itertools.product(*map(range, field.shape))
        ]
    missing = next((column for column in columns if column not in table.names), None)
    if missing is not None:
        raise InputError(
            f"its {INFO!r} speaks of {missing!r}, and its files have {listed(table.names)}; "
            "download the data set again"
        )
    labels = _labels(field.names)
    if len(labels) != len(columns) or len(set(labels)) < len(labels):
        short = name.removeprefix(f"{word}.")
        alone = len(columns) == 1
        labels = [short if alone else f"{short} {index}" for index in range(len(columns))]
    return zip(columns, labels, strict=True)


def _labels(names: Any) -> list[str]:
    """The names of a vector's numbers: a list, one under a key, or places by name."""
    if isinstance(names, str):
        return [names]
    if isinstance(names, dict):
        if names and all(type(place) is int for place in names.values()):
            return sorted(names, key=names.__getitem__)
        names = list(names.values())
    if isinstance(names, list):
        return [label for inner in names for label in _labels(inner)]
    return []
