"""NPZ without pickle: our own, and the layouts in which expert demonstrations circulate.

Known are the ones of imitation (``obs, acts, indices, terminal, rews``: `indices` are the rows of
`acts` at which the next trajectory starts, and `obs` has one row more for each trajectory), of
Stable-Baselines (``obs, actions, rewards, episode_returns, episode_starts``) and of D4RL
(``observations, actions, rewards, terminals, timeouts``).
"""

from __future__ import annotations

import io
import lzma
import struct
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.columns import listed
from sarl_core.demonstrations.formats.limits import MAX_UNPACKED, too_large
from sarl_core.demonstrations.formats.metadata import (
    KEY,
    Metadata,
    decode_metadata,
    encode_metadata,
)
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.errors import InputError

_KEYS = {
    "observations": ("observations", "obs", "observation", "states", "state"),
    "actions": ("actions", "acts", "action", "act"),
    "episodes": ("episodes", "episode", "episode_ids", "episode_id"),
    "steps": ("steps", "step", "timesteps"),
    "rewards": ("rewards", "rews", "reward", "rew"),
    "terminated": ("terminated", "terminals", "terminal", "terminations", "dones", "done"),
    "truncated": ("truncated", "timeouts", "timeout", "truncations"),
    "indices": ("indices",),
    "starts": ("episode_starts",),
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
    observations, actions = arrays["observations"], arrays["actions"]
    if observations.ndim == 1:
        observations = observations[:, None]
    if observations.ndim != 2:
        shape = "x".join(map(str, observations.shape[1:]))
        raise InputError(
            f"the observations under {keys['observations']!r} have the shape {shape}, as images "
            "do, which rules cannot read; give one vector of features a step"
        )
    if actions.ndim == 0:
        raise InputError(f"there is a single number under {keys['actions']!r}; give one a step")
    if actions.dtype.kind == "b":
        raise InputError(
            f"the actions under {keys['actions']!r} are true and false; write them as "
            "whole numbers 1 and 0"
        )
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
    episodes, terminated = _episodes(arrays, len(actions))
    return Recording(
        observations=observations,
        actions=actions,
        observation_columns=_columns(keys["observations"], d, metadata),
        action_columns=(f"the action under {keys['actions']!r}",)
        if m == 1
        else tuple(f"column {index} of {keys['actions']!r}" for index in range(m)),
        episodes=episodes,
        steps=_one_a_step(arrays.get("steps")),
        rewards=_one_a_step(arrays.get("rewards")),
        terminated=terminated,
        truncated=_one_a_step(arrays.get("truncated")),
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
        )
        if (values := getattr(demonstrations, name)) is not None
    }
    np.savez_compressed(
        out, allow_pickle=False, **arrays, **{KEY: np.array(encode_metadata(demonstrations))}
    )


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
        if terminated is not None and len(terminated) == len(indices) + 1 != n:
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
    try:
        # BytesIO copies nothing that is already bytes.
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = {
                info.filename.removesuffix(".npy"): info
                for info in archive.infolist()
                if info.filename.endswith(".npy")
            }
            wanted = {
                what: key
                for what, keys in _KEYS.items()
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
            promised = sum(entries[key].file_size for key in wanted.values())
            if promised > MAX_UNPACKED:
                raise too_large(promised)
            read: dict[str, NDArray[Any]] = {}
            for what, key in wanted.items():
                left = MAX_UNPACKED - sum(array.nbytes for array in read.values())
                read[what] = _array(archive, entries[key], key, left)
            return read, wanted
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        OSError,
        NotImplementedError,
        RuntimeError,
        ValueError,
        struct.error,
        OverflowError,
        lzma.LZMAError,
    ) as error:
        # All of these come from zipfile: RuntimeError for an encrypted entry, ValueError for
        # offsets that lie outside the file.
        raise InputError(
            "it is damaged, cut off or encrypted; save or download it again"
        ) from error


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, key: str, limit: int) -> NDArray[Any]:
    """One array of the archive, of no more bytes than a limit whatever the archive promises."""
    with archive.open(entry) as file:
        content = file.read(min(entry.file_size, limit) + 1)
    if len(content) > limit or len(content) > entry.file_size:
        raise too_large(len(content))
    try:
        header = io.BytesIO(content)
        version = np.lib.format.read_magic(header)
        read = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, _, dtype = read(header)
        if dtype.hasobject:
            raise InputError(
                f"the array {key!r} holds Python objects (a pickle), which may run code and are "
                "never opened; save plain numbers"
            )
        # Before anything is made of that size: the content must be there.
        promised = int(np.prod(shape, dtype=object)) * dtype.itemsize
        if promised != len(content) - header.tell():
            raise InputError(f"the array {key!r} is cut off or damaged; save it again")
        array: NDArray[Any] = np.load(io.BytesIO(content), allow_pickle=False)
    except (ValueError, EOFError, SyntaxError, TypeError, MemoryError) as error:
        raise InputError(f"the array {key!r} cannot be read as NumPy's; save it again") from error
    if key != KEY and array.dtype.kind not in "biuf":
        raise InputError(
            f"the array {key!r} holds {array.dtype}, which are no numbers; save plain numbers"
        )
    return array
