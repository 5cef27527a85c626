"""Labels of jobs as rows, so that a job is found by them."""

from __future__ import annotations

import json

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Jobs from before are found by theirs too."""
    labels = op.create_table(
        "labels",
        sa.Column("job_id", sa.String(40), primary_key=True),
        sa.Column("key", sa.String(32), primary_key=True),
        sa.Column("value", sa.String(200), nullable=False),
    )
    op.create_index("ix_labels_value", "labels", ["key", "value", "job_id"])
    connection = op.get_bind()
    jobs = sa.table("jobs", sa.column("id"), sa.column("labels_json"))
    for row in list(connection.execute(sa.select(jobs))):
        try:
            found = json.loads(row.labels_json)
        except ValueError:
            continue
        if isinstance(found, dict) and found:
            connection.execute(labels.insert(), [{"job_id": row.id, "key": k, "value": v} for k, v in found.items()])


def downgrade() -> None:
    """The jobs keep theirs."""
    op.drop_table("labels")
