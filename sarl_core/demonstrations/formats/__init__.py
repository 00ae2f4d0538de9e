"""Reading and writing demonstrations: files of many kinds, folders of them, and pairs of CSV."""

from sarl_core.demonstrations.formats.columns import ColumnMap, guess_columns
from sarl_core.demonstrations.formats.kinds import EXTENSIONS, WRITTEN
from sarl_core.demonstrations.formats.mapping.preview import ColumnPreview
from sarl_core.demonstrations.formats.mapping.roles import ColumnRole, load_roles
from sarl_core.demonstrations.formats.registry import (
    load_demonstrations,
    preview_columns,
    read_demonstrations,
    read_files,
    save_demonstrations,
    table_columns,
)

__all__ = [
    "EXTENSIONS",
    "WRITTEN",
    "ColumnMap",
    "ColumnPreview",
    "ColumnRole",
    "guess_columns",
    "load_demonstrations",
    "load_roles",
    "preview_columns",
    "read_demonstrations",
    "read_files",
    "save_demonstrations",
    "table_columns",
]
