"""Headings within pieces of HTML, as large as those that the pages have elsewhere."""

from __future__ import annotations

from html import escape

_LOOK = (
    "font-size:1.1rem;font-weight:600;line-height:1.2;letter-spacing:-0.005em;margin:0;"
    "padding:0.75rem 0 0.8rem 0"
)


def heading(text: str) -> str:
    """A heading of the third level.

    Args:
        text: What it says.

    Returns:
        HTML, styled in place; the text escaped.
    """
    return f'<h3 style="{_LOOK}">{escape(text)}</h3>'
