"""Minari: a folder with metadata and episodes in HDF5, Arrow or Parquet.

In the metadata stand the spaces, and the environment. Each episode has one observation more than
actions; in Arrow and Parquet its last row is filled up where there is nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.checks import MAX_LABELS
from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.formats.arrow.parquet_file import open_parquet
from sarl_core.demonstrations.formats.arrow.table import open_arrow
from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.hdf5.content import Hdf5Content, opened_hdf5
from sarl_core.demonstrations.formats.hubs.spaces import (
    DiscreteSpace,
    SpacePart,
    names_of,
    parsed_space,
    parts_of,
)
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.opened_table import Table
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.formats.sets.file_set import FileSet, natural_order
from sarl_core.documents import MisfitError, conformed, parse_json
from sarl_core.environments.description import catalogued
from sarl_core.environments.feature_order import numbered
from sarl_core.environments.naming import entry_name
from sarl_core.errors import InputError, quoted

METADATA = "metadata.json"
MAIN_FILE = "main_data.hdf5"
_EPISODE_FILE = re.compile(r"(?:.*/)?(\d{1,18})/[^/]*\.(?:arrow|parquet)")
_MARKS = ("rewards", "terminations", "truncations")


class _MinariMetadata(msgspec.Struct):
    """What stands in the metadata, which may say more."""

    observation_space: str
    action_space: str
    data_format: str = "hdf5"
    env_spec: str | None = None
    algorithm_name: str | tuple[str, ...] | None = None


def minari_root(files: FileSet) -> str | None:
    """The folder with the metadata and the episodes of a Minari data set.

    Args:
        files: In which it may be.

    Returns:
        The folder, with `/` at its end unless it is ""; None if this is none.

    Raises:
        InputError: If there are several, or it has no metadata.
    """
    root = files.root_of(f"data/{METADATA}")
    if root is not None:
        return f"{root}data/"
    main = next((path for path in files.sizes if path.split("/")[-1] == MAIN_FILE), None)
    episodes = [path for path in files.sizes if _EPISODE_FILE.fullmatch(path)]
    beside = [path for path in episodes if f"{path.rpartition('/')[0]}/{METADATA}" in files.sizes]
    if main is None and not beside:
        return None
    # Of "data/0/part-0.arrow" it is "data/".
    root = main.removesuffix(MAIN_FILE) if main is not None else _above(_above(beside[0]))
    if f"{root}{METADATA}" not in files.sizes:
        raise InputError(
            f"it has the episodes of a Minari data set and not the {METADATA!r} that says what "
            "they hold; give the whole folder of the data set, or its ZIP"
        )
    return root


def _above(path: str) -> str:
    """The folder that something lies in."""
    before, slash, _ = path.rstrip("/").rpartition("/")
    return f"{before}{slash}"


def read_minari(files: FileSet) -> Recording:
    """Read a Minari data set.

    Args:
        files: Those of its folder `data`.

    Returns:
        What it holds, with the names, spaces and environment of its metadata.

    Raises:
        InputError: If it is damaged, or its spaces are no vectors of numbers.
    """
    with naming(METADATA):
        said = _metadata(files.content(METADATA))
        space = parsed_space(said.observation_space, "observations")
        observed = parts_of(space, "observations")
        acted = parts_of(parsed_space(said.action_space, "actions"), "actions")
        metadata = _described(said, names_of(space), acted)
    columns: dict[str, list[NDArray[Any]]] = {}
    lengths: list[int] = []
    for name, episode in _episodes(files, said.data_format, observed, acted):
        with naming(name):
            n = len(episode["rewards"])
            for what, values in episode.items():
                if len(values) not in ((n, n + 1) if what == "observations" else (n,)):
                    raise InputError(
                        f"it has {len(values):,} {what} for {n:,} rewards; save the data set again"
                    )
                columns.setdefault(what, []).append(values[:n])
        lengths.append(n)
    if not sum(lengths):
        raise InputError("there are no steps in it; give a data set with at least two")
    arrays = {what: np.concatenate(parts) for what, parts in columns.items()}
    actions = arrays["actions"]
    single = acted[0].path == () and isinstance(acted[0].space, DiscreteSpace)
    names = tuple(feature.name for feature in metadata.features)
    return Recording(
        observations=arrays["observations"],
        actions=actions[:, 0] if single else actions,
        observation_columns=tuple(f"observation {name!r}" for name in names),
        action_columns=tuple(f"action {name!r}" for name in metadata.action_names),
        episodes=np.repeat(np.arange(len(lengths)), lengths),
        rewards=arrays["rewards"],
        terminated=arrays["terminations"],
        truncated=arrays["truncations"],
        names={
            "reward": "'rewards'",
            "terminated": "'terminations'",
            "truncated": "'truncations'",
        },
        metadata=metadata,
    )


def _metadata(content: memoryview) -> _MinariMetadata:
    try:
        said = conformed(parse_json(bytes(content)), _MinariMetadata)
    except InputError:
        raise
    except ValueError as error:
        misfit = f"is not as it should be ({error})"
        what = misfit if isinstance(error, MisfitError) else "is no JSON"
        raise InputError(f"it {what}; save the data set again with Minari") from error
    if said.data_format not in ("hdf5", "arrow", "parquet"):
        raise InputError(
            f"its episodes are in the format {quoted(said.data_format)}, which is not read; save "
            "the data set as hdf5 or arrow"
        )
    return said


def _described(
    said: _MinariMetadata, names: tuple[str, ...], acted: tuple[SpacePart, ...]
) -> Metadata:
    """What the file says besides: names by the keys of its spaces, else by its environment."""
    kinds = {bool(part.counts) for part in acted}
    if len(kinds) > 1:
        raise InputError(
            "some of its actions are labels and some are not, and rules are mined of one kind; "
            "choose a data set with one"
        )
    discrete = kinds == {True}
    m = sum(part.width for part in acted)
    env_id = _environment(said.env_spec)
    known = catalogued(env_id, len(names), m, discrete=discrete)
    features = known.features
    if names != numbered(len(names)):
        features = tuple((name, "") for name in names)
    actions = known.actions
    if acted[0].path:
        actions = tuple(
            part.name if part.width == 1 else entry_name(part.name, index)
            for part in acted
            for index in range(part.width)
        )
    counts = [n for part in acted for n in part.counts]
    first = tuple(start for part in acted for start in part.starts) if discrete else ()
    many = next((n for n in counts if n > MAX_LABELS), None)
    if many is not None:
        raise InputError(
            f"it has {many:,} different actions, more than the {MAX_LABELS:,} labels that rules "
            "can have; choose a data set with fewer"
        )
    bounds = [] if discrete else [part.bounds() for part in acted]
    agent = said.algorithm_name or ""
    return Metadata(
        env_id=env_id,
        agent=agent if isinstance(agent, str) else ", ".join(agent),
        features=tuple(Feature(name, unit) for name, unit in features),
        action_names=actions,
        label_names=tuple(
            known.labels[index]
            if index < len(known.labels) and len(known.labels[index]) == n
            else tuple(str(first[index] + label) for label in range(n))
            for index, n in enumerate(counts)
        ),
        label_first=first,
        action_low=tuple(value for low, _ in bounds for value in low),
        action_high=tuple(value for _, high in bounds for value in high),
        bounds_from=None if discrete else "action space",
    )


def _environment(spec: str | None) -> str:
    """The environment's id, "" where it says none; nothing is made of it here."""
    try:
        said = parse_json(spec or "{}", finite=False)
    except InputError:
        raise
    except ValueError:
        return ""
    env_id = said.get("id") if isinstance(said, dict) else None
    return env_id if isinstance(env_id, str) else ""


def _episodes(
    files: FileSet, data_format: str, observed: tuple[SpacePart, ...], acted: tuple[SpacePart, ...]
) -> Iterator[tuple[str, dict[str, NDArray[Any]]]]:
    """Name and arrays of each episode, in the order of their numbers."""
    if data_format == "hdf5":
        with naming(MAIN_FILE), opened_hdf5(files.content(MAIN_FILE)) as content:
            names = [name for name in content.names_in(content.root) if name.startswith("episode_")]
            for name in sorted(names, key=natural_order):
                group = content.entry_of(content.root, name)
                yield name, _of_group(content, group, name, observed, acted)
        return
    paths = [path for path in files.sizes if _EPISODE_FILE.fullmatch(path)]
    contents = files.contents(paths)
    for path in paths:
        with naming(path):
            table = (open_parquet if path.endswith(".parquet") else open_arrow)(contents.pop(path))
            yield path, _of_table(table, observed, acted)


def _of_group(
    content: Hdf5Content,
    group: Any,
    name: str,
    observed: tuple[SpacePart, ...],
    acted: tuple[SpacePart, ...],
) -> dict[str, NDArray[Any]]:
    """The arrays of an episode in HDF5."""

    def values_at(*path: str) -> NDArray[Any]:
        entry, place = group, name
        for key in path:
            entry = content.entry_of(entry, key) if content.is_group(entry) else None
            place = f"{place}/{key}"
            if entry is None:
                raise InputError(f"there is no {quoted(place)} in it; save the data set again")
        values = content.array_of(entry, place, room=2)
        return values.reshape(1) if values.ndim == 0 else values

    def keys(part: SpacePart) -> list[str]:
        return [key if isinstance(key, str) else f"_index_{key}" for key in part.path]

    seen = [part.flattened(values_at("observations", *keys(part))) for part in observed]
    done = [_rows(part, values_at("actions", *keys(part))) for part in acted]
    return {
        "observations": _side_by_side(seen),
        "actions": _side_by_side(done),
        **{what: values_at(what).reshape(-1) for what in _MARKS},
    }


def _of_table(
    table: Table, observed: tuple[SpacePart, ...], acted: tuple[SpacePart, ...]
) -> dict[str, NDArray[Any]]:
    """The arrays of an episode in Arrow or Parquet."""
    seen = [(part, _columns("observations", part)) for part in observed]
    done = [(part, _columns("actions", part)) for part in acted]
    wanted = [*(column for _, columns in (*seen, *done) for column in columns), *_MARKS]
    missing = next((column for column in wanted if column not in table.names), None)
    if missing is not None:
        raise InputError(f"there is no {missing!r} in it; save the data set again")
    read = table.read(ColumnMap((), tuple(wanted)))

    def values_of(columns: list[str]) -> NDArray[Any]:
        return np.stack([read[column].values for column in columns], axis=1)

    return {
        "observations": _side_by_side(
            [part.flattened(values_of(columns)) for part, columns in seen]
        ),
        "actions": _side_by_side([_rows(part, values_of(columns)) for part, columns in done])[:-1],
        **{what: read[what].values[:-1] for what in _MARKS},
    }


def _columns(what: str, part: SpacePart) -> list[str]:
    """Where the numbers of a space stand in a table."""
    column = ".".join((what, *map(str, part.path)))
    if isinstance(part.space, DiscreteSpace):
        return [column]
    return [f"{column}_{index}" for index in range(part.width)]


def _rows(part: SpacePart, values: NDArray[Any]) -> NDArray[Any]:
    rows = values.reshape(len(values), -1)
    if rows.shape[1] != part.width:
        raise InputError(
            f"{part.name or 'an action'} has {rows.shape[1]:,} numbers, and its space "
            f"{part.width:,}; save the data set again"
        )
    return rows


def _side_by_side(parts: list[NDArray[Any]]) -> NDArray[Any]:
    lengths = {len(part) for part in parts}
    if len(lengths) > 1:
        raise InputError("its parts have different lengths; save the data set again")
    return np.concatenate(parts, axis=1)
