"""Time at which the files of a job expired."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Jobs from before have all of theirs."""
    with op.batch_alter_table("jobs") as table:
        table.add_column(sa.Column("expired", sa.Float, nullable=True))
        table.create_index("ix_jobs_expiry", ["expired", "finished"])


def downgrade() -> None:
    """Forget it."""
    with op.batch_alter_table("jobs") as table:
        table.drop_index("ix_jobs_expiry")
        table.drop_column("expired")
