"""Short tables in HTML, for what follows a control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from markupsafe import Markup

from sarl_core.explaining.templates import render


class Column(NamedTuple):
    """What stands above the cells of a column, and how they look.

    Attributes:
        title: The heading.
        css: "n" for numbers, "m" and "w" for words that want some room and much, or "".
        meaning: What the heading means, "" where it says so itself.
    """

    title: str
    css: str = ""
    meaning: str = ""


def table_html(columns: Sequence[Column], rows: Sequence[Sequence[str]], label: str) -> Markup:
    """A table that scrolls within itself where there is not enough room.

    Args:
        columns: From left to right.
        rows: From top to bottom, each with a text a column.
        label: What it shows, for those who do not see it.

    Returns:
        HTML.
    """
    looks = [column.css for column in columns]
    cells = [zip(looks, row, strict=True) for row in rows]
    return render("parts/table", columns=columns, rows=cells, label=label)
