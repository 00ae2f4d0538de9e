"""One way in and one way out: names and contents of files choose the format."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePath
from typing import BinaryIO

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats.arrow.parquet_file import ParquetTable, whole_table
from sarl_core.demonstrations.formats.arrow.table import ArrowTable
from sarl_core.demonstrations.formats.columns import ColumnMap, Columns, stated
from sarl_core.demonstrations.formats.hubs.hub import OpenedTable, open_hub
from sarl_core.demonstrations.formats.hubs.minari import MAIN_FILE, METADATA
from sarl_core.demonstrations.formats.kinds import (
    FORMATS,
    WRITTEN,
    ZIP,
    extension_of,
    format_of,
    unpacked,
)
from sarl_core.demonstrations.formats.mapping.preview import ColumnPreview, previewed
from sarl_core.demonstrations.formats.mapping.roles import Roles
from sarl_core.demonstrations.formats.missing import Missing
from sarl_core.demonstrations.formats.naming import naming, naming_both
from sarl_core.demonstrations.formats.opened_table import Table
from sarl_core.demonstrations.formats.pair import (
    alone_note,
    fits,
    holds_actions,
    is_complete,
    pair_among,
    pair_note,
    partner_names,
    read_pair,
)
from sarl_core.demonstrations.formats.recording import Recording, to_demonstrations
from sarl_core.demonstrations.formats.sets.episode_rows import keys_of_rows, recording_of_rows
from sarl_core.demonstrations.formats.sets.file_set import (
    FileSet,
    files_at,
    files_given,
    files_in_archive,
    files_in_folder,
)
from sarl_core.demonstrations.formats.sets.table_set import open_tables
from sarl_core.demonstrations.formats.tables import recording_from_table
from sarl_core.environments.description import EnvironmentDescription, describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError, require
from sarl_core.files import as_path, whole_file
from sarl_core.limits import limited_bytes

Content = bytes | bytearray | memoryview | BinaryIO
Source = str | Path | Content | list[tuple[Content, str]] | list[Path]
_PATTERN = frozenset("*?[")


def load_demonstrations(
    path: str | Path | Sequence[str | Path],
    *,
    env_id: EnvironmentOrId | None = None,
    columns: Columns | None = None,
    missing: Missing = "refuse",
) -> Demonstrations:
    """Load demonstrations from a file, a folder, or several files.

    Args:
        path: A file of one of `EXTENSIONS` (`.gz` after it where it is compressed); `obs.csv`
            with `actions.csv` beside it; a folder, or the ZIP of one, as Minari, LeRobot and
            Hugging Face's `datasets` write them, with such a pair, or with tables of the same
            columns; several such tables; or a pattern as `runs/*.csv` that names them. Where no
            column numbers the episodes, each of several files is one.
        env_id: Environment to take spaces, names and bounds from where the file has none.
        columns: Which columns of a table hold what: a `ColumnMap` of all that are read, or the
            roles of some, as `{"brake": "action", "speed": "feature:m/s"}`; the others, and None,
            go by their names.
        missing: What becomes of steps that lack a value (an empty cell, NaN, null, NA) or hold an
            infinite one among observations, actions and rewards: "refuse" the file, or "drop"
            them. What is left of an episode keeps its number and the numbers of its steps.

    Returns:
        The demonstrations; their `notes` say what had to be guessed, and what was left out.

    Raises:
        InputError: If the file cannot be used: one sentence with file, column and first row.
    """
    columns = stated(columns)
    description = describe_environment(env_id) if env_id else None
    if isinstance(path, Sequence) and not isinstance(path, str):
        paths = [as_path(one) for one in path]
        path = paths[0] if len(paths) == 1 else path
    else:
        paths = _named_by(as_path(path))
        path = paths[0] if len(paths) == 1 else path
    if len(paths) != 1:
        name = str(path) if isinstance(path, str | Path) else f"{len(paths)} files"
        with naming(name):
            return _read_set(files_at(paths, name), description, columns, missing)
    (path,) = paths
    with naming(str(path)):
        files = _files_of(path)
        if files is not None:
            return _read_set(files, description, columns, missing)
        if not path.exists():
            raise InputError("there is no such file; check its name")
        names = partner_names(path.name) if columns is None else ()
        partner = next(
            (path.with_name(name) for name in names if path.with_name(name).is_file()), None
        )
        if partner is None:
            return _read(_content(path), path.name, description, columns, missing)
        content = _content(path)
        unpacked(content, path.name)
        if is_complete(content, path.name, partner.name, description):
            alone = _read(content, path.name, description, columns, missing)
            return _noted(alone, alone_note(path.name, partner.name))
        pair = (partner, path) if holds_actions(path.name) else (path, partner)
        contents = _content(pair[0]), _content(pair[1])
    return _read_pair(contents, (str(pair[0]), str(pair[1])), description, missing)


def read_demonstrations(
    data: Content,
    name: str,
    *,
    env_id: EnvironmentOrId | None = None,
    columns: Columns | None = None,
    companion: tuple[Content, str] | None = None,
    missing: Missing = "refuse",
) -> Demonstrations:
    """Read demonstrations from what was uploaded.

    Args:
        data: Content of the file, or an open binary file.
        name: Its name; the extension chooses the format.
        env_id: As for `load_demonstrations`.
        columns: As for `load_demonstrations`.
        companion: Content and name of the other file of a pair, observations or actions.
        missing: As for `load_demonstrations`.

    Returns:
        The demonstrations.

    Raises:
        InputError: As `load_demonstrations`.
    """
    columns = stated(columns)
    description = describe_environment(env_id) if env_id else None
    with naming(name):
        content = _bytes(data)
    if companion is None:
        return _read_named(content, name, description, columns, missing)
    other, other_name = companion
    with naming(other_name):
        other_content = _bytes(other)
    if columns is not None:
        with naming(name):
            raise _no_pair_mapped()
    if holds_actions(name) and not holds_actions(other_name):
        return _read_pair((other_content, content), (other_name, name), description, missing)
    return _read_pair((content, other_content), (name, other_name), description, missing)


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
        form = format_of(path.name)
        if form.write is None:
            raise InputError(f"{form.kind} is read and not written; name it {' or '.join(WRITTEN)}")
        if path.is_dir():
            raise InputError("it is a folder; give a file in it")
        with whole_file(path) as unfinished, unfinished.open("xb") as out:
            form.write(demonstrations, out)


def read_files(
    files: Sequence[tuple[Content, str]],
    *,
    env_id: EnvironmentOrId | None = None,
    columns: Columns | None = None,
    missing: Missing = "refuse",
) -> Demonstrations:
    """Read demonstrations from files that were uploaded together.

    Args:
        files: Content and name of each: one file, the ZIP of a folder, the pair of observations
            and actions, or several tables of the same columns.
        env_id: As for `load_demonstrations`.
        columns: As for `load_demonstrations`.
        missing: As for `load_demonstrations`.

    Returns:
        The demonstrations.

    Raises:
        InputError: As `load_demonstrations`.
    """
    columns = stated(columns)
    first, *others = files
    if not others:
        return read_demonstrations(*first, env_id=env_id, columns=columns, missing=missing)
    if _are_pair([name for _, name in files]):
        return read_demonstrations(
            *first, env_id=env_id, columns=columns, companion=others[0], missing=missing
        )
    description = describe_environment(env_id) if env_id else None
    with naming(f"{len(files)} files"):
        return _read_set(_given(files), description, columns, missing)


def table_columns(source: Source, name: str | None = None) -> tuple[str, ...]:
    """Columns of a tabular file, or of several, for a person to map.

    Args:
        source: A path, or several; the content of a file, or content and name of several.
        name: The file's name, needed with content.

    Returns:
        Names of the columns, "column 1"... for CSV without a header; () for what has no columns
        (.npz).

    Raises:
        InputError: If the file cannot be opened.
    """
    with _opened_table(source, name) as table:
        return table.names if table is not None else ()


def preview_columns(
    source: Source, name: str | None = None, *, columns: Roles | None = None
) -> tuple[ColumnPreview, ...]:
    """What the columns of a tabular file, or of several, hold and seem to be, to be mapped.

    Args:
        source: As of `table_columns`.
        name: Likewise.
        columns: What was said of some of them already.

    Returns:
        One entry a column; () for what has no columns (.npz).

    Raises:
        InputError: If the file cannot be opened, or what was said does not fit it.
    """
    with _opened_table(source, name) as table:
        return previewed(table, columns or {}) if table is not None else ()


@contextmanager
def _opened_table(source: Source, name: str | None) -> Iterator[Table | None]:
    """The table in what `table_columns` takes; errors in it begin with the file's name."""
    if isinstance(source, list):
        if len(source) > 1:
            yield _table_of_several(source)
            return
        (only,) = source
        source, name = only if isinstance(only, tuple) else (only, name)
    if isinstance(source, (str, Path)) and len(paths := _named_by(Path(source))) > 1:
        yield _table_of_several(paths)
        return
    on_disk = Path(source) if isinstance(source, (str, Path)) else None
    name = name or str(on_disk or "the file")
    with naming(name):
        files = None if on_disk is None else _files_of(on_disk)
        if files is not None:
            yield _table_of(files)
            return
        content = _content(Path(source)) if isinstance(source, (str, Path)) else _bytes(source)
        if extension_of(name) == ZIP:
            yield _table_of(files_in_archive(unpacked(content, name), name))
            return
        form = format_of(name)
        content = unpacked(content, name)
        yield form.open_table(content) if form.open_table is not None else None


def _table_of_several(source: list[tuple[Content, str]] | list[Path]) -> Table | None:
    files = [(path, path.name) if isinstance(path, Path) else path for path in source]
    if _are_pair([name for _, name in files]):
        return None
    paths = [path for path, _ in files if isinstance(path, Path)]
    if paths:
        return _table_of(files_at(paths, f"{len(paths)} files"))
    return _table_of(_given([(data, name) for data, name in files if not isinstance(data, Path)]))


def _named_by(path: Path) -> list[Path]:
    """The files that a path, or a pattern in its place, names."""
    if path.exists() or not _PATTERN.intersection(str(path)):
        return [path]
    root = Path(path.anchor)
    names = list(root.glob(str(path.relative_to(root))))
    if not names:
        raise InputError(f"{path}: no file has a name of this pattern; check it")
    return names


def _files_of(path: Path) -> FileSet | None:
    """The files that a path stands for, None if it is one file."""
    if path.is_dir():
        return files_in_folder(path)
    if path.name == MAIN_FILE and path.with_name(METADATA).is_file():
        return files_at([path, path.with_name(METADATA)], path.name)
    if path.suffix.lower() == ZIP and path.is_file():
        return files_in_archive(unpacked(_content(path), path.name), path.name)
    return None


def _given(files: Sequence[tuple[Content, str]]) -> FileSet:
    contents = []
    for data, name in files:
        with naming(name):
            contents.append((name, _bytes(data)))
    return files_given(contents, f"{len(files)} files")


def _are_pair(names: Sequence[str]) -> bool:
    """Whether two files are the observations and the actions of one another."""
    return len(names) == 2 and (
        names[0] in partner_names(names[1])
        or names[1] in partner_names(names[0])
        or holds_actions(names[0]) != holds_actions(names[1])
    )


def _opened_set(files: FileSet) -> Recording | OpenedTable:
    """What several files hold together."""
    hub = open_hub(files)
    if hub is not None:
        return hub
    arrays = [
        path
        for path in files.sizes
        if (form := FORMATS.get(extension_of(path))) is not None and form.read is not None
    ]
    tables = [path for path in files.sizes if extension_of(path) in FORMATS and path not in arrays]
    if len(arrays) == 1 and not tables:
        with naming(arrays[0]):
            read = format_of(arrays[0]).read
            assert read is not None
            return read(unpacked(files.content(arrays[0]), arrays[0]))
    table, notes = open_tables(files)
    return OpenedTable(table, notes=notes)


def _table_of(files: FileSet) -> Table | None:
    opened = _opened_set(files)
    return opened.table if isinstance(opened, OpenedTable) else None


def _read_set(
    files: FileSet,
    description: EnvironmentDescription | None,
    columns: ColumnMap | Roles | None,
    missing: Missing,
) -> Demonstrations:
    pair = pair_among(files.sizes)
    if pair is not None:
        if columns is not None:
            raise _no_pair_mapped()
        contents = files.contents(pair)
        return _read_pair((contents[pair[0]], contents[pair[1]]), pair, description, missing)
    opened = _opened_set(files)
    if isinstance(opened, Recording):
        if columns is not None:
            raise InputError(
                "columns are mapped in a table, and this data set has none; leave the map out"
            )
        return to_demonstrations(opened, description, missing)
    chosen = columns if columns is not None else opened.columns
    names = _names_of(opened.columns)
    recording = recording_from_table(opened.table, chosen, description, names)
    recording = replace(recording, notes=(*opened.notes, *recording.notes))
    return to_demonstrations(recording, description, missing)


def _names_of(columns: ColumnMap | None) -> dict[str, str]:
    """What a data set itself calls its features and actions, by their columns."""
    if columns is None:
        return {}
    features = zip(columns.observations, columns.feature_names or (), strict=False)
    return {
        **dict(features),
        **dict(zip(columns.actions, columns.action_names or (), strict=False)),
    }


def _read_named(
    content: memoryview,
    name: str,
    description: EnvironmentDescription | None,
    columns: ColumnMap | Roles | None,
    missing: Missing,
) -> Demonstrations:
    with naming(name):
        return _read(content, name, description, columns, missing)


def _read(
    content: memoryview,
    name: str,
    description: EnvironmentDescription | None,
    columns: ColumnMap | Roles | None,
    missing: Missing,
) -> Demonstrations:
    if extension_of(name) == ZIP:
        return _read_set(
            files_in_archive(unpacked(content, name), name), description, columns, missing
        )
    form = format_of(name)
    content = unpacked(content, name)
    if form.open_table is None:
        assert form.read is not None
        if columns is not None:
            raise InputError(
                f"columns are mapped in a table, and {form.kind} has none; leave the map out"
            )
        return to_demonstrations(form.read(content), description, missing)
    table = form.open_table(content)
    partners = partner_names(PurePath(name).name)
    if partners and not table.named and columns is None and not fits(table, description):
        halves = ("observations", "actions")
        own = holds_actions(PurePath(name).name)
        raise InputError(
            f"it has no header, so it holds the {halves[own]} of a pair alone; give "
            f"{partners[0]!r} with the {halves[not own]} too"
        )
    recording = _of_episode_rows(table) if columns is None else None
    if recording is None:
        recording = recording_from_table(table, columns, description)
    return to_demonstrations(recording, description, missing)


def _of_episode_rows(table: Table) -> Recording | None:
    """What a table holds of which each row is an episode; None if it is none."""
    if isinstance(table, ArrowTable):
        return recording_of_rows(table.table)
    if isinstance(table, ParquetTable):
        keys = keys_of_rows(table.file.schema_arrow)
        return recording_of_rows(whole_table(table, [*keys.values()])) if keys else None
    return None


def _read_pair(
    contents: tuple[memoryview, memoryview],
    names: tuple[str, str],
    description: EnvironmentDescription | None,
    missing: Missing,
) -> Demonstrations:
    with naming_both(names):
        for content, name in zip(contents, names, strict=True):
            with naming(name):
                if PurePath(name).suffix.lower() != ".csv":
                    raise InputError(
                        "a pair of observations and actions is two .csv files; give those"
                    )
                unpacked(content, name)
        recording = read_pair(*contents, names)
        with naming(f"{names[0]} with {names[1]}"):
            return _noted(to_demonstrations(recording, description, missing), pair_note(names))


def _no_pair_mapped() -> InputError:
    return InputError(
        "columns are mapped in one table, not in a pair of files; give one of the two"
    )


def _noted(demonstrations: Demonstrations, note: str) -> Demonstrations:
    return replace(demonstrations, notes=(*demonstrations.notes, note))


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
