"""How a thing shows itself in a notebook: a caption and a small table, every text escaped."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Template

MOST_ROWS = 30
"""Of a table in a notebook; what is more is counted."""


def table_html(
    caption: str, header: Sequence[str], rows: Iterable[Sequence[object]], *, more: int = 0
) -> str:
    """A table for a notebook.

    Args:
        caption: Above it.
        header: Names of the columns.
        rows: One text or number a column.
        more: How many rows were left out.

    Returns:
        HTML.
    """
    return _template().render(caption=caption, header=header, rows=rows, more=more)


@cache
def _template() -> Template:
    from jinja2 import Environment

    text = Path(__file__).with_suffix(".html.j2").read_text(encoding="utf-8")
    return Environment(autoescape=True).from_string(text)
