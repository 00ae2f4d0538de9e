"""Headings and notes within pieces of HTML, as those look that the pages have elsewhere."""

from __future__ import annotations

from markupsafe import Markup

from sarl_core.explaining.templates import render


def heading(text: str) -> Markup:
    """A heading of the third level.

    Args:
        text: What it says.

    Returns:
        HTML.
    """
    return render("parts/heading", text=text)


def note(text: str) -> Markup:
    """A paragraph that stands back.

    Args:
        text: What it says.

    Returns:
        HTML.
    """
    return render("parts/note", text=text)
