"""NPZ without pickle: our own, and the layouts in which expert demonstrations circulate.

Known are the ones of imitation (``obs, acts, indices, terminal, rews``: `indices` are the rows of
`acts` at which the next trajectory starts, and `obs` has one row more for each trajectory), of
Stable-Baselines (``obs, actions, rewards, episode_returns, episode_starts``) and of D4RL
(``observations, actions, rewards, terminals, timeouts``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from sarl_core.archives import Promise, array_of, arrays_in, opened, promise_of
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.fields import ColumnUse
from sarl_core.demonstrations.formats.columns import listed
from sarl_core.demonstrations.formats.mapping.roles import ROLE_WORDS
from sarl_core.demonstrations.formats.metadata import (
    KEY,
    Metadata,
    decode_metadata,
    encode_metadata,
)
from sarl_core.demonstrations.formats.opened_table import MAX_COLUMNS
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.words import coded
from sarl_core.errors import InputError
from sarl_core.limits import require_memory, table_memory

ARRAY_KEYS = {
    "observations": ("observations", "obs", "observation", "states", "state"),
    "actions": ("actions", "acts", "action", "act", "controls", "control"),
    "episodes": ("episodes", "episode", "episode_ids", "episode_id"),
    "steps": ("steps", "step", "timesteps"),
    "rewards": ("rewards", "rews", "reward", "rew"),
    "terminated": ("terminated", "terminals", "terminal", "terminations", "dones", "done"),
    "truncated": ("truncated", "timeouts", "timeout", "truncations"),
    "times": ("times",),
    "indices": ("indices",),
    "starts": ("episode_starts",),
}
_USES = {
    "observations": "features",
    "actions": "actions",
    "episodes": ROLE_WORDS["episode"],
    "steps": ROLE_WORDS["step"],
    "rewards": "reward",
    "terminated": ROLE_WORDS["terminated"],
    "truncated": ROLE_WORDS["truncated"],
    "times": ROLE_WORDS["time"],
    "indices": "rows at which episodes begin",
    "starts": ROLE_WORDS["first"],
}


def read_npz(data: memoryview) -> Recording:
    """Read the arrays of a NPZ file; what is pickled in it is never opened.

    Args:
        data: The whole file.

    Returns:
        What it holds.

    Raises:
        InputError: If it is damaged, unpacks to too much, holds Python objects where numbers
            should be, or lacks observations or actions.
    """
    arrays, keys = _arrays(data)
    metadata = Metadata()
    if KEY in arrays:
        stored = arrays.pop(KEY)
        if stored.dtype.kind != "U" or stored.ndim != 0:
            raise InputError(f"its metadata {KEY!r} is not text; save the file again, or without")
        metadata = decode_metadata(str(stored))
    return recording_of_arrays(arrays, keys, metadata)


def recording_of_arrays(
    arrays: Mapping[str, NDArray[Any]], keys: Mapping[str, str], metadata: Metadata
) -> Recording:
    """What arrays hold that have a row, or an entry, for each step.

    Args:
        arrays: By what they are, as "observations"; those and "actions" at least.
        keys: The names they stand under, by what they are.
        metadata: What the file says besides.

    Returns:
        The recording.

    Raises:
        InputError: If their shapes do not fit what they are.
    """
    observations, actions = arrays["observations"], arrays["actions"]
    if observations.ndim == 1:
        observations = observations[:, None]
    if observations.ndim == 3 and actions.shape[:2] == observations.shape[:2]:
        raise InputError(
            f"the observations under {keys['observations']!r} are episodes side by side, of shape "
            f"{'x'.join(map(str, observations.shape))}; put all steps one below the other, (steps, "
            "features), and give the number of each step's episode under 'episodes'"
        )
    if observations.ndim != 2:
        shape = "x".join(map(str, observations.shape[1:]))
        raise InputError(
            f"the observations under {keys['observations']!r} have the shape {shape}, as images "
            "do, which rules cannot read; give one vector of features a step"
        )
    if actions.ndim == 0:
        raise InputError(f"there is a single number under {keys['actions']!r}; give one a step")
    # One label wrapped in a vector, as some libraries write it; our own files mean it so.
    if actions.ndim > 2:
        actions = actions.reshape(len(actions), int(np.prod(actions.shape[1:])))
    if actions.ndim == 2 and actions.shape[1] == 1 and metadata.is_discrete is None:
        actions = actions[:, 0]
    d, m = observations.shape[1], 1 if actions.ndim == 1 else actions.shape[1]
    if metadata.features and len(metadata.features) != d:
        raise InputError(
            f"its metadata names {len(metadata.features)} features, but there are {d} "
            f"columns under {keys['observations']!r}; save the file again"
        )
    if metadata.action_names and len(metadata.action_names) != m:
        raise InputError(
            f"its metadata names {len(metadata.action_names)} action dimensions, but "
            f"there are {m} columns under {keys['actions']!r}; save the file again"
        )
    actions, words = _labels(actions)
    episodes, terminated = _episodes(arrays, len(actions))
    times = _one_a_step(arrays.get("times"))
    return Recording(
        observations=observations,
        actions=actions,
        observation_columns=_columns(keys["observations"], d, metadata),
        action_columns=(f"the action under {keys['actions']!r}",)
        if m == 1
        else tuple(f"column {index} of {keys['actions']!r}" for index in range(m)),
        action_words=words,
        episodes=episodes,
        steps=_one_a_step(arrays.get("steps")),
        rewards=_one_a_step(arrays.get("rewards")),
        terminated=terminated,
        truncated=_one_a_step(arrays.get("truncated")),
        times=times if times is not None and times.shape == (len(actions),) else None,
        names={
            role: f"the array {keys[key]!r}"
            for role, key in (
                ("episode", "episodes"),
                ("step", "steps"),
                ("reward", "rewards"),
                ("terminated", "terminated"),
                ("truncated", "truncated"),
            )
            if key in keys
        },
        metadata=metadata,
        columns=tuple(
            ColumnUse(key, _USES[what], "the array's name says so")
            for what, key in keys.items()
            if what in _USES
        ),
    )


def write_npz(demonstrations: Demonstrations, out: BinaryIO) -> None:
    """Write demonstrations with all that is known about them.

    Args:
        demonstrations: To write.
        out: Where to.
    """
    arrays: dict[str, NDArray[Any]] = {
        name: values
        for name in (
            "observations",
            "actions",
            "episodes",
            "steps",
            "rewards",
            "terminated",
            "truncated",
            "times",
        )
        if (values := getattr(demonstrations, name)) is not None
    }
    # What is derived from them is worked out again where they are read.
    arrays["observations"] = demonstrations.raw_observations
    np.savez_compressed(
        out, allow_pickle=False, **arrays, **{KEY: np.array(encode_metadata(demonstrations))}
    )


def _labels(actions: NDArray[Any]) -> tuple[NDArray[Any], tuple[tuple[str, ...], ...]]:
    """Actions that are words, or true and false, as numbers, and what those stand for."""
    if actions.dtype.kind not in "bUO":
        return actions, ()
    columns = [coded(column) for column in actions.reshape(len(actions), -1).T]
    codes = np.stack([column.codes for column in columns if column is not None], axis=1)
    if (codes < 0).any():
        row = int(np.argmax((codes < 0).any(axis=1)))
        raise InputError(f"the action in row {row + 1} is an empty text; mend or remove that row")
    words = tuple(column.words for column in columns if column is not None)
    return codes.reshape(actions.shape), words


def _columns(key: str, d: int, metadata: Metadata) -> tuple[str, ...]:
    names = [feature.name for feature in metadata.features]
    return tuple(
        f"observation {names[index]!r}" if names else f"column {index} of {key!r}"
        for index in range(d)
    )


def _one_a_step(values: NDArray[Any] | None) -> NDArray[Any] | None:
    """A column of numbers, unwrapped where each is a vector of one."""
    if values is not None and values.ndim == 2 and values.shape[1] == 1:
        return values[:, 0]
    return values


def _episodes(
    arrays: Mapping[str, NDArray[Any]], n: int
) -> tuple[NDArray[Any] | None, NDArray[Any] | None]:
    """Numbers of the episodes and where they were terminated, as the layout has it."""
    terminated = _one_a_step(arrays.get("terminated"))
    starts = None
    if "episodes" in arrays:
        return _one_a_step(arrays["episodes"]), terminated
    if "indices" in arrays:
        indices = arrays["indices"]
        inside = (
            indices.ndim == 1
            and indices.dtype.kind in "iu"
            and bool(
                np.all((indices > 0) & (indices < n))
                and np.all(np.diff(indices.astype(np.int64)) > 0)
            )
        )
        if not inside:
            raise InputError(
                "the array 'indices' must hold the rising rows at which the second "
                f"and later episodes start among {n:,} actions"
            )
        starts = np.zeros(n, dtype=np.bool_)
        starts[indices] = True
        if terminated is not None and terminated.shape == (len(indices) + 1,) != (n,):
            by_step = np.zeros(n, dtype=terminated.dtype)
            by_step[np.append(indices, n).astype(np.int64) - 1] = terminated
            terminated = by_step
    elif "starts" in arrays:
        given = _one_a_step(arrays["starts"])
        assert given is not None
        if given.shape != (n,) or not np.isin(given, (0, 1)).all():
            raise InputError(
                f"the array 'episode_starts' must say true or false for each of {n:,} actions"
            )
        starts = given.astype(np.bool_)
        starts[:1] = False
    return (None if starts is None else np.cumsum(starts)), terminated


def _arrays(data: memoryview) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """The arrays that are known, by what they are, and the keys they stand under."""
    with opened(data) as archive:
        entries = arrays_in(archive)
        wanted = {
            what: key
            for what, keys in ARRAY_KEYS.items()
            if (key := next((key for key in keys if key in entries), None)) is not None
        }
        for what in ("observations", "actions"):
            if what not in wanted:
                raise InputError(
                    f"there are no {what} among its arrays {listed(sorted(entries))}; save "
                    f"them under {what!r}"
                )
        if KEY in entries:
            wanted[KEY] = KEY
        require_memory(len(data) + sum(entries[key].file_size for key in wanted.values()))
        promises = {what: promise_of(archive, entries[key]) for what, key in wanted.items()}
        for what, promise in promises.items():
            kinds = "biufU" if what == "actions" else "biuf"
            if what != KEY and promise.dtype.kind not in kinds:
                raise InputError(
                    f"the array {wanted[what]!r} holds {promise.dtype}, which are no numbers; "
                    "save plain numbers"
                )
        _require_width(promises, wanted)
        rows = math.prod(promises["actions"].shape[:1])
        numbers = sum(map(_needed, promises, promises.values()))
        require_memory(len(data) + table_memory(rows, 0, 0) + numbers)
        read = {
            what: array_of(archive, entries[key], promises[what]) for what, key in wanted.items()
        }
        return read, wanted


def _require_width(promises: Mapping[str, Promise], keys: Mapping[str, str]) -> None:
    """Refuse far too many columns before each of them gets a name."""
    for what, promise in promises.items():
        width = math.prod(promise.shape[1:])
        if what in ("observations", "actions") and promise.shape[0:1] and width > MAX_COLUMNS:
            noun = "features" if what == "observations" else "action dimensions"
            raise InputError(
                f"there are {width:,} {noun} under {keys[what]!r}, more than the {MAX_COLUMNS:,} "
                "that rules a person reads could use; choose fewer columns"
            )


def _needed(what: str, promise: Promise) -> int:
    """Bytes of an array as it is in the file, and of what it becomes: half of the peak."""
    itemsize = {"observations": 4, KEY: 0}.get(what, 8)
    return math.prod(promise.shape) * max(promise.dtype.itemsize, itemsize)
