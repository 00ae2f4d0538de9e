"""The tables of a library, as the newest migration leaves them."""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    ForeignKey,
    Integer,
    MetaData,
    String,
    Table,
    Text,
)

NEWEST = "0001"
"""The newest migration."""

metadata = MetaData()

versions = Table("alembic_version", MetaData(), Column("version_num", String(32), primary_key=True))
"""Where Alembic keeps which migration was the last."""

# Times are UTC, as ISO 8601 writes them with microseconds: they sort as texts, everywhere alike.

items = Table(
    "items",
    metadata,
    Column("id", String(26), primary_key=True),
    # In the order of their adding, where two have the same time.
    Column("number", Integer, nullable=False, unique=True),
    Column("kind", String(20), nullable=False, index=True),
    Column("name", Text, nullable=False),
    Column("author", Text, nullable=False, index=True),
    Column("created", String(32), nullable=False),
    Column("digest", String(64), nullable=False, index=True),
    Column("lineage", String(26), nullable=False, index=True),
    Column("parent", String(26), nullable=False),
    Column("came_from", Text, nullable=False),
    Column("command", Text, nullable=False),
    Column("details", Text, nullable=False),
    Column("shared", Boolean, nullable=False),
    Column("removed", String(32)),
)

files = Table(
    "files",
    metadata,
    Column("item", String(26), ForeignKey("items.id", ondelete="CASCADE"), primary_key=True),
    Column("role", String(60), primary_key=True),
    Column("digest", String(32), nullable=False, index=True),
    Column("ending", String(16), nullable=False),
    Column("size", BigInteger, nullable=False),
)

approvals = Table(
    "approvals",
    metadata,
    Column("item", String(26), ForeignKey("items.id", ondelete="CASCADE"), primary_key=True),
    Column("author", Text, primary_key=True),
    Column("note", Text, nullable=False),
    Column("created", String(32), nullable=False),
)
