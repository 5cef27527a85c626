"""When a job was started last, and when it has to have ended."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Jobs from before have neither."""
    with op.batch_alter_table("jobs") as table:
        table.add_column(sa.Column("started", sa.Float, nullable=True))
        table.add_column(sa.Column("deadline", sa.Float, nullable=True))


def downgrade() -> None:
    """Forget both."""
    with op.batch_alter_table("jobs") as table:
        table.drop_column("deadline")
        table.drop_column("started")
