"""Tables of which each row is an episode, with lists of its observations and actions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats.arrow.parquet_file import refusing_damage
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.npz_file import ARRAY_KEYS, recording_of_arrays
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.errors import InputError, quoted
from sarl_core.limits import require_memory

_WIDEST = 8  # bytes of a number


def recording_of_rows(table: Any, *, certain: bool = False) -> Recording | None:
    """What a table holds of which each row is an episode.

    Args:
        table: A ``pyarrow.Table`` that has been validated.
        certain: Whether a list of lists can be nothing but an episode. Else it may be the table
            that was seen in one step, and lengths tell.

    Returns:
        The recording; None if it is no such table.

    Raises:
        InputError: If an episode has other lengths than it should.
    """
    keys = keys_of_rows(table.schema)
    if keys is None or not table.num_rows:
        return None
    kinds = {what: table.schema.field(key).type for what, key in keys.items()}
    with refusing_damage():
        if not certain and not _fit_episodes(table, keys, kinds):
            return None
        return _of_episodes(table, keys, kinds)


def keys_of_rows(schema: Any) -> dict[str, str] | None:
    """The columns of episodes by what they are, as far as types say.

    Args:
        schema: A ``pyarrow.Schema``.

    Returns:
        Them; None if its rows cannot be episodes.
    """
    keys = {
        what: key
        for what, names in ARRAY_KEYS.items()
        if (key := next((name for name in names if name in schema.names), None)) is not None
    }
    if "observations" not in keys or "actions" not in keys:
        return None
    observed, acted = (schema.field(keys[what]).type for what in ("observations", "actions"))
    lists = _is_list(observed) and _is_list(acted) and _is_list(observed.value_type)
    return keys if lists else None


def _fit_episodes(table: Any, keys: Mapping[str, str], kinds: Mapping[str, Any]) -> bool:
    """Whether lists are as long as those of episodes, and not by chance."""
    import pyarrow.compute as pc

    lengths = {
        what: np.asarray(pc.fill_null(pc.list_value_length(table.column(keys[what])), 0).to_numpy())
        for what in ("observations", "actions", "rewards", "terminated", "truncated")
        if what in keys and _is_list(kinds[what])
    }
    more = lengths["observations"] - lengths["actions"]
    marked = len(lengths) > 2 or bool(np.ptp(lengths["actions"]))
    return marked and bool(np.all(more == 0) or np.all(more == 1))


def _of_episodes(table: Any, keys: Mapping[str, str], kinds: Mapping[str, Any]) -> Recording:
    arrays: dict[str, NDArray[Any]] = {}
    lengths: dict[str, NDArray[np.int64]] = {}
    taken = table.nbytes
    for what, key in keys.items():
        if what in ("observations", "actions") or _is_list(kinds[what]):
            with naming(f"column {key!r}"):
                arrays[what], lengths[what] = _joined(table.column(key), taken)
                taken += arrays[what].nbytes
    n = lengths["actions"]
    for what, own in lengths.items():
        more = own - n
        longer = what == "observations" and bool(np.all(more == 1))
        if not longer and np.any(more != 0):
            row = int(np.argmax(more != 0))
            raise InputError(
                f"row {row + 1} has {own[row]:,} {what} for {n[row]:,} actions; give one for each"
            )
        if longer:
            arrays[what] = np.delete(arrays[what], np.cumsum(own) - 1, axis=0)
    ends = np.cumsum(n) - 1
    if "terminated" in keys and "terminated" not in arrays:  # one for the whole episode
        values = np.asarray(table.column(keys["terminated"]).to_numpy())
        if values.dtype.kind in "biuf" and np.all(n > 0):
            arrays["terminated"] = np.zeros(int(n.sum()), dtype=values.dtype)
            arrays["terminated"][ends] = values
    arrays["episodes"] = np.repeat(np.arange(len(n)), n)
    for role in ("steps", "indices", "starts"):
        arrays.pop(role, None)
    named = {what: keys.get(what, what) for what in arrays}
    return recording_of_arrays(arrays, named, Metadata())


def _joined(column: Any, taken: int) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """The values of lists one after the other, (sum of lengths, ...), and the lengths, (rows,)."""
    import pyarrow.compute as pc

    if column.null_count:
        raise InputError("it is empty in a row; mend or remove that row")
    lengths = np.asarray(pc.list_value_length(column).to_numpy()).astype(np.int64)
    values = pc.list_flatten(column)
    shape: list[int] = []
    while _is_list(values.type):
        if values.null_count:
            raise InputError("it has an empty entry; mend or remove that row")
        sizes = pc.unique(pc.list_value_length(values)).to_pylist()
        if len(sizes) > 1:
            raise InputError("its lists have different lengths; give each step as many numbers")
        shape += sizes or [0]
        values = pc.list_flatten(values)
    require_memory(taken + 2 * _WIDEST * len(values))
    if values.null_count:
        raise InputError("it has an empty entry; mend or remove that row")
    numbers = np.asarray(values.to_numpy())
    if numbers.dtype.kind not in "biuf":
        raise InputError(f"it holds {quoted(str(values.type))}, which are no numbers; save numbers")
    return numbers.reshape(int(lengths.sum()), *shape), lengths


def _is_list(kind: Any) -> bool:
    import pyarrow as pa

    return bool(
        pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)
    )
