"""Files that stand in for what is kept, and what they are called: as they were typed."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

_CALLED: dict[str, str] = {}  # of one command line


def put(stand_ins: Mapping[Path, str]) -> None:
    """Remember which files stand in for what, in the place of those of the command before.

    Args:
        stand_ins: What each of them is called.
    """
    _CALLED.clear()
    _CALLED.update({str(path): name for path, name in stand_ins.items()})


def called(path: Path, *, short: bool = False) -> str:
    """What a file is called in an answer, a card or a command.

    Args:
        path: As a command has it.
        short: Whether the folder is left out.

    Returns:
        As "library:ID" where it stands in for that.
    """
    return _CALLED.get(str(path), path.name if short else str(path))


def said(text: str) -> str:
    """A sentence in which files that stand in for something are called by that."""
    for path, name in _CALLED.items():
        text = text.replace(path, name)
    return text
