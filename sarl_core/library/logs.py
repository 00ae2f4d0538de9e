"""Logs of what somebody did as things that are kept: the file, and what its columns are."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from hashlib import blake2b
from pathlib import PurePath
from typing import TYPE_CHECKING

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import ColumnRole, read_demonstrations
from sarl_core.demonstrations.formats.mapping.roles import as_roles
from sarl_core.errors import InputError, quoted
from sarl_core.library.items import Item
from sarl_core.library.results import standing_ids
from sarl_core.limits import limited_bytes

if TYPE_CHECKING:
    from sarl_core.library.library import Library

_LOG, _COLUMNS, _FILE_NAME = "log", "columns", "file_name"
_ENDING = re.compile(r"\.[a-z0-9]{1,12}")


def add_log(
    library: Library,
    content: bytes,
    name: str,
    *,
    author: str,
    roles: Mapping[str, ColumnRole] | None = None,
    about: Sequence[str] = (),
) -> Item:
    """Keep a log; where its author keeps the same, read in the same way, that is it.

    Args:
        library: Where.
        content: Of the file.
        name: Of the file, whose ending says what format it has.
        author: Whose it is.
        roles: What was said of its columns.
        about: Ids of what it is of.

    Returns:
        What is kept.

    Raises:
        InputError: If it cannot be read; or as of `Library.add`.
        WorkError: If it cannot be written.
    """
    log = read_log(content, name, roles)
    said = {column: str(role) for column, role in (roles or {}).items()}
    key = json.dumps([name, said]).encode() + b"\0" + content
    digest = blake2b(key, digest_size=16).hexdigest()
    for known in library.with_digest(digest, kind="log"):
        if known.author == author:
            return known
    ending = PurePath(name).suffix.lower()
    return library.add(
        "log",
        name,
        {_LOG: (content, ending if _ENDING.fullmatch(ending) else ".bin")},
        author=author,
        digest=digest,
        came_from=standing_ids(library, about),
        details={
            _FILE_NAME: name,
            "steps": len(log),
            "episodes": log.n_episodes,
            **({_COLUMNS: said} if said else {}),
        },
    )


def read_log(content: bytes, name: str, roles: Mapping[str, ColumnRole] | None) -> Demonstrations:
    """What stands in a log; states that are none are left out, and said.

    Args:
        content: Of the file.
        name: Of the file.
        roles: What was said of its columns; None or {} for nothing.

    Raises:
        InputError: If it cannot be read.
    """
    return read_demonstrations(content, name, columns=dict(roles or {}) or None, missing="drop")


def log_content(library: Library, item: Item) -> bytes:
    """The file of a log that is kept.

    Args:
        library: Where it is.
        item: The log.

    Raises:
        InputError: If it is something else, or its file is missing.
    """
    if item.kind != "log":
        raise InputError(f"{quoted(item.name)} is no log; choose one, or upload it")
    return limited_bytes(library.path(item, _LOG))


def log_file_name(item: Item) -> str:
    """What the file of a log was called."""
    return str(item.details.get(_FILE_NAME) or item.name)


def log_roles(item: Item) -> dict[str, ColumnRole]:
    """What was said of the columns of a log; {} where nothing was.

    Raises:
        InputError: If it was written by another version.
    """
    said = item.details.get(_COLUMNS) or {}
    try:
        return as_roles({str(column): str(role) for column, role in said.items()})
    except (AttributeError, InputError) as error:
        raise InputError(
            f"what was said of the columns of {quoted(item.name)} cannot be read ({error}); upload "
            "it again"
        ) from error
