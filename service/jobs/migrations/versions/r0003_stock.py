"""The file of a blank that is a STEP file."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Jobs from before had none."""
    with op.batch_alter_table("jobs") as table:
        table.add_column(sa.Column("stock_sha256", sa.String(64), nullable=True))


def downgrade() -> None:
    """Forget it."""
    with op.batch_alter_table("jobs") as table:
        table.drop_column("stock_sha256")
