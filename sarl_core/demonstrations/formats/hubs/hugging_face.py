"""Folders as Hugging Face's `datasets` saves them: Arrow streams, and a file that lists them.

In imitation's, each row is an episode: `obs` has one observation more than `acts` has actions, and
`infos` are texts, which are left alone. Others have one row a step, or one an episode under other
names.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.formats.arrow.table import arrow_table, table_of_stream
from sarl_core.demonstrations.formats.metadata import Metadata
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.npz_file import ARRAY_KEYS, recording_of_arrays
from sarl_core.demonstrations.formats.parquet_file import refusing_damage
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.formats.sets.file_set import FileSet
from sarl_core.demonstrations.formats.tables import Table
from sarl_core.documents import parse_json
from sarl_core.errors import InputError, quoted
from sarl_core.limits import require_memory

STATE = "state.json"
INFO = "dataset_info.json"
_SPLITS = "dataset_dict.json"
_WIDEST = 8  # bytes of a number


def hugging_face_root(files: FileSet) -> str | None:
    """The folder of a data set that was saved to a disk.

    Args:
        files: In which it may be.

    Returns:
        The folder, with `/` at its end unless it is ""; None if this is none.

    Raises:
        InputError: If there are several, as the parts of a set for training and for tests.
    """
    root = files.root_of(STATE)
    return root if root is not None and f"{root}{INFO}" in files.sizes else None


def open_hugging_face(files: FileSet) -> Table | Recording:
    """Open a data set that was saved to a disk.

    Args:
        files: Those of its folder.

    Returns:
        A table with a row a step; a recording where each row is an episode.

    Raises:
        InputError: If it is damaged, or a file of it is missing.
    """
    import pyarrow as pa

    paths = _listed(files.content(STATE))
    contents = files.contents(paths)
    tables = []
    for path in paths:
        with naming(path):
            tables.append(table_of_stream(contents.pop(path)))
    try:
        table = pa.concat_tables(tables)
    except pa.ArrowException as error:
        raise InputError("its files have different columns; save the data set again") from error
    return recording_of_rows(table) or arrow_table(table)


def recording_of_rows(table: Any) -> Recording | None:
    """What a table holds of which each row is an episode.

    Args:
        table: A ``pyarrow.Table`` that has been validated.

    Returns:
        The recording; None if it is no such table.

    Raises:
        InputError: If an episode has other lengths than it should.
    """
    keys = {
        what: key
        for what, names in ARRAY_KEYS.items()
        if (key := next((name for name in names if name in table.column_names), None)) is not None
    }
    if "observations" not in keys or "actions" not in keys or not table.num_rows:
        return None
    kinds = {what: table.schema.field(key).type for what, key in keys.items()}
    if not (_is_list(kinds["observations"]) and _is_list(kinds["actions"])):
        return None
    if not _is_list(kinds["observations"].value_type):
        return None
    with refusing_damage():
        return _of_episodes(table, keys, kinds)


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


def _listed(content: memoryview) -> list[str]:
    """The files with the rows, in their order."""
    with naming(STATE):
        try:
            said = parse_json(bytes(content))
        except InputError:
            raise
        except ValueError as error:
            raise InputError(f"it is no JSON ({error}); save the data set again") from error
        entries = said.get("_data_files") if isinstance(said, dict) else None
        names = (
            [entry.get("filename") if isinstance(entry, dict) else None for entry in entries or ()]
            if isinstance(entries, list)
            else []
        )
        if not names or not all(isinstance(name, str) for name in names):
            raise InputError("it lists no files; save the data set again")
        if len(set(names)) < len(names):
            raise InputError("it lists a file twice; save the data set again")
        return [str(name) for name in names]
