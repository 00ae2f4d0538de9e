"""Rows of a library's tables, and what they stand for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, Row, func, insert, select

from sarl_core.explaining.words.sign_off import Approval
from sarl_core.library import tables
from sarl_core.library.items import Item, ItemFile


def insert_item(connection: Connection, item: Item) -> None:
    """Write an item with its files and approvals."""
    number = connection.execute(select(func.max(tables.items.c.number))).scalar() or 0
    connection.execute(
        insert(tables.items).values(
            id=item.id,
            number=number + 1,
            kind=item.kind,
            name=item.name,
            author=item.author,
            created=time_text(item.created),
            digest=item.digest,
            lineage=item.lineage,
            parent=item.parent,
            came_from=json.dumps(list(item.came_from)),
            command=item.command,
            details=json.dumps(dict(item.details)),
            shared=item.shared,
            removed=None,
        )
    )
    for one in item.files:
        connection.execute(
            insert(tables.files).values(
                item=item.id, role=one.role, digest=one.digest, ending=one.ending, size=one.size
            )
        )
    for approval in item.approvals:
        insert_approval(connection, item.id, approval)


def insert_approval(connection: Connection, identifier: str, approval: Approval) -> None:
    """Write an approval of an item."""
    connection.execute(
        insert(tables.approvals).values(
            item=identifier,
            author=approval.author,
            note=approval.note,
            created=time_text(approval.created),
        )
    )


def item_of_row(row: Row[Any], files: Sequence[ItemFile], approvals: Sequence[Approval]) -> Item:
    """What a row of the items stands for, with what other tables hold of it."""
    return Item(
        id=row.id,
        kind=row.kind,
        name=row.name,
        author=row.author,
        created=datetime.fromisoformat(row.created),
        digest=row.digest,
        lineage=row.lineage,
        parent=row.parent,
        came_from=tuple(json.loads(row.came_from)),
        command=row.command,
        details=json.loads(row.details),
        shared=bool(row.shared),
        removed=None if row.removed is None else datetime.fromisoformat(row.removed),
        files=tuple(files),
        approvals=tuple(approvals),
    )


def files_where(connection: Connection, *wanted: Any) -> list[tuple[str, ItemFile]]:
    """Ids of things, and files of theirs."""
    rows = connection.execute(
        select(tables.files).where(*wanted).order_by(tables.files.c.item, tables.files.c.role)
    )
    return [(row.item, ItemFile(row.role, row.digest, row.ending, row.size)) for row in rows]


def sizes_where(connection: Connection, *wanted: Any) -> dict[str, int]:
    """Bytes of each file, by its digest, of things that are not removed."""
    at = tables.files.c
    rows = connection.execute(
        select(at.digest, at.size)
        .join(tables.items, tables.items.c.id == at.item)
        .where(tables.items.c.removed.is_(None), *wanted)
        .distinct()
    )
    return {row.digest: row.size for row in rows}


def time_text(time: datetime) -> str:
    """A time as it stands in a table."""
    return time.isoformat(timespec="microseconds")
