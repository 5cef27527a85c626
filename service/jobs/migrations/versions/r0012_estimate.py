"""The memory and the time that a job is expected to take."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """No job has an estimate so far."""
    op.add_column("jobs", sa.Column("estimate_json", sa.Text, nullable=True))


def downgrade() -> None:
    """Forget it."""
    with op.batch_alter_table("jobs") as table:
        table.drop_column("estimate_json")
