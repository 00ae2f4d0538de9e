"""One way in and one way out: the file's extension chooses the format."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import BinaryIO

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.csv_file import open_csv, write_csv
from sarl_core.demonstrations.formats.naming import naming, naming_both
from sarl_core.demonstrations.formats.npz_file import read_npz, write_npz
from sarl_core.demonstrations.formats.pair import (
    alone_note,
    fits,
    holds_actions,
    is_complete,
    pair_in_folder,
    pair_note,
    partner_names,
    read_pair,
)
from sarl_core.demonstrations.formats.parquet_file import MAGIC, open_parquet, write_parquet
from sarl_core.demonstrations.formats.recording import Recording, to_demonstrations
from sarl_core.demonstrations.formats.tables import Table, recording_from_table
from sarl_core.environments.description import EnvironmentDescription, describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, require
from sarl_core.files import as_path, whole_file
from sarl_core.limits import limited_bytes

Content = bytes | bytearray | memoryview | BinaryIO


@dataclass(frozen=True)
class FileFormat:
    """How files of one extension are read and written.

    Attributes:
        kind: What such a file is, in words.
        write: Writes demonstrations.
        open_table: Opens a file with named columns; None where there are none.
        read: Reads a file without; None where there is `open_table`.
    """

    kind: str
    write: Callable[[Demonstrations, BinaryIO], None]
    open_table: Callable[[memoryview], Table] | None = None
    read: Callable[[memoryview], Recording] | None = None


_FORMATS = {
    ".parquet": FileFormat("Parquet", write_parquet, open_table=open_parquet),
    ".csv": FileFormat("CSV", write_csv, open_table=open_csv),
    ".npz": FileFormat("NPZ", write_npz, read=read_npz),
}
EXTENSIONS = tuple(_FORMATS)

# How a file begins, what that makes it, and the extension it should have then.
_SIGNATURES = (
    (MAGIC, "Parquet", ".parquet"),
    (b"PK\x03\x04", "a ZIP archive", ".npz"),
    (b"PK\x05\x06", "a ZIP archive", ".npz"),
    (b"\x93NUMPY", "a single NumPy array", None),
    (b"\x89HDF", "HDF5", None),
    (b"\x1f\x8b", "compressed with gzip", None),
    (b"ARROW1", "Arrow", None),
    (b"\x80\x02", "a pickle, which may run code and is never opened", None),
    (b"\x80\x03", "a pickle, which may run code and is never opened", None),
    (b"\x80\x04", "a pickle, which may run code and is never opened", None),
    (b"\x80\x05", "a pickle, which may run code and is never opened", None),
)


def load_demonstrations(
    path: str | Path, *, env_id: EnvironmentOrId | None = None, columns: ColumnMap | None = None
) -> Demonstrations:
    """Load demonstrations from a file, or from the paper's pair of files.

    Args:
        path: A .parquet, .csv or .npz file; `obs.csv` with `actions.csv` beside it; or a folder
            with those two.
        env_id: Environment to take spaces, names and bounds from where the file has none.
        columns: Which columns of a table hold what; None to go by their names.

    Returns:
        The demonstrations; their `notes` say what had to be guessed.

    Raises:
        InputError: If the file cannot be used: one sentence with file, column and first row.
    """
    if columns is not None:
        must = "the map of columns must be a ColumnMap"
        require(columns, ColumnMap, must, "make one, of sarl_core.demonstrations.formats")
    description = describe_environment(env_id) if env_id else None
    path = as_path(path)
    with naming(str(path)):
        if path.is_dir():
            pair = pair_in_folder(path)
        elif not path.exists():
            raise InputError("there is no such file; check its name")
        else:
            names = partner_names(path.name) if columns is None else ()
            partner = next(
                (path.with_name(name) for name in names if path.with_name(name).is_file()), None
            )
            if partner is None:
                return _read(_content(path), path.name, description, columns)
            content = _content(path)
            _check_signature(content, path.name)
            if is_complete(content, path.name, partner.name, description):
                alone = _read(content, path.name, description, columns)
                return _noted(alone, alone_note(path.name, partner.name))
            pair = (partner, path) if holds_actions(path.name) else (path, partner)
        contents = _content(pair[0]), _content(pair[1])
    return _read_pair(contents, (str(pair[0]), str(pair[1])), description)


def read_demonstrations(
    data: Content,
    name: str,
    *,
    env_id: EnvironmentOrId | None = None,
    columns: ColumnMap | None = None,
    companion: tuple[Content, str] | None = None,
) -> Demonstrations:
    """Read demonstrations from what was uploaded.

    Args:
        data: Content of the file, or an open binary file.
        name: Its name; the extension chooses the format.
        env_id: As for `load_demonstrations`.
        columns: As for `load_demonstrations`.
        companion: Content and name of the other file of a pair, observations or actions.

    Returns:
        The demonstrations.

    Raises:
        InputError: As `load_demonstrations`.
    """
    description = describe_environment(env_id) if env_id else None
    with naming(name):
        content = _bytes(data)
    if companion is None:
        return _read_named(content, name, description, columns)
    other, other_name = companion
    with naming(other_name):
        other_content = _bytes(other)
    if columns is not None:
        raise InputError(
            f"{name}: columns are mapped in one table, not in a pair of files; give one of the two"
        )
    if holds_actions(name) and not holds_actions(other_name):
        return _read_pair((other_content, content), (other_name, name), description)
    return _read_pair((content, other_content), (name, other_name), description)


def save_demonstrations(demonstrations: Demonstrations, path: str | Path) -> None:
    """Save demonstrations; the path is either written whole or left as it was.

    Args:
        demonstrations: To save.
        path: With the extension .parquet or .npz, which keep everything, or .csv, which keeps the
            columns alone.

    Raises:
        InputError: If the extension is unknown or the path cannot be written.
    """
    must = "what is saved must be Demonstrations"
    require(demonstrations, Demonstrations, must, "call save_demonstrations(demonstrations, path)")
    path = as_path(path)
    with naming(str(path)):
        form = _format(path.name)
        if path.is_dir():
            raise InputError("it is a folder; give a file in it")
        with whole_file(path) as unfinished, unfinished.open("xb") as out:
            form.write(demonstrations, out)


def table_columns(source: str | Path | Content, name: str | None = None) -> tuple[str, ...]:
    """Columns of a tabular file, for a person to map.

    Args:
        source: A path, or the content of a file.
        name: The file's name, needed with content.

    Returns:
        Names of the columns, "column 1"... for CSV without a header; () for a file without
        columns (.npz).

    Raises:
        InputError: If the file cannot be opened.
    """
    if isinstance(source, (str, Path)):
        path = Path(source)
        name = name or str(path)
        with naming(name):
            content = _content(path)
    else:
        name = name or "the file"
        with naming(name):
            content = _bytes(source)
    with naming(name):
        form = _format(name)
        _check_signature(content, name)
        return form.open_table(content).names if form.open_table is not None else ()


def _read_named(
    content: memoryview,
    name: str,
    description: EnvironmentDescription | None,
    columns: ColumnMap | None,
) -> Demonstrations:
    with naming(name):
        return _read(content, name, description, columns)


def _read(
    content: memoryview,
    name: str,
    description: EnvironmentDescription | None,
    columns: ColumnMap | None,
) -> Demonstrations:
    form = _format(name)
    _check_signature(content, name)
    if form.open_table is None:
        assert form.read is not None
        if columns is not None:
            raise InputError(
                f"columns are mapped in a table, and {form.kind} has none; leave the map out"
            )
        return to_demonstrations(form.read(content), description)
    table = form.open_table(content)
    partners = partner_names(PurePath(name).name)
    if partners and not table.named and columns is None and not fits(table, description):
        halves = ("observations", "actions")
        own = holds_actions(PurePath(name).name)
        raise InputError(
            f"it has no header, so it holds the {halves[own]} of a pair alone; give "
            f"{partners[0]!r} with the {halves[not own]} too"
        )
    return to_demonstrations(recording_from_table(table, columns, description), description)


def _read_pair(
    contents: tuple[memoryview, memoryview],
    names: tuple[str, str],
    description: EnvironmentDescription | None,
) -> Demonstrations:
    with naming_both(names):
        for content, name in zip(contents, names, strict=True):
            with naming(name):
                if PurePath(name).suffix.lower() != ".csv":
                    raise InputError(
                        "a pair of observations and actions is two .csv files; give those"
                    )
                _check_signature(content, name)
        recording = read_pair(*contents, names)
        with naming(f"{names[0]} with {names[1]}"):
            return _noted(to_demonstrations(recording, description), pair_note(names))


def _noted(demonstrations: Demonstrations, note: str) -> Demonstrations:
    return replace(demonstrations, notes=(*demonstrations.notes, note))


def _format(name: str) -> FileFormat:
    extension = PurePath(name).suffix.lower()
    if extension not in _FORMATS:
        says = f"ends in {extension!r}" if extension else "has no extension"
        raise InputError(f"it {says}, which is none of {', '.join(EXTENSIONS)}; convert it")
    return _FORMATS[extension]


def _check_signature(content: memoryview, name: str) -> None:
    """Refuse a file whose content is not what its extension says."""
    extension = PurePath(name).suffix.lower()
    kind = _FORMATS[extension].kind
    if len(content) == 0:
        raise InputError("it is empty (0 bytes); save or download it again")
    signature = next(
        (entry for entry in _SIGNATURES if bytes(content[:6]).startswith(entry[0])), None
    )
    if signature is not None and signature[2] != extension:
        _, what, right = signature
        cure = f"name it {right}" if right is not None else f"save it as {EXTENSIONS[0]} or {kind}"
        raise InputError(f"it is named {extension}, but its content is {what}; {cure}")
    if signature is None and extension != ".csv":
        raise InputError(
            f"it is named {extension}, but its content is not {kind}; if it is text, name it .csv"
        )


def _content(path: Path) -> memoryview:
    if path.is_dir():
        raise InputError("it is a folder; give a file")
    try:
        return memoryview(limited_bytes(path))
    except FileNotFoundError as error:
        raise InputError("there is no such file; check its name") from error
    except OSError as error:
        raise InputError(f"it cannot be read ({error.strerror}); check its permissions") from error


def _bytes(data: Content) -> memoryview:
    if isinstance(data, (bytes, bytearray, memoryview)):
        return memoryview(data).cast("B")
    if data.seekable():
        data.seek(0)
    return memoryview(data.read())
