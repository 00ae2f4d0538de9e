"""The columns of a table with their first rows, in HTML."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

from markupsafe import Markup

from sarl_core.demonstrations.formats.mapping.preview import ColumnPreview
from sarl_core.demonstrations.formats.mapping.roles import ROLE_WORDS
from sarl_core.explaining.templates import render

NAMELESS = "(no name)"
_EMPTY = "–"


class _PreviewRow(NamedTuple):
    name: list[str]  # parts, between which a line may end
    holds: str
    first: str
    use: str
    why: str


def column_previews_html(previews: Sequence[ColumnPreview]) -> Markup:
    """A row a column: its name and kind, its first values, and what it seems to be and why.

    Args:
        previews: Of the columns.

    Returns:
        HTML.
    """
    rows = [
        _PreviewRow(
            re.split(r"(?<=[_./-])", one.name or NAMELESS),
            one.holds,
            ", ".join(value or _EMPTY for value in one.first),
            "unclear" if one.role is None else ROLE_WORDS[one.role.role],
            one.why,
        )
        for one in previews
    ]
    return render("parts/columns", columns=rows)
