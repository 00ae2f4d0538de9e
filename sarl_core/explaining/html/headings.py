"""Headings, notes and terms within pieces of HTML, as those look that the pages have elsewhere."""

from __future__ import annotations

from markupsafe import Markup

from sarl_core.explaining.templates import render


def heading(text: str) -> Markup:
    """A heading of the second level, below the title of the page.

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


def aside(text: str) -> Markup:
    """A text that stands back, in a row with others.

    Args:
        text: What it says.

    Returns:
        HTML.
    """
    return render("parts/aside", text=text)


def term(colour: str, name: str, meaning: str) -> Markup:
    """What a name means that has a colour in a figure.

    Args:
        colour: As "#0072B2".
        name: What is explained.
        meaning: In sentences.

    Returns:
        HTML.
    """
    return render("parts/term", colour=colour, term=name, meaning=meaning)
