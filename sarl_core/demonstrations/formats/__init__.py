"""Reading and writing demonstrations: files of many kinds, folders of them, and pairs of CSV."""

from sarl_core.demonstrations.formats.columns import ColumnMap, guess_columns
from sarl_core.demonstrations.formats.kinds import EXTENSIONS, WRITTEN
from sarl_core.demonstrations.formats.registry import (
    load_demonstrations,
    read_demonstrations,
    read_files,
    save_demonstrations,
    table_columns,
)

__all__ = [
    "EXTENSIONS",
    "WRITTEN",
    "ColumnMap",
    "guess_columns",
    "load_demonstrations",
    "read_demonstrations",
    "read_files",
    "save_demonstrations",
    "table_columns",
]
