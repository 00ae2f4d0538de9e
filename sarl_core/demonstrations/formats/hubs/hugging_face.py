"""Folders as Hugging Face's `datasets` saves them: Arrow streams, and a file that lists them.

In imitation's, each row is an episode: `obs` has one observation more than `acts` has actions, and
`infos` are texts, which are left alone. Others have one row a step, or one an episode under other
names.
"""

from __future__ import annotations

import msgspec

from sarl_core.demonstrations.formats.arrow.table import arrow_table, table_of_stream
from sarl_core.demonstrations.formats.naming import naming
from sarl_core.demonstrations.formats.opened_table import Table
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.formats.sets.episode_rows import recording_of_rows
from sarl_core.demonstrations.formats.sets.file_set import FileSet
from sarl_core.documents import MisfitError, conformed, parse_json
from sarl_core.errors import InputError

STATE = "state.json"
INFO = "dataset_info.json"


class _DataFile(msgspec.Struct):
    filename: str


class _State(msgspec.Struct):
    files: list[_DataFile] = msgspec.field(name="_data_files")


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
    return recording_of_rows(table, certain=True) or arrow_table(table)


def _listed(content: memoryview) -> list[str]:
    """The files with the rows, in their order."""
    with naming(STATE):
        try:
            names = [one.filename for one in conformed(parse_json(bytes(content)), _State).files]
        except MisfitError as error:
            raise InputError("it lists no files; save the data set again") from error
        except ValueError as error:
            raise InputError(f"it is no JSON ({error}); save the data set again") from error
        if not names:
            raise InputError("it lists no files; save the data set again")
        if len(set(names)) < len(names):
            raise InputError("it lists a file twice; save the data set again")
        return names
