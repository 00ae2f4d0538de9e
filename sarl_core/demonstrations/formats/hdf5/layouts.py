"""HDF5 with an array for each kind of number, as of D4RL, or with a group for each episode."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats.columns import listed
from sarl_core.demonstrations.formats.hdf5.content import Hdf5Content, opened_hdf5
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.npz_file import ARRAY_KEYS, recording_of_arrays
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.formats.sets.file_set import natural_order
from sarl_core.environments.feature_order import numbered
from sarl_core.errors import InputError, quoted
from sarl_core.limits import MAX_FEATURES

_GROUPS = ("data", "episodes", "demos", "trajectories")  # that episodes may stand in
_OF_EPISODES = ("observations", "actions", "rewards", "terminated", "truncated")
_IMAGE_SIDES = 2  # of what has a height and a width
_NUMBERED = re.compile(r"\d")
_LISTED = 5  # entries of a group that a message names
_DEEPEST = 3  # groups in one another that a message looks into


def read_hdf5(data: memoryview) -> Recording:
    """Read an HDF5 file.

    Args:
        data: The whole file.

    Returns:
        What it holds.

    Raises:
        InputError: If it holds neither arrays of observations and actions nor episodes of those,
            or is not as it should be.
    """
    with opened_hdf5(data) as content:
        names = content.names_in(content.root)
        keys = _keys_among(names)
        if "observations" in keys and "actions" in keys:
            return _of_steps(content, keys)
        home, episodes = _home_of_episodes(content, names)
        if episodes:
            return _of_episodes(content, home, episodes)
        known, action = (listed(ARRAY_KEYS[what]) for what in ("observations", "actions"))
        raise InputError(
            f"{_entries(content)}, and nowhere in it are observations (which may be called "
            f"{known}) beside actions ({action}); name them so"
        )


def _home_of_episodes(content: Hdf5Content, names: Collection[str]) -> tuple[Any, list[str]]:
    """The group whose groups are episodes, and their names in their natural order."""
    for name in (*_GROUPS, ""):
        if not name or name in names:
            home = content.entry_of(content.root, name) if name else content.root
            if episodes := _episodes_in(content, home):
                return home, episodes
    groups = {name: content.entry_of(content.root, name) for name in names}
    homes = {name: episodes for name in groups if (episodes := _episodes_in(content, groups[name]))}
    if len(homes) > 1:
        raise InputError(
            f"there are episodes in each of its groups {listed(sorted(homes, key=natural_order))}; "
            "give a file with those of one"
        )
    return next(((groups[name], episodes) for name, episodes in homes.items()), (None, []))


def _episodes_in(content: Hdf5Content, home: Any) -> list[str]:
    if not content.is_group(home):
        return []
    names = sorted(content.names_in(home), key=natural_order)
    return [name for name in names if _is_episode(content, home, name)]


def _entries(content: Hdf5Content) -> str:
    """What stands in a file, and in the first of its groups that holds no other, for a sentence."""
    parts: list[str] = []
    group, place = content.root, ""
    while group is not None and len(parts) < _DEEPEST:
        names = sorted(content.names_in(group), key=natural_order)
        holds = listed(names, _LISTED) or "nothing"
        parts.append(f"{quoted(place) if place else 'it'} holds {holds}")
        inner = {name: content.entry_of(group, name) for name in names[:_LISTED]}
        first = next((name for name in inner if content.is_group(inner[name])), "")
        group, place = inner.get(first), f"{place}/{first}".strip("/")
    return ", ".join(parts)


def _of_steps(content: Hdf5Content, keys: Mapping[str, str]) -> Recording:
    arrays = {
        what: content.array_of(
            content.entry_of(content.root, key), key, room=2, texts=what == "actions"
        )
        for what, key in keys.items()
    }
    return recording_of_arrays(arrays, keys, Metadata())


def _of_episodes(content: Hdf5Content, home: Any, names: list[str]) -> Recording:
    """Episodes one after the other, each with its own arrays."""
    episodes = [_episode(content, content.entry_of(home, name), name) for name in names]
    first = episodes[0]
    for name, episode in zip(names, episodes, strict=True):
        if _shape(episode) != _shape(first):
            raise InputError(
                f"the episode {name!r} holds other things than {names[0]!r}; give episodes of one "
                "task"
            )
    arrays = {
        what: np.concatenate([episode.arrays[what] for episode in episodes])
        for what in first.arrays
    }
    lengths = [len(episode.arrays["actions"]) for episode in episodes]
    keys = dict(first.keys)
    # A single group that is not numbered may hold all episodes, whose ends are marked.
    if len(episodes) > 1 or _NUMBERED.search(names[0]):
        arrays["episodes"] = np.repeat(np.arange(len(episodes)), lengths)
        keys["episodes"] = "episode"
    recording = recording_of_arrays(arrays, keys, Metadata())
    images = listed(dict.fromkeys(key for episode in episodes for key in episode.images))
    notes = (f"the images {images} were not used, as rules cannot read them",) if images else ()
    return replace(recording, feature_names=first.features, notes=notes)


@dataclass(frozen=True)
class _Episode:
    """The arrays of an episode by what they are, the features' names, and what was left out."""

    arrays: Mapping[str, NDArray[Any]]
    keys: Mapping[str, str]
    features: tuple[str, ...]
    images: tuple[str, ...]


def _shape(episode: _Episode) -> tuple[Any, ...]:
    """What is alike in all episodes of a task."""
    actions = episode.arrays["actions"]
    return episode.features, episode.arrays.keys(), actions.shape[1:], actions.dtype.kind in "OU"


def _episode(content: Hdf5Content, group: Any, name: str) -> _Episode:
    names = content.names_in(group)
    if "terminations" in names and "truncations" in names:
        raise InputError(
            "its episodes are Minari's, whose spaces and names stand in a file beside it; give the "
            "folder of the data set, or its ZIP"
        )
    keys = {what: key for what, key in _keys_among(names).items() if what in _OF_EPISODES}
    arrays: dict[str, NDArray[Any]] = {}
    features: tuple[str, ...] = ()
    images: tuple[str, ...] = ()
    for what, key in keys.items():
        entry = content.entry_of(group, key)
        if what == "observations" and content.is_group(entry):
            arrays[what], features, images = _of_group(content, entry, f"{name}/{key}")
        else:
            texts = what == "actions"
            held = content.array_of(entry, f"{name}/{key}", room=2, texts=texts)
            arrays[what] = _by_step(held)
    n = len(arrays["actions"])
    for what, values in arrays.items():
        if len(values) != n and not (what == "observations" and len(values) == n + 1):
            raise InputError(
                f"the episode {name!r} has {len(values):,} {what} for {n:,} actions; give one for "
                "each"
            )
        arrays[what] = values[:n]
    return _Episode(arrays, keys, features or numbered(arrays["observations"].shape[1]), images)


def _keys_among(names: Collection[str]) -> dict[str, str]:
    """The arrays that are known, by what they are, however their names are capitalised."""
    folded = {name.casefold(): name for name in sorted(names, reverse=True)}
    return {
        what: folded[key]
        for what, keys in ARRAY_KEYS.items()
        if (key := next((key for key in keys if key in folded), None)) is not None
    }


def _is_episode(content: Hdf5Content, home: Any, name: str) -> bool:
    entry = content.entry_of(home, name)
    keys = _keys_among(content.names_in(entry)) if content.is_group(entry) else {}
    return "observations" in keys and "actions" in keys


def _by_step(values: NDArray[Any]) -> NDArray[Any]:
    """A row a step."""
    return values.reshape(len(values), -1) if values.ndim else values.reshape(1, 1)


def _of_group(
    content: Hdf5Content, group: Any, place: str
) -> tuple[NDArray[Any], tuple[str, ...], tuple[str, ...]]:
    """The observations of an episode that are several arrays, their names, and those left out."""
    columns: list[NDArray[Any]] = []
    names: list[str] = []
    images: list[str] = []
    # In the order of their names, as there is no other that all programs keep.
    for key in content.names_in(group):
        entry = content.entry_of(group, key)
        if content.is_group(entry) or len(entry.shape) > 1 + _IMAGE_SIDES:
            images.append(key)
            continue
        values = _by_step(content.array_of(entry, f"{place}/{key}", room=2))
        columns.append(values)
        width = values.shape[1]
        names += [key] if width == 1 else [f"{key} {index}" for index in range(width)]
        if len(names) > MAX_FEATURES:
            raise InputError(
                f"there are more than {MAX_FEATURES:,} features in {place!r}; choose fewer"
            )
    lengths = {len(values) for values in columns}
    if len(lengths) != 1:
        raise InputError(
            f"the observations in {place!r} have different lengths; give one of each a step"
        )
    return np.concatenate(columns, axis=1), tuple(names), tuple(images)
