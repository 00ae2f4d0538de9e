"""Text from outside in figures: Plotly takes every text for markup."""

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
