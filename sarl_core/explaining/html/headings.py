"""Headings and notes within pieces of HTML, as those look that the pages have elsewhere."""

from __future__ import annotations

from html import escape

_HEADING = (
    "font-size:1.1rem;font-weight:600;line-height:1.2;letter-spacing:-0.005em;margin:0;"
    "padding:0.75rem 0 0.8rem 0"
)
_NOTE = "font-size:0.875rem;line-height:1.5;opacity:0.7;margin:0 0 0.5rem 0"


def heading(text: str) -> str:
    """A heading of the third level.

    Args:
        text: What it says.

    Returns:
        HTML, styled in place; the text escaped.
    """
    return f'<h3 style="{_HEADING}">{escape(text)}</h3>'


def note(text: str) -> str:
    """A paragraph that stands back.

    Args:
        text: What it says.

    Returns:
        HTML, styled in place; the text escaped.
    """
    return f'<p style="{_NOTE}">{escape(text)}</p>'
