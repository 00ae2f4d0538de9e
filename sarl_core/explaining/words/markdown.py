"""Text from outside in Markdown, in a document or on screen."""

from __future__ import annotations

import re
from html import escape

_SIGNS = re.compile(r"([\\`*_{}\[\]#~|$:!^@+-])")
_ORDINARY = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ,;.+/²³°%-]*")
# What becomes a link or an emoji after the escapes are gone: a character without width breaks it.
_JOINER = "\u2060"
_BREAKS = re.compile(r"(?<=:)(?=//|[\w+/-]+:)|(?<=@)|(?<=www)(?=\.)", re.IGNORECASE)


def markdown_text(text: str) -> str:
    """Text that Markdown, and the HTML in it, leave alone: names come from files.

    Args:
        text: A name, a unit, a label, or a sentence with some in it.

    Returns:
        What is shown as the text.
    """
    broken = _BREAKS.sub(_JOINER, text)
    if _ORDINARY.fullmatch(broken):
        return broken
    return escape(_SIGNS.sub(r"\\\1", broken), quote=False)
