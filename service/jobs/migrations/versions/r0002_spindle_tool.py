"""The tool that stands in the spindle before the first line of a program to verify."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Jobs from before had none."""
    with op.batch_alter_table("jobs") as table:
        table.add_column(sa.Column("spindle_tool", sa.Integer, nullable=False, server_default="0"))


def downgrade() -> None:
    """Forget it."""
    with op.batch_alter_table("jobs") as table:
        table.drop_column("spindle_tool")
