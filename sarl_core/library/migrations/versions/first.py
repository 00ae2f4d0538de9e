"""The tables at the beginning."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Make them."""
    op.create_table(
        "items",
        sa.Column("id", sa.String(26), primary_key=True),
        sa.Column("number", sa.Integer(), nullable=False, unique=True),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("author", sa.Text(), nullable=False),
        sa.Column("created", sa.String(32), nullable=False),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.Column("lineage", sa.String(26), nullable=False),
        sa.Column("parent", sa.String(26), nullable=False),
        sa.Column("came_from", sa.Text(), nullable=False),
        sa.Column("command", sa.Text(), nullable=False),
        sa.Column("details", sa.Text(), nullable=False),
        sa.Column("shared", sa.Boolean(), nullable=False),
        sa.Column("removed", sa.String(32)),
    )
    for column in ("kind", "author", "digest", "lineage"):
        op.create_index(f"ix_items_{column}", "items", [column])
    op.create_table(
        "files",
        sa.Column(
            "item", sa.String(26), sa.ForeignKey("items.id", ondelete="CASCADE"), primary_key=True
        ),
        sa.Column("role", sa.String(60), primary_key=True),
        sa.Column("digest", sa.String(32), nullable=False),
        sa.Column("ending", sa.String(16), nullable=False),
        sa.Column("size", sa.BigInteger(), nullable=False),
    )
    op.create_index("ix_files_digest", "files", ["digest"])
    op.create_table(
        "approvals",
        sa.Column(
            "item", sa.String(26), sa.ForeignKey("items.id", ondelete="CASCADE"), primary_key=True
        ),
        sa.Column("author", sa.Text(), primary_key=True),
        sa.Column("note", sa.Text(), nullable=False),
        sa.Column("created", sa.String(32), nullable=False),
    )
