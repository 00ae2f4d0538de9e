"""Lengths in markup; and texts from outside in figures, where Plotly takes all text for markup."""

from __future__ import annotations

from html import escape


def plain(text: str) -> str:
    """Text that Plotly shows as it is: a name, a unit or a label, which may come from a file.

    Args:
        text: Any.

    Returns:
        The text with "&", "<" and ">" as entities, and nothing that a template would fill in.
    """
    return escape(text, quote=False).replace("%{", "%&#123;")


def percent(share: float) -> str:
    """A length in CSS or SVG.

    Args:
        share: Of the whole.

    Returns:
        As "12.50%".
    """
    return f"{100 * share:.2f}%"
