"""Webhooks of jobs, and what a job came to in a few figures."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

NEW = ("webhook_url", "webhook_state", "webhook_attempts", "webhook_due", "webhook_problem", "summary_json")


def upgrade() -> None:
    """Jobs from before have none."""
    with op.batch_alter_table("jobs") as table:
        table.add_column(sa.Column("webhook_url", sa.String(2000), nullable=True))
        table.add_column(sa.Column("webhook_state", sa.String(16), nullable=True))
        table.add_column(sa.Column("webhook_attempts", sa.Integer, nullable=False, server_default="0"))
        table.add_column(sa.Column("webhook_due", sa.Float, nullable=True))
        table.add_column(sa.Column("webhook_problem", sa.String(200), nullable=True))
        table.add_column(sa.Column("summary_json", sa.Text, nullable=True))
        table.create_index("ix_jobs_webhook", ["webhook_state", "webhook_due"])


def downgrade() -> None:
    """Forget them."""
    with op.batch_alter_table("jobs") as table:
        table.drop_index("ix_jobs_webhook")
        for name in NEW:
            table.drop_column(name)
