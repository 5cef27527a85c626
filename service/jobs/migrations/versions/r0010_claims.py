"""How often a job was claimed, apart from how often it was started."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """None so far: what was claimed before is claimed again when its lease runs out."""
    op.add_column("jobs", sa.Column("claims", sa.Integer, nullable=False, server_default="0"))


def downgrade() -> None:
    """Forget them."""
    with op.batch_alter_table("jobs") as table:
        table.drop_column("claims")
