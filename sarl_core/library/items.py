"""What stands in a library: things with an id, an author, a time and a digest."""

from __future__ import annotations

import re
import secrets
from base64 import b32encode
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal, get_args

from sarl_core.errors import InputError, quoted
from sarl_core.explaining.words.sign_off import Approval

Kind = Literal[
    "demonstrations",
    "rules",
    "result",
    "note",
    "log",
    "edits",
    "names",
    "episodes",
    "improvement",
    "study",
]
KINDS: tuple[Kind, ...] = get_args(Kind)
UNLISTED: tuple[Kind, ...] = ("edits", "names", "episodes", "improvement", "study")
"""What links need and nobody looks for: in a list only where it is asked for."""

PREFIX = "library:"
"""Before an id where a command takes a file."""

_ID = re.compile("[a-z2-7]{26}")
_BYTES_OF_AN_ID = 16


@dataclass(frozen=True)
class ItemFile:
    """A file of an item.

    Attributes:
        role: What it is to the item, as "demonstrations" or "picture".
        digest: blake2b of its content, 32 hex digits.
        ending: Of its name, as ".parquet".
        size: Bytes.
    """

    role: str
    digest: str
    ending: str
    size: int


@dataclass(frozen=True)
class Item:
    """One thing that is kept. What it is never changes: a change makes a new version.

    Attributes:
        id: Cannot be guessed; whoever has it may look.
        kind: What it is.
        name: What people call it.
        author: Whose it is.
        created: When it was added.
        digest: Of what it holds, as of `RuleSet.digest`.
        lineage: Id of the first version, its own where it is the first.
        parent: Id of the version that it was made from; "" where it is the first.
        came_from: Ids of what it was made of, as the demonstrations of rules.
        command: That makes it again; "" where none does.
        details: More about it, as JSON has it.
        shared: Whether it stands in everybody's list.
        removed: When it was removed; None where it was not.
        files: What it holds.
        approvals: Who approved it, the first first.
    """

    id: str
    kind: Kind
    name: str
    author: str
    created: datetime
    digest: str
    lineage: str
    parent: str = ""
    came_from: tuple[str, ...] = ()
    command: str = ""
    details: Mapping[str, Any] = field(default_factory=dict)
    shared: bool = False
    removed: datetime | None = None
    files: tuple[ItemFile, ...] = ()
    approvals: tuple[Approval, ...] = ()

    @property
    def size(self) -> int:
        """Bytes of its files."""
        return sum(one.size for one in self.files)

    @property
    def document(self) -> dict[str, Any]:
        """Itself as JSON has it."""
        return {
            "id": self.id,
            "kind": self.kind,
            "name": self.name,
            "digest": self.digest,
            "created": self.created.isoformat(),
            "author": self.author,
            "lineage": self.lineage,
            "parent": self.parent or None,
            "came_from": list(self.came_from),
            "command": self.command,
            "details": dict(self.details),
            "shared": self.shared,
            "removed": None if self.removed is None else self.removed.isoformat(),
            "size": self.size,
            "files": [
                {"role": one.role, "digest": one.digest, "ending": one.ending, "size": one.size}
                for one in self.files
            ],
            "approvals": [one.document for one in self.approvals],
        }


def new_id() -> str:
    """An id that nobody can guess: 128 random bits, in letters that survive being read aloud."""
    return b32encode(secrets.token_bytes(_BYTES_OF_AN_ID)).decode().rstrip("=").lower()


def as_id(text: str) -> str:
    """The id in what a person gave.

    Args:
        text: The id, with "library:" before it or without.

    Returns:
        The id.

    Raises:
        InputError: If it is none.
    """
    bare = text.strip().removeprefix(PREFIX).lower()
    if not _ID.fullmatch(bare):
        raise InputError(
            f"{quoted(text)} is no id of a library, which has 26 letters and digits; "
            "`sarl library list` shows them"
        )
    return bare
