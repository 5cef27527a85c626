"""What the newest attempt at a job took over from those before."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Nothing was taken over so far."""
    op.add_column("jobs", sa.Column("resumed_json", sa.Text, nullable=True))


def downgrade() -> None:
    """Forget it."""
    with op.batch_alter_table("jobs") as table:
        table.drop_column("resumed_json")
