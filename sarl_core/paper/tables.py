"""A study's table as a CSV file, from which everything can be drawn again."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from sarl_core.errors import InputError
from sarl_core.files import whole_file
from sarl_core.limits import limited_bytes
from sarl_core.paper.study import Study

if TYPE_CHECKING:
    import pandas as pd


def write_table(frame: pd.DataFrame, path: Path) -> None:
    """Write a table; the file appears whole or not at all.

    Args:
        frame: Plain columns.
        path: A `.csv` file.

    Raises:
        WorkError: If it cannot be written.
    """
    with whole_file(path) as unfinished:
        frame.to_csv(unfinished, index=False, lineterminator="\n")


def read_table(study: Study, path: Path) -> pd.DataFrame:
    """Read the table that a study left, and see that it can be used.

    Args:
        study: Whose table it is.
        path: A `.csv` file.

    Returns:
        The same values, to the last bit.

    Raises:
        InputError: If the file is missing, damaged, or of something else.
    """
    import pandas as pd

    try:
        frame = pd.read_csv(io.BytesIO(limited_bytes(path)))
        missing = [column for column in study.columns if column not in frame.columns]
        if missing:
            raise ValueError(f"it has no column {missing[0]!r}")
        if len(frame) == 0:
            raise ValueError("it has no rows")
        study.numbers(frame)  # rows that are missing or are no numbers show here
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror or error}); run `reproduce --figure "
            f"{study.name}` again"
        ) from error
    except Exception as error:  # whatever damaged rows may lead to
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(
            f"{path} is not the table of {study.place} ({reason}); run `reproduce --figure "
            f"{study.name}` again"
        ) from error
    return frame
