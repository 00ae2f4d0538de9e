"""Things of a library, and what they came from, as one file for another machine."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec

from sarl_core.archives import entry_content, opened
from sarl_core.documents import Count, MisfitError, conformed, parse_json
from sarl_core.errors import InputError, quoted
from sarl_core.explaining.words.sign_off import Approval
from sarl_core.files import as_path, whole_file
from sarl_core.library.contents import digest_of_files
from sarl_core.library.items import UNLISTED, Item, ItemFile, Kind
from sarl_core.limits import limited_bytes, require_memory

if TYPE_CHECKING:
    from sarl_core.library.library import Library

ENDING = ".sarl"
_LIST = "bundle.json"
_FORMAT, _VERSION = "sarl-bundle", 1
_LONGEST_LIST = 2**24

_Id = Annotated[str, msgspec.Meta(pattern="^[a-z2-7]{26}$")]
_Optional = Annotated[str, msgspec.Meta(pattern="^([a-z2-7]{26})?$")]
_Text = Annotated[str, msgspec.Meta(max_length=100_000)]


class _ListedFile(msgspec.Struct, forbid_unknown_fields=True):
    role: Annotated[str, msgspec.Meta(min_length=1, max_length=60)]
    digest: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{32}$")]
    ending: Annotated[str, msgspec.Meta(pattern=r"^\.[a-z0-9]{1,12}$")]
    size: Count


class _ListedApproval(msgspec.Struct, forbid_unknown_fields=True):
    author: _Text
    note: _Text
    created: datetime


class _ListedItem(msgspec.Struct, forbid_unknown_fields=True):
    id: _Id
    kind: Kind
    name: _Text
    digest: Annotated[str, msgspec.Meta(max_length=64)]
    created: datetime
    author: _Text
    lineage: _Id
    parent: str | None
    came_from: list[_Id]
    command: _Text
    details: dict[str, Any]
    shared: bool
    removed: None
    size: Count
    files: list[_ListedFile]
    approvals: list[_ListedApproval]


class _Bundle(msgspec.Struct, forbid_unknown_fields=True):
    items: list[_ListedItem]


def export_bundle(library: Library, identifiers: Sequence[str], path: str | Path) -> list[Item]:
    """Write things, with all that they came from and the notes to these, into one file.

    Args:
        library: Where they are.
        identifiers: Ids of them.
        path: A `.sarl` file; it appears whole or not at all.

    Returns:
        What is in it.

    Raises:
        InputError: If there is no such thing, a file of one is missing, or the path has another
            ending.
        WorkError: If it cannot be written.
    """
    target = as_path(path, ending=ENDING)
    items: dict[str, Item] = {}
    left = list(identifiers)
    while left:
        item = library.item(left.pop(0))
        if item.kind in UNLISTED:
            raise InputError(
                f"{quoted(item.name)} is kept for links alone; export the rules or the data"
            )
        if item.id not in items:
            items[item.id] = item
            left += [*item.came_from, *([item.parent] if item.parent else [])]
    if any(item.removed is not None for item in items.values()):
        items = {key: item for key, item in items.items() if item.removed is None}
        if not items:
            raise InputError("what is to be exported was removed; bring it back first")
    items = _notes_to(library, items) | items
    with (
        whole_file(target) as unfinished,
        zipfile.ZipFile(unfinished, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        document = {
            "format": _FORMAT,
            "version": _VERSION,
            "items": [item.document for item in items.values()],
        }
        archive.writestr(_LIST, json.dumps(document, indent=1))
        written = set()
        for item in items.values():
            for file in item.files:
                if file.digest not in written:
                    written.add(file.digest)
                    archive.write(library.path(item, file.role), _entry(file))
    return list(items.values())


def _notes_to(library: Library, items: Mapping[str, Item]) -> dict[str, Item]:
    """The notes to some things, and to these notes, by their ids: the last that was written first.

    What else one of them is about stays where it is.
    """
    notes: dict[str, Item] = {}
    left = list(items)
    while left:
        for note in library.made_of(left.pop(), kind="note"):
            if note.id not in notes and note.id not in items:
                notes[note.id] = note
                left.append(note.id)
    return dict(sorted(notes.items(), key=lambda entry: entry[1].created, reverse=True))


def import_bundle(library: Library, path: str | Path, *, author: str) -> list[Item]:
    """Keep what somebody exported.

    Args:
        library: Where.
        path: What `export_bundle` wrote.
        author: Whose it is here; whose it was stays in its details.

    Returns:
        What is kept; what was there already stays as it was.

    Raises:
        InputError: If it is no such file, holds anything else, or a file in it is not what it was
            when it was exported.
        WorkError: If it cannot be written.
    """
    path = as_path(path)
    try:
        content = limited_bytes(path)
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror or error}); give a file that can"
        ) from error
    try:
        with opened(content) as archive:
            items = _listed(archive)
            files = {file.digest: _checked(archive, file) for item in items for file in item.files}
            expected = {_LIST, *(_entry(file) for item in items for file in item.files)}
            for name in archive.namelist():
                if name not in expected:
                    raise InputError(
                        f"it holds {quoted(name)}, which no list of it names; export it again"
                    )
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    adopted = []
    for item in reversed(items):
        own = {file.role: files[file.digest] for file in item.files}
        _require_content(item, own, path)
        made_by = item.details.get("made_by", item.author)
        mine = replace(item, author=author, details={**item.details, "made_by": made_by})
        adopted.append((mine, own))
    try:
        return library.adopt(adopted)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _require_content(item: Item, files: Mapping[str, bytes], path: Path) -> None:
    """Refuse demonstrations and rules that are not what the list says, and what links need."""
    where = f"{path}: {quoted(item.name)}"
    if item.kind in UNLISTED:  # nobody could check whether these are what they say they are
        raise InputError(f"{where} is nothing that is exported; export the rest again")
    try:
        digest = digest_of_files(item.kind, files)
    except InputError as error:
        raise InputError(f"{where} cannot be read: {error}") from error
    if digest is not None and digest != item.digest:
        raise InputError(f"{where} is not what was exported (its digest differs); export it again")


def _entry(file: ItemFile) -> str:
    return f"files/{file.digest}{file.ending}"


def _listed(archive: zipfile.ZipFile) -> list[Item]:
    """What is in a bundle, what others came from last."""
    try:
        entry = archive.getinfo(_LIST)
    except KeyError as error:
        raise InputError("it is no file that was exported from a library") from error
    text = entry_content(archive, entry, _LONGEST_LIST + 1)
    if len(text) > _LONGEST_LIST:
        raise InputError("its list is longer than 16 MB; export fewer things at once")
    try:
        document = parse_json(text)
    except ValueError as error:
        raise InputError(f"its list cannot be read ({error}); export it again") from error
    if not isinstance(document, dict) or document.pop("format", None) != _FORMAT:
        raise InputError("it is no file that was exported from a library")
    version = document.pop("version", None)
    if version != _VERSION:
        raise InputError(
            f"it is of version {quoted(version)}, and this program reads version {_VERSION}; "
            "install the version that wrote it"
        )
    try:
        listed = conformed(document, _Bundle)
    except MisfitError as error:
        raise InputError(f"its list is damaged ({error}); export it again") from error
    return [_item(one) for one in listed.items]


def _item(one: _ListedItem) -> Item:
    return Item(
        id=one.id,
        kind=one.kind,
        name=one.name,
        author=one.author,
        created=one.created,
        digest=one.digest,
        lineage=one.lineage,
        parent=one.parent or "",
        came_from=tuple(one.came_from),
        command=one.command,
        details=one.details,
        shared=one.shared,
        files=tuple(ItemFile(f.role, f.digest, f.ending, f.size) for f in one.files),
        approvals=tuple(Approval(a.author, a.note, a.created) for a in one.approvals),
    )


def _checked(archive: zipfile.ZipFile, file: ItemFile) -> bytes:
    """The content of a file; that it is what was exported is checked where it is kept."""
    try:
        entry = archive.getinfo(_entry(file))
    except KeyError as error:
        raise InputError(f"the file {_entry(file)} is missing in it; export it again") from error
    require_memory(file.size)
    content = entry_content(archive, entry, file.size + 1)
    if len(content) != file.size:
        raise InputError(f"the file {_entry(file)} is damaged; export it again")
    return content
