"""Cells of tables that people open in a spreadsheet, none of which is taken for a formula."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

_FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r", "\n")
_NUMBER = r"[+-]?[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?"
# An interval has words in it, so no spreadsheet reckons it out.
_NUMERIC = re.compile(rf"{_NUMBER}(?: to {_NUMBER})?")


def safe_cell(text: str) -> str:
    """Text that no spreadsheet takes for a formula.

    Args:
        text: Perhaps from a file of somebody else.

    Returns:
        The same where it is a number or an interval, as "-1 to 0.5", or begins harmlessly;
        otherwise with an apostrophe before it.
    """
    harmless = not text.startswith(_FORMULA_SIGNS) or _NUMERIC.fullmatch(text)
    return text if harmless else f"'{text}"


def safe_cells(frame: pd.DataFrame) -> pd.DataFrame:
    """A table in which no text and no heading is taken for a formula.

    Args:
        frame: Any; what is no text stays as it is.

    Returns:
        Another one.
    """
    import pandas as pd

    safe = frame.rename(columns=lambda name: safe_cell(str(name)))
    for name in safe.columns:
        kind = safe[name].dtype
        if isinstance(kind, pd.CategoricalDtype) and all(
            isinstance(one, str) for one in kind.categories
        ):
            safe[name] = safe[name].map(safe_cell)  # each category once
        elif not pd.api.types.is_numeric_dtype(safe[name]):
            safe[name] = [
                safe_cell(one) if isinstance(one, str) else one for one in safe[name].tolist()
            ]
    return safe
