"""Which hub a folder is from, if it is from one."""

from __future__ import annotations

from dataclasses import dataclass

from sarl_core.demonstrations.formats.columns import ColumnMap
from sarl_core.demonstrations.formats.hubs.hugging_face import hugging_face_root, open_hugging_face
from sarl_core.demonstrations.formats.hubs.lerobot import INFO, open_lerobot
from sarl_core.demonstrations.formats.hubs.minari import minari_root, read_minari
from sarl_core.demonstrations.formats.opened_table import Table
from sarl_core.demonstrations.formats.recording import Recording
from sarl_core.demonstrations.formats.sets.file_set import FileSet


@dataclass(frozen=True)
class OpenedTable:
    """A table that several files hold.

    Attributes:
        table: The table.
        columns: What its columns are, where a file beside it says so.
        notes: On how it was put together.
    """

    table: Table
    columns: ColumnMap | None = None
    notes: tuple[str, ...] = ()


def open_hub(files: FileSet) -> Recording | OpenedTable | None:
    """Open a data set that has the layout of a hub.

    Args:
        files: In which it may be, below a folder of any name.

    Returns:
        What it holds; None where the files have no such layout.

    Raises:
        InputError: If they have, and cannot be read.
    """
    root = files.root_of(INFO)
    if root is not None:
        return OpenedTable(*open_lerobot(files.below(root)))
    root = minari_root(files)
    if root is not None:
        return read_minari(files.below(root))
    root = hugging_face_root(files)
    if root is None:
        return None
    opened = open_hugging_face(files.below(root))
    return opened if isinstance(opened, Recording) else OpenedTable(opened)
