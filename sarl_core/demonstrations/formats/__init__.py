"""Reading and writing demonstrations: Parquet, CSV, NPZ, and the paper's pair of CSV files."""

from sarl_core.demonstrations.formats.columns import ColumnMap, guess_columns
from sarl_core.demonstrations.formats.registry import (
    EXTENSIONS,
    load_demonstrations,
    read_demonstrations,
    save_demonstrations,
    table_columns,
)

__all__ = [
    "EXTENSIONS",
    "ColumnMap",
    "guess_columns",
    "load_demonstrations",
    "read_demonstrations",
    "save_demonstrations",
    "table_columns",
]
