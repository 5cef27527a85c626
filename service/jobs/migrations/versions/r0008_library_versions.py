"""Owners and versions of library entries, and which of them a job used."""

from __future__ import annotations

import time

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Entries belonged to everybody before: they become shared, as their first version."""
    made = op.create_table(
        "entries",
        sa.Column("owner", sa.String(64), primary_key=True),
        sa.Column("shelf", sa.String(16), primary_key=True),
        sa.Column("name", sa.String(64), primary_key=True),
        sa.Column("version", sa.Integer, primary_key=True),
        sa.Column("entry_json", sa.Text, nullable=False),
        sa.Column("created", sa.Float, nullable=False),
        sa.Column("deleted", sa.Float, nullable=True),
    )
    connection = op.get_bind()
    old = sa.table("library", sa.column("shelf"), sa.column("name"), sa.column("entry_json"))
    rows = [{"owner": "", "shelf": r.shelf, "name": r.name, "version": 1, "entry_json": r.entry_json,
             "created": time.time()} for r in connection.execute(sa.select(old))]
    if rows:
        connection.execute(made.insert(), rows)
    op.drop_table("library")
    with op.batch_alter_table("jobs") as table:
        table.add_column(sa.Column("library_json", sa.Text, nullable=True))


def downgrade() -> None:
    """Keep the newest shared version of each entry; those of principals are lost."""
    with op.batch_alter_table("jobs") as table:
        table.drop_column("library_json")
    made = op.create_table(
        "library",
        sa.Column("shelf", sa.String(16), primary_key=True),
        sa.Column("name", sa.String(64), primary_key=True),
        sa.Column("entry_json", sa.Text, nullable=False),
    )
    connection = op.get_bind()
    names = ("owner", "shelf", "name", "version", "entry_json", "deleted")
    entries = sa.table("entries", *(sa.column(c) for c in names))
    query = sa.select(entries).where(entries.c.owner == "", entries.c.deleted.is_(None)).order_by(entries.c.version)
    newest = {(r.shelf, r.name): r.entry_json for r in connection.execute(query)}
    if newest:
        connection.execute(made.insert(), [{"shelf": s, "name": n, "entry_json": e} for (s, n), e in newest.items()])
    op.drop_table("entries")
