"""Text for the screen."""

from __future__ import annotations


def in_full(text: str) -> str:
    """A message as a sentence; what begins with a name, as of a file, keeps its first letter."""
    first = text.split(" ", 1)[0]
    return escaped(text[:1].upper() + text[1:] if first.isalpha() else text) + "."


def escaped(text: str) -> str:
    """Text that Markdown leaves alone."""
    return "".join(f"\\{sign}" if sign in r"\`*_{}[]<>#$~|:" else sign for sign in text)
