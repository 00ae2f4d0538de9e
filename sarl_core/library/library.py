"""What people make, kept: added whole or not at all, found by its id, removed with undo."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Self

from sqlalchemy import Connection, delete, or_, select, update

from sarl_core.errors import InputError, quoted
from sarl_core.explaining.words.sign_off import Approval
from sarl_core.library import tables
from sarl_core.library.database import Database
from sarl_core.library.file_store import FileStore
from sarl_core.library.items import (
    KINDS,
    UNLISTED,
    Item,
    ItemFile,
    Kind,
    as_id,
    new_id,
)
from sarl_core.library.place import LibraryPlace, place_of
from sarl_core.library.rows import (
    files_where,
    insert_approval,
    insert_item,
    item_of_row,
    sizes_where,
    time_text,
)

_GIGABYTE = 10**9
_LONGEST_NAME = 200
_LONGEST_NOTE = 10_000
_LONGEST_DETAILS = 2**20
_NEARLY = 0.9  # of a quota: from here on it is told
_UNDONE_FOR = timedelta(days=30)  # after which what was removed is gone for good
_LEFT_OVER_FOR = timedelta(days=1)  # after which nobody is about to speak of a file any more


@dataclass(frozen=True)
class Quota:
    """How much may be kept, in bytes.

    Attributes:
        author: By one author.
        whole: By all of them.
    """

    author: int = 5 * _GIGABYTE
    whole: int = 50 * _GIGABYTE


@dataclass(frozen=True)
class Usage:
    """How much is kept, in bytes; a file that is part of several things counts once.

    Attributes:
        author: By one author.
        whole: By all of them.
        quota: What may be.
    """

    author: int
    whole: int
    quota: Quota

    @property
    def warning(self) -> str:
        """What should be known before a quota is reached; "" where there is room."""
        for used, most, whose in (
            (self.author, self.quota.author, "what you keep"),
            (self.whole, self.quota.whole, "what all keep"),
        ):
            if used >= _NEARLY * most:
                return (
                    f"{whose} takes {_in_gigabytes(used)} of {_in_gigabytes(most)}; remove what is "
                    "no longer needed"
                )
        return ""


class Library:
    """What is kept in one place.

    Any number of processes may have it open. Each change is whole or is not at all, also where
    the process is killed.
    """

    def __init__(
        self, place: str | Path | LibraryPlace | None = None, *, quota: Quota | None = None
    ):
        """Open it; it is made where there is none.

        Args:
            place: As of `place_of`.
            quota: How much may be kept.

        Raises:
            InputError: If there is something else, or one of a newer version.
            WorkError: If it cannot be made, reached or read.
        """
        self.place = place if isinstance(place, LibraryPlace) else place_of(place)
        self.quota = quota or Quota()
        self._database = Database(self.place)
        self._store = FileStore(self.place.folder / "files")

    def close(self) -> None:
        """Let go of it."""
        self._database.close()

    def __enter__(self) -> Self:
        """Itself; in the end it is closed."""
        return self

    def __exit__(self, *_: object) -> None:
        """Let go of it."""
        self.close()

    def add(
        self,
        kind: Kind,
        name: str,
        files: Mapping[str, tuple[Path | bytes, str]],
        *,
        author: str,
        digest: str = "",
        parent: str = "",
        came_from: Sequence[str] = (),
        command: str = "",
        details: Mapping[str, Any] | None = None,
        shared: bool = False,
    ) -> Item:
        """Keep something.

        Args:
            kind: What it is.
            name: What it is called.
            files: Of each role, the file or its content, and the ending of its name.
            author: Whose it is.
            digest: Of what it holds.
            parent: Id of the version that it was made from.
            came_from: Ids of what it was made of.
            command: That makes it again.
            details: More about it, as JSON has it.
            shared: Whether it stands in everybody's list.

        Returns:
            What is kept.

        Raises:
            InputError: If it would be more than may be kept, a name is empty or too long, or the
                parent is none.
            WorkError: If it cannot be written.
        """
        if kind not in KINDS:
            raise InputError(f"{quoted(kind)} is no kind of thing; choose from {', '.join(KINDS)}")
        written = _written(details or {})
        described = {
            role: self._store.describe(role, source, ending)
            for role, (source, ending) in files.items()
        }
        with self._database.reading() as connection:
            self._require_room(connection, author, described.values())
        identifier = new_id()
        first = self.item(parent).lineage if parent else identifier
        item = Item(
            id=identifier,
            kind=kind,
            name=_named(name),
            author=_author(author),
            created=_now(),
            digest=digest,
            lineage=first,
            parent=parent,
            came_from=tuple(came_from),
            command=command,
            details=json.loads(written),
            shared=shared,
            files=tuple(described.values()),
        )
        contents = {role: source for role, (source, _) in files.items()}
        self._put(item, contents)
        with self._database.writing() as connection:
            self._require_room(connection, author, item.files)  # others may have written meanwhile
            insert_item(connection, item)
            self._put(item, contents)  # who removed the last thing with this file may be faster
        return item

    def adopt(self, items: Sequence[tuple[Item, Mapping[str, Path | bytes]]]) -> list[Item]:
        """Keep things that come from another library, under their ids: all of them or none.

        Args:
            items: As they were there, each with the content of its files, by role.

        Returns:
            What is kept: where an id is here already, what is here.

        Raises:
            InputError: If it would be more than may be kept, or a file is not what was said.
            WorkError: If they cannot be written.
        """
        for item, files in items:
            for file in item.files:
                if self._store.describe(file.role, files[file.role], file.ending) != file:
                    raise InputError(
                        f"the file {quoted(file.role)} of {quoted(item.name)} is not what it was "
                        "when it was exported; export it again"
                    )
        with self._database.reading() as connection:
            self._require_rooms(connection, items)
        for item, files in items:
            self._put(item, files)
        with self._database.writing() as connection:
            self._require_rooms(connection, items)
            for item, files in items:
                known = select(tables.items.c.id).where(tables.items.c.id == item.id)
                if connection.execute(known).first() is None:
                    insert_item(connection, item)
                    self._put(item, files)
        return [self.item(item.id) for item, _ in items]

    def item(self, identifier: str) -> Item:
        """What an id names, for whoever has it.

        Args:
            identifier: With "library:" before it or without.

        Returns:
            The thing, removed or not.

        Raises:
            InputError: If it is no id, or there is none.
            WorkError: If the library cannot be read.
        """
        bare = as_id(identifier)
        items = self._select(tables.items.c.id == bare)
        if not items:
            raise InputError(
                f"the library in {self.place.said} has nothing with the id {bare}; perhaps it is "
                "in another library, or was removed for good"
            )
        return items[0]

    def items(
        self, author: str | None = None, *, kind: Kind | None = None, removed: bool = False
    ) -> list[Item]:
        """What stands in somebody's list, the newest first.

        Args:
            author: Their own things, and those that are shared; everything where None.
            kind: Of this kind only; all that lists show where not given.
            removed: What they removed and may have back, in place of what is there.

        Raises:
            WorkError: If the library cannot be read.
        """
        at = tables.items.c
        wanted: list[Any] = [at.removed.is_not(None) if removed else at.removed.is_(None)]
        if author is not None:
            wanted.append(at.author == author if removed else or_(at.author == author, at.shared))
        wanted.append(at.kind.not_in(UNLISTED) if kind is None else at.kind == kind)
        return self._select(*wanted)

    def versions(self, identifier: str) -> list[Item]:
        """A thing and all other versions of it that are not removed, the newest first.

        Args:
            identifier: Of any of them.

        Raises:
            InputError: If there is none.
            WorkError: If the library cannot be read.
        """
        lineage, at = self.item(identifier).lineage, tables.items.c
        return self._select(at.lineage == lineage, at.removed.is_(None))

    def with_digest(self, digest: str, *, kind: Kind | None = None) -> list[Item]:
        """All things that hold the same, the newest first.

        Args:
            digest: Of what they hold.
            kind: Of this kind only.

        Raises:
            WorkError: If the library cannot be read.
        """
        at = tables.items.c
        wanted = [at.digest == digest, at.removed.is_(None)]
        return self._select(*wanted, *([] if kind is None else [at.kind == kind]))

    def made_of(self, identifier: str, *, kind: Kind | None = None) -> list[Item]:
        """All things that say they were made of one, or are about it, the newest first.

        Args:
            identifier: Of the one.
            kind: Of this kind only.

        Raises:
            InputError: If it is no id.
            WorkError: If the library cannot be read.
        """
        at = tables.items.c
        wanted = [at.came_from.contains(f'"{as_id(identifier)}"'), at.removed.is_(None)]
        return self._select(*wanted, *([] if kind is None else [at.kind == kind]))

    def path(self, item: Item, role: str | None = None) -> Path:
        """Where a file of a thing lies; it must not be changed.

        Args:
            item: The thing.
            role: Of the file; may be left out where there is one.

        Raises:
            InputError: If it has none of that role, or the file is missing.
        """
        files = [one for one in item.files if role is None or one.role == role]
        if len(files) != 1:
            roles = ", ".join(one.role for one in item.files) or "none"
            raise InputError(
                f"{quoted(item.name)} has no one file {quoted(role or '')}; its files are: {roles}"
            )
        return self._store.located(files[0], quoted(item.name))

    def approve(self, identifier: str, *, author: str, note: str = "") -> Item:
        """Approve something by name; who did so before says it anew.

        Args:
            identifier: Of what.
            author: Who approves it.
            note: What is said to it.

        Raises:
            InputError: If there is none, or the note is too long.
            WorkError: If it cannot be written.
        """
        item = self._standing(identifier)
        if len(note) > _LONGEST_NOTE:
            raise InputError(
                f"the note has {len(note):,} characters, more than {_LONGEST_NOTE:,}; shorten it"
            )
        approval = Approval(_author(author), note, _now())
        with self._database.writing() as connection:
            at = tables.approvals.c
            connection.execute(
                delete(tables.approvals).where(at.item == item.id, at.author == approval.author)
            )
            insert_approval(connection, item.id, approval)
        return self.item(item.id)

    def rename(self, identifier: str, name: str, *, author: str) -> Item:
        """Call something otherwise.

        Raises:
            InputError: If it is somebody else's, or the name is empty or too long.
            WorkError: If it cannot be written.
        """
        return self._update(identifier, author, {"name": _named(name)})

    def annotate(self, identifier: str, details: Mapping[str, Any], *, author: str) -> Item:
        """Say more about something: what it holds stays what it was.

        Args:
            identifier: Of what.
            details: What is said besides, or in the place of what was said under these names.
            author: Whose it is.

        Raises:
            InputError: If it is somebody else's, or the details are too long.
            WorkError: If it cannot be written.
        """
        known = self.item(identifier).details
        return self._update(identifier, author, {"details": _written({**known, **details})})

    def share(self, identifier: str, *, author: str, shared: bool = True) -> Item:
        """Let something stand in everybody's list, or no longer.

        Raises:
            InputError: If it is somebody else's.
            WorkError: If it cannot be written.
        """
        return self._update(identifier, author, {"shared": shared})

    def remove(self, identifier: str, *, author: str) -> Item:
        """Take something out of all lists; `restore` brings it back for 30 days.

        Raises:
            InputError: If it is somebody else's.
            WorkError: If it cannot be written.
        """
        return self._update(identifier, author, {"removed": time_text(_now())})

    def restore(self, identifier: str, *, author: str) -> Item:
        """Bring back what was removed.

        Raises:
            InputError: If it is somebody else's, or would be more than may be kept.
            WorkError: If it cannot be written.
        """
        item = self.item(identifier)
        with self._database.reading() as connection:
            self._require_room(connection, item.author, item.files)
        return self._update(identifier, author, {"removed": None})

    def usage(self, author: str) -> Usage:
        """How much is kept.

        Args:
            author: By whom, and by all.

        Raises:
            WorkError: If the library cannot be read.
        """
        with self._database.reading() as connection:
            own = sizes_where(connection, tables.items.c.author == author)
            return Usage(sum(own.values()), sum(sizes_where(connection).values()), self.quota)

    def sweep(self) -> int:
        """Remove for good what was removed 30 days ago, and files that nothing speaks of.

        Returns:
            How many things are gone, and so for good.

        Raises:
            WorkError: If it cannot be written.
        """
        before = time_text(_now() - _UNDONE_FOR)
        at = tables.items.c
        with self._database.writing() as connection:
            gone = connection.execute(select(at.id).where(at.removed < before)).scalars().all()
            files = [
                file
                for identifier in gone
                for file in files_where(connection, tables.files.c.item == identifier)
            ]
            connection.execute(delete(tables.items).where(at.id.in_(gone)))
        # In a step of its own: killed between the two, a file is left over, and none is missing.
        for file in [file for _, file in files] + self._store.older_than(_LEFT_OVER_FOR):
            with self._database.writing() as connection:
                if not files_where(connection, tables.files.c.digest == file.digest):
                    self._store.forget(file)
        return len(gone)

    def _select(self, *wanted: Any) -> list[Item]:
        with self._database.reading() as connection:
            rows = connection.execute(
                select(tables.items).where(*wanted).order_by(tables.items.c.number.desc())
            ).all()
            chosen = select(tables.items.c.id).where(*wanted)
            files: dict[str, list[ItemFile]] = {}
            for owner, file in files_where(connection, tables.files.c.item.in_(chosen)):
                files.setdefault(owner, []).append(file)
            approvals: dict[str, list[Approval]] = {}
            at = tables.approvals.c
            for one in connection.execute(
                select(tables.approvals).where(at.item.in_(chosen)).order_by(at.created)
            ):
                approvals.setdefault(one.item, []).append(
                    Approval(one.author, one.note, datetime.fromisoformat(one.created))
                )
        return [item_of_row(row, files.get(row.id, ()), approvals.get(row.id, ())) for row in rows]

    def _standing(self, identifier: str) -> Item:
        item = self.item(identifier)
        if item.removed is not None:
            raise InputError(f"{quoted(item.name)} was removed; bring it back first")
        return item

    def _update(self, identifier: str, author: str, values: Mapping[str, Any]) -> Item:
        item = self.item(identifier)
        if item.author != author:
            raise InputError(
                f"{quoted(item.name)} is {quoted(item.author)}'s, who alone may change that; keep "
                "a version of your own"
            )
        with self._database.writing() as connection:
            connection.execute(
                update(tables.items).where(tables.items.c.id == item.id).values(**values)
            )
        return self.item(item.id)

    def _put(self, item: Item, contents: Mapping[str, Path | bytes]) -> None:
        for file in item.files:
            self._store.put(file, contents[file.role])

    def _require_rooms(
        self, connection: Connection, items: Sequence[tuple[Item, Mapping[str, Path | bytes]]]
    ) -> None:
        for author in dict.fromkeys(item.author for item, _ in items):
            files = [file for item, _ in items if item.author == author for file in item.files]
            self._require_room(connection, author, files)

    def _require_room(self, connection: Connection, author: str, files: Iterable[ItemFile]) -> None:
        """Refuse what is more than may be kept; what is there already takes nothing."""
        sizes = {file.digest: file.size for file in files}
        own = tables.items.c.author == author
        for wanted, most, whose in (
            ((own,), self.quota.author, f"{author} may keep"),
            ((), self.quota.whole, "the library may keep"),
        ):
            there = sizes_where(connection, *wanted)
            after = sum((there | sizes).values())
            if after > most and sizes.keys() - there.keys():
                raise InputError(
                    f"it would be {_in_gigabytes(after)}, more than the {_in_gigabytes(most)} that "
                    f"{whose}; remove what is no longer needed"
                )


def _written(details: Mapping[str, Any]) -> str:
    text = json.dumps(dict(details), allow_nan=False)
    if len(text) > _LONGEST_DETAILS:
        raise InputError("the details have more than 1 MB; put them into a file")
    return text


def _named(name: str) -> str:
    """A name that people can read, on one line."""
    text = " ".join("".join(sign if sign.isprintable() else " " for sign in name).split())
    if not text:
        raise InputError("a thing that is kept needs a name; give one")
    if len(text) > _LONGEST_NAME:
        raise InputError(
            f"the name has {len(text):,} characters, more than {_LONGEST_NAME}; shorten it"
        )
    return text


def _author(author: str) -> str:
    try:
        return _named(author)
    except InputError as error:
        raise InputError("an author needs a name of at most 200 characters; give one") from error


def _now() -> datetime:
    return datetime.now(UTC)


def _in_gigabytes(size: int) -> str:
    if size < 10**8:
        return f"{size / 10**6:,.1f} MB"
    return f"{size / 10**9:,.1f} GB"
